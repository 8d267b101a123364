"""The parameters of an autopilot that matter here, and the limits of the aircraft that they report."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace

from companion.airspace.fences import FenceSettings

DEGREE_RAD = math.pi / 180.0
# A value outside these ranges is a typing error or a wrong unit: no fixed wing that can be flown here has it.
_PLAUSIBLE = {
    "min_airspeed_mps": (3.0, 100.0),
    "max_airspeed_mps": (3.0, 150.0),
    "cruise_airspeed_mps": (3.0, 150.0),
    "max_bank_rad": (math.radians(5.0), math.radians(79.0)),
    "max_climb_mps": (0.2, 40.0),
    "max_sink_mps": (0.2, 40.0),
    "loiter_radius_m": (5.0, 10_000.0),
}


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the aircraft; `None` is unknown. A negative `loiter_radius_m` turns left."""

    min_airspeed_mps: float | None = None
    max_airspeed_mps: float | None = None
    cruise_airspeed_mps: float | None = None
    max_bank_rad: float | None = None
    max_climb_mps: float | None = None
    max_sink_mps: float | None = None
    loiter_radius_m: float | None = None


@dataclass(frozen=True, slots=True)
class Named:
    """A parameter's name, and one of its units expressed in SI units or radians."""

    name: str
    scale: float = 1.0


@dataclass(frozen=True, slots=True)
class LimitSource:
    """The parameter that holds one field of `Limits`: its names in several versions, the newest first."""

    field: str
    names: tuple[Named, ...]


@dataclass(frozen=True, slots=True)
class ParameterTable:
    """All parameters of one autopilot that Companion reads.

    When several `limits` name the same field, the tightest value counts. `fence` turns parameter values into
    the settings of the autopilot's fence. `mission_total` and `fence_total` are the parameters, if any, that
    count the items of these lists. `stall_prevention`: at low airspeed the autopilot reduces the bank instead
    of raising the speed.
    """

    limits: tuple[LimitSource, ...]
    # Requested first: they decide whether to fly at all, and what the aircraft does if Companion fails.
    first: tuple[str, ...]
    others: tuple[str, ...]
    fence: Callable[[Mapping[str, float]], FenceSettings]
    mission_total: str | None = None
    fence_total: str | None = None
    stall_prevention: bool = False

    def questions(self) -> tuple[tuple[str, ...], ...]:
        """The parameters to request, in this order, each with its alternative names."""
        totals = tuple((name,) for name in (self.mission_total, self.fence_total) if name is not None)
        limits = tuple(tuple(named.name for named in limit.names) for limit in self.limits)
        return (*((name,) for name in self.first), *limits, *((name,) for name in self.others), *totals)


@dataclass(frozen=True, slots=True)
class ReportedLimits:
    """The plausible limits that parameters report.

    `parameters` names the parameter of each known field of `limits`; `warnings` say which values are not used
    and why. `stall_prevention` is copied from the `ParameterTable`.
    """

    limits: Limits = field(default_factory=Limits)
    parameters: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    stall_prevention: bool = False


def reported_limits(values: Mapping[str, float], table: ParameterTable) -> ReportedLimits:
    """The limits in the parameter `values`, without those that are implausible or contradict each other."""
    found: dict[str, tuple[float, str]] = {}
    warnings = []
    for source in table.limits:
        reported = _reported(values, source)
        if reported is None:
            continue
        value, name = reported
        low, high = _PLAUSIBLE[source.field]
        if not low <= abs(value) <= high or (value < 0.0 and source.field != "loiter_radius_m"):
            warnings.append(f"{name} {values[name]:g} implausible, not used")
        elif source.field not in found or value < found[source.field][0]:
            found[source.field] = value, name
    limits = replace(Limits(), **{field_name: value for field_name, (value, _) in found.items()})
    parameters = {field_name: name for field_name, (_, name) in found.items()}
    return _consistent(ReportedLimits(limits, parameters, tuple(warnings), table.stall_prevention))


def _reported(values: Mapping[str, float], source: LimitSource) -> tuple[float, str] | None:
    """The value in SI units or radians, and the name under which it was found."""
    return next(
        ((values[named.name] * named.scale, named.name) for named in source.names if named.name in values),
        None,
    )


def _consistent(reported: ReportedLimits) -> ReportedLimits:
    """Without airspeeds that contradict each other, as it is unknown which of them is wrong."""
    limits = reported.limits
    low, cruise, high = limits.min_airspeed_mps, limits.cruise_airspeed_mps, limits.max_airspeed_mps
    if low is not None and high is not None and low >= high:
        reported = _without(reported, "min_airspeed_mps", "max_airspeed_mps")
    elif cruise is not None and not (low or 0.0) <= cruise <= (math.inf if high is None else high):
        reported = _without(reported, "cruise_airspeed_mps")
    return reported


def _without(reported: ReportedLimits, *wrong: str) -> ReportedLimits:
    names = " and ".join(reported.parameters[field_name] for field_name in wrong)
    right = {f.name: getattr(reported.limits, f.name) for f in fields(Limits) if f.name not in wrong}
    return replace(
        reported,
        limits=Limits(**right),
        parameters={f: name for f, name in reported.parameters.items() if f not in wrong},
        warnings=(*reported.warnings, f"{names} contradictory, not used"),
    )
