"""The limits in effect: as configured, otherwise as the autopilot reports them, otherwise as assumed."""

import math
from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt

from companion.autopilots.parameters import ReportedLimits
from companion.avoidance import Envelope

# Share of the climb or sink rate in its parameters that an aircraft reaches in a change of height; ArduPlane
# was measured at 4.5 of 5 m/s. The prediction uses the rate that is reached.
_REACHED = 0.9
# ArduPlane allows this bank at any airspeed.
_LEAST_BANK_RAD = math.radians(25.0)
CONFIGURED, ASSUMED = "configured", "assumed"
_QUANTITIES = {
    "min_airspeed_mps": "min airspeed",
    "max_airspeed_mps": "max airspeed",
    "max_bank_rad": "max bank",
    "max_climb_mps": "max climb",
    "max_sink_mps": "max sink",
}


@dataclass(frozen=True)
class AircraftLimits:
    """Configured limits; `None`: as the autopilot's parameters report."""

    min_airspeed_mps: Annotated[float, Gt(0), Le(200)] | None = None
    max_airspeed_mps: Annotated[float, Gt(0), Le(200)] | None = None
    max_bank_rad: Annotated[float, Gt(0), Lt(math.radians(80))] | None = None
    max_climb_mps: Annotated[float, Gt(0), Le(50)] | None = None
    max_sink_mps: Annotated[float, Gt(0), Le(50)] | None = None
    # Negative: to the left.
    loiter_radius_m: Annotated[float, Ge(-10_000), Le(10_000)] | None = None

    def __post_init__(self) -> None:
        low, high = self.min_airspeed_mps, self.max_airspeed_mps
        if low is not None and high is not None and low > high:
            raise ValueError("min_airspeed_mps must not exceed max_airspeed_mps")


@dataclass(frozen=True, slots=True)
class SourcedLimit:
    """One limit in effect: `quantity` in words, its value in `unit`, and its `source`."""

    quantity: str
    value: float
    unit: str
    source: str

    def __str__(self) -> str:
        return f"{self.quantity} {self.value:g} {self.unit} ({self.source})"


@dataclass(frozen=True, slots=True)
class PerformanceLimits:
    """The envelope for the avoidance; `sourced` lists its limits with their sources, for people to read."""

    envelope: Envelope
    sourced: tuple[SourcedLimit, ...] = ()
    loiter_radius_m: float | None = None
    warnings: tuple[str, ...] = ()
    cruise_airspeed_mps: float | None = None  # as reported


@dataclass(frozen=True, slots=True)
class _Value:
    value: float
    source: str


def limits_in_effect(
    assumed: Envelope, configured: AircraftLimits, reported: ReportedLimits
) -> PerformanceLimits:
    """The limits in effect, with warnings where a configured limit exceeds the aircraft's own.

    A configured limit always counts, because parameters are wrong at times and the user knows the aircraft.
    The autopilot may not fly beyond its own limits, hence the warning.
    """
    attainable = _attainable(reported)
    bank = _chosen("max_bank_rad", configured.max_bank_rad, attainable, assumed)
    climb = _chosen("max_climb_mps", configured.max_climb_mps, attainable, assumed)
    sink = _chosen("max_sink_mps", configured.max_sink_mps, attainable, assumed)
    slowest, fastest, warnings = _airspeeds(assumed, configured, _banked(attainable, bank.value))
    sourced = [
        _sourced("min airspeed", slowest, "m/s"),
        _sourced("max airspeed", fastest, "m/s"),
        _sourced("max bank", replace(bank, value=math.degrees(bank.value)), "deg"),
        _sourced("max climb", climb, "m/s"),
        _sourced("max sink", sink, "m/s"),
    ]
    radius_m = configured.loiter_radius_m or attainable.limits.loiter_radius_m
    if radius_m is not None:
        source = CONFIGURED if configured.loiter_radius_m else attainable.parameters["loiter_radius_m"]
        sourced.append(_sourced("loiter radius", _Value(radius_m, source), "m"))
    envelope = replace(
        assumed,
        min_airspeed_mps=slowest.value,
        max_airspeed_mps=fastest.value,
        max_bank_rad=bank.value,
        max_climb_mps=climb.value,
        max_sink_mps=sink.value,
    )
    beyond = _beyond_reported(configured, attainable)
    return PerformanceLimits(
        envelope,
        tuple(sourced),
        radius_m,
        (*reported.warnings, *warnings, *beyond),
        reported.limits.cruise_airspeed_mps,
    )


def _attainable(reported: ReportedLimits) -> ReportedLimits:
    """The reported limits reduced to what is reached: climb and sink rates, bank at cruise airspeed.

    In a turn the stall speed grows by 1 / sqrt(cos(bank)). ArduPlane's stall prevention limits the bank so
    that the airspeed stays above the minimum airspeed multiplied by this factor; PX4 flies faster instead.
    """
    limits, parameters = reported.limits, dict(reported.parameters)
    for name in ("max_climb_mps", "max_sink_mps"):
        rate_mps = getattr(limits, name)
        if rate_mps is not None:
            limits = replace(limits, **{name: _REACHED * rate_mps})
            parameters[name] = f"{_REACHED:g} {parameters[name]}"
    bank_rad, low, cruise = limits.max_bank_rad, limits.min_airspeed_mps, limits.cruise_airspeed_mps
    if reported.stall_prevention and bank_rad is not None and low is not None and cruise is not None:
        carried_rad = max(math.acos((low / cruise) ** 2), _LEAST_BANK_RAD)
        if carried_rad < bank_rad:
            limits = replace(limits, max_bank_rad=carried_rad)
            parameters["max_bank_rad"] = f"{parameters['max_bank_rad']}, at cruise airspeed"
    return replace(reported, limits=limits, parameters=parameters)


def _banked(reported: ReportedLimits, bank_rad: float) -> ReportedLimits:
    """The same limits with the minimum airspeed in a turn at `bank_rad`."""
    limits = reported.limits
    if limits.min_airspeed_mps is None:
        return reported
    low = limits.min_airspeed_mps / math.sqrt(math.cos(bank_rad))
    low = min(low, math.inf if limits.max_airspeed_mps is None else limits.max_airspeed_mps)
    parameters = {
        **reported.parameters,
        "min_airspeed_mps": f"{reported.parameters['min_airspeed_mps']}, banked",
    }
    return replace(reported, limits=replace(limits, min_airspeed_mps=low), parameters=parameters)


def _chosen(name: str, configured: float | None, reported: ReportedLimits, assumed: Envelope) -> _Value:
    """One limit and its source; a configured limit names the reported one too."""
    known = getattr(reported.limits, name)
    if configured is not None:
        beside = "" if known is None else f"; {reported.parameters[name]} {_shown(name, known)}"
        return _Value(configured, f"{CONFIGURED}{beside}")
    if known is None:
        return _Value(getattr(assumed, name), ASSUMED)
    return _Value(known, reported.parameters[name])


def _beyond_reported(configured: AircraftLimits, reported: ReportedLimits) -> list[str]:
    """A warning for each configured limit that exceeds the reported one."""
    warnings = []
    for name, quantity in _QUANTITIES.items():
        wanted, known = getattr(configured, name), getattr(reported.limits, name)
        if wanted is None or known is None:
            continue
        exceeds = wanted < known if name.startswith("min_") else wanted > known
        if exceeds:
            beyond = f"{quantity} {_shown(name, wanted)} configured"
            warnings.append(f"{beyond}, {reported.parameters[name]} allows {_shown(name, known)}")
    return warnings


def _shown(name: str, value: float) -> str:
    """A limit in the unit that people read: degrees for angles."""
    return f"{math.degrees(value) if name.endswith('_rad') else value:.3g}"


def _airspeeds(
    assumed: Envelope, configured: AircraftLimits, reported: ReportedLimits
) -> tuple[_Value, _Value, tuple[str, ...]]:
    """Minimum and maximum airspeed, and warnings; where they cross, the less certain one yields."""
    slowest = _chosen("min_airspeed_mps", configured.min_airspeed_mps, reported, assumed)
    fastest = _chosen("max_airspeed_mps", configured.max_airspeed_mps, reported, assumed)
    if slowest.value <= fastest.value:
        return slowest, fastest, ()
    if fastest.source == ASSUMED:
        return slowest, _Value(slowest.value, ASSUMED), ()
    if slowest.source == ASSUMED:
        return _Value(fastest.value, ASSUMED), fastest, ()
    # A configured airspeed contradicts a reported one.
    low, high, _ = _airspeeds(assumed, AircraftLimits(), reported)
    return low, high, ("configured airspeeds outside autopilot limits, not used",)


def _sourced(quantity: str, value: _Value, unit: str) -> SourcedLimit:
    return SourcedLimit(quantity, round(value.value, 2), unit, value.source)
