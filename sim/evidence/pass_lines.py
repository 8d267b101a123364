"""Published pass lines, and whether figures with intervals meet them."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class PassLine:
    """Limits of the risk ratio and of the well clear ratio, and who names them."""

    name: str
    risk_ratio: float
    lowc_ratio: float
    source: str


_F3442 = "ASTM F3442, as quoted by regulators"
PASS_LINES = (
    PassLine("cooperative traffic", 0.18, 0.40, _F3442),
    PassLine("non-cooperative traffic", 0.30, 0.50, _F3442),
    PassLine("coordinating aircraft", 0.04, 0.40, "UK CAA CAP 3015 v2 (September 2026), second hand"),
)
# For comparison, not a line to pass.
HUMAN = "Human see-and-avoid: risk ratio 0.63 for one pilot, 0.33 for two (ASSURE A65, 2024, second hand)."

MET, NOT_SHOWN, NOT_MET = "met", "not shown", "not met"


def verdicts(row: dict[str, Any]) -> dict[str, str]:
    """For each line: met with the whole intervals, met by the estimates only (not shown), or not met."""
    return {line.name: _verdict(row, line) for line in PASS_LINES}


def _verdict(row: dict[str, Any], line: PassLine) -> str:
    limits = {"risk_ratio": line.risk_ratio, "lowc_ratio": line.lowc_ratio}
    if any(row[name] is None for name in limits):
        return NOT_SHOWN
    if any(row[name] > limit for name, limit in limits.items()):
        return NOT_MET
    whole = all(row[f"{name}_ci95"][1] <= limit for name, limit in limits.items())
    return MET if whole else NOT_SHOWN
