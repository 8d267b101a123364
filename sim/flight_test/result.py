"""What a flight showed."""

from dataclasses import dataclass, field

from sim.flight_test.judge import Judged


@dataclass
class Result:
    """The encounters of a flight with their verdicts. `problem`: why it ended early."""

    autopilot: str = "unknown"
    version: str | None = None
    companion: str = ""
    simulation: str | None = None
    encounters: list[Judged] = field(default_factory=list)
    failures: dict[str, list[str]] = field(default_factory=dict)
    problem: str | None = None
    rate: float = 1.0
    wall_s: float = 0.0
    left_out: list[str] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Whether all encounters that were flown came out as expected; those left out do not count."""
        return self.problem is None and bool(self.encounters) and not any(self.failures.values())
