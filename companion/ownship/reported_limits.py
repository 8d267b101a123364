"""The aircraft's limits as its parameters tell them, as far as they can be believed."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

from companion.autopilots.limits import Limits, LimitSource, ParameterTable

# What no fixed wing that we could fly has; outside it is a typing error or a unit mistaken.
_SENSIBLE = {
    "min_airspeed_mps": (3.0, 100.0),
    "max_airspeed_mps": (3.0, 150.0),
    "cruise_airspeed_mps": (3.0, 150.0),
    "max_bank_rad": (math.radians(5.0), math.radians(79.0)),
    "max_climb_mps": (0.2, 40.0),
    "max_sink_mps": (0.2, 40.0),
    "loiter_radius_m": (5.0, 10_000.0),
}


@dataclass(frozen=True, slots=True)
class ReportedLimits:
    """What is believed, the parameter that each field of it came from, and what is not believed, in words.

    `stall_prevention` is that of the autopilot's `ParameterTable`.
    """

    limits: Limits = field(default_factory=Limits)
    names: Mapping[str, str] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()
    stall_prevention: bool = False


def believe(values: Mapping[str, float], table: ParameterTable) -> ReportedLimits:
    """What parameter values say of the aircraft, without what is absurd or contradicts itself."""
    found: dict[str, tuple[float, str]] = {}
    doubts = []
    for source in table.limits:
        answer = _answer(values, source)
        if answer is None:
            continue
        value, name = answer
        low, high = _SENSIBLE[source.field]
        if not low <= abs(value) <= high or (value < 0.0 and source.field != "loiter_radius_m"):
            doubts.append(f"{name} {values[name]:g} not believed")
        elif source.field not in found or value < found[source.field][0]:
            found[source.field] = value, name
    limits = replace(Limits(), **{name: value for name, (value, _) in found.items()})
    names = {field_name: name for field_name, (_, name) in found.items()}
    return _consistent(ReportedLimits(limits, names, tuple(doubts), table.stall_prevention))


def _answer(values: Mapping[str, float], source: LimitSource) -> tuple[float, str] | None:
    """The value in our units, and the name it was found under."""
    return next(
        ((values[named.name] * named.scale, named.name) for named in source.names if named.name in values),
        None,
    )


def _consistent(belief: ReportedLimits) -> ReportedLimits:
    """Without speeds that contradict each other: which of them is wrong, nobody knows."""
    limits = belief.limits
    low, cruise, high = limits.min_airspeed_mps, limits.cruise_airspeed_mps, limits.max_airspeed_mps
    if low is not None and high is not None and low >= high:
        belief = _without(belief, "min_airspeed_mps", "max_airspeed_mps")
    elif cruise is not None and not (low or 0.0) <= cruise <= (math.inf if high is None else high):
        belief = _without(belief, "cruise_airspeed_mps")
    return belief


def _without(belief: ReportedLimits, *wrong: str) -> ReportedLimits:
    names = " and ".join(belief.names[name] for name in wrong)
    kept = {f.name: getattr(belief.limits, f.name) for f in fields(Limits) if f.name not in wrong}
    return replace(
        belief,
        limits=Limits(**kept),
        names={name: parameter for name, parameter in belief.names.items() if name not in wrong},
        doubts=(*belief.doubts, f"{names} not believed: contradictory"),
    )
