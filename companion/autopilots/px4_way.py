"""The interface of every way of flying PX4: one mode that obeys us, and the messages that it needs."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from companion.autopilots.adapter import Adapter, GuidanceCommand, RefusedValue
from companion.avoidance import Control
from companion.mavlink.dialect import Message
from companion.mavlink.facts import Fact


class Way(ABC):
    """One way of flying; its methods are those of `Adapter`. `parameters` are PX4's newest values by name."""

    mode: ClassVar[int]
    entry_s: ClassVar[float] = 0.0
    exit_s: ClassVar[float] = 0.0
    heartbeat_interval_s: ClassVar[float | None] = None

    def __init__(self, adapter: Adapter, parameters: Mapping[str, float]) -> None:
        self._adapter = adapter
        self._parameters = parameters

    @property
    @abstractmethod
    def setpoint_loss_mode(self) -> int | None:
        """The mode entered soon after our setpoints end; `None`: unknown, or one that a pilot may choose."""

    @property
    @abstractmethod
    def last_setpoint_s(self) -> float:
        """When the newest of those setpoints was sent without which it leaves the mode by itself."""

    @property
    def lost_controls(self) -> frozenset[Control]:
        """The controls that cannot be flown."""
        return frozenset()

    @abstractmethod
    def entering(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        """Messages while the mode is being entered."""

    @abstractmethod
    def command(self, command: GuidanceCommand, now_s: float, *, urgent: bool) -> list[Message]:
        """Messages that fly the command."""

    @abstractmethod
    def leaving(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        """Messages while the mode is being left."""

    @abstractmethod
    def observe(self, fact: Fact, now_s: float) -> None:
        """Process a fact; the answers to commands are known by then."""

    def tick(self, now_s: float) -> list[Message]:  # noqa: ARG002
        """Messages that are due to be repeated."""
        return []

    @abstractmethod
    def drop_commands(self) -> None:
        """Forget what was commanded, because the aircraft is no longer ours."""

    @abstractmethod
    def restarted(self) -> None:
        """Forget what the autopilot refused."""

    def refusals(self) -> list[str]:
        """What was refused since the last call, besides commands, in words."""
        return []

    def refused_values(self) -> list[RefusedValue]:
        """Values that were refused since the last call."""
        return []
