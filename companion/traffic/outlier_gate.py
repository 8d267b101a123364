"""Believing an absurd jump only when the next report bears it out."""

from typing import Any, Generic, Protocol, Self, TypeVar

FixT = TypeVar("FixT")
FixContra = TypeVar("FixContra", contravariant=True)


class Estimate(Protocol[FixContra]):
    """What `OutlierGate` needs of an estimate."""

    def restart(self, fix: FixContra) -> Self: ...
    def is_absurd(self, fix: FixContra) -> bool: ...
    def correct(self, fix: FixContra) -> None: ...


EstimateT = TypeVar("EstimateT", bound=Estimate[Any])


class OutlierGate(Generic[EstimateT, FixT]):
    """An estimate, and beside it the one absurd report that may turn out to be true."""

    __slots__ = ("_suspect", "estimate")

    def __init__(self, estimate: EstimateT) -> None:
        self.estimate = estimate
        self._suspect: EstimateT | None = None

    def receive(self, fix: FixT) -> bool:
        """Take in a report; False when it was put aside as absurd."""
        if self.estimate.is_absurd(fix):
            if self._suspect is None or self._suspect.is_absurd(fix):
                self._suspect = self.estimate.restart(fix)
                return False
            self.estimate = self._suspect
        self._suspect = None
        self.estimate.correct(fix)
        return True
