"""The envelope in effect: what is configured, else what the aircraft says, else what is assumed."""

import math
from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt

from companion.avoidance import Envelope
from companion.ownship.reported_limits import ReportedLimits

# Of the rate in its parameters an aircraft reaches this share when it is sent to another height: measured on
# ArduPlane, 4.5 of 5 m/s. What is counted upon is what is reached.
_REACHED = 0.9
# ArduPlane grants this bank at any airspeed.
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
    """Limits set by hand; `None`: as the autopilot's parameters say."""

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
class Taken:
    """One limit in effect: `quantity` in words, its value with unit, and where it was taken from."""

    quantity: str
    value: float
    unit: str
    source: str

    def __str__(self) -> str:
        return f"{self.quantity} {self.value:g} {self.unit} ({self.source})"


@dataclass(frozen=True, slots=True)
class PerformanceLimits:
    """What the avoidance may count upon, and where each of its limits was taken from."""

    envelope: Envelope
    taken: tuple[Taken, ...] = ()
    loiter_radius_m: float | None = None
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Value:
    value: float
    source: str


def effective(assumed: Envelope, configured: AircraftLimits, belief: ReportedLimits) -> PerformanceLimits:
    """The limits in effect.

    A configured limit counts, whoever says otherwise: parameters are wrong at times, and who flies the
    aircraft knows it. Where it trusts the aircraft with more than its own parameters do, that is doubted in
    words, as the autopilot may not fly it.
    """
    sure = _as_reached(belief)
    bank = _chosen("max_bank_rad", configured.max_bank_rad, sure, assumed)
    climb = _chosen("max_climb_mps", configured.max_climb_mps, sure, assumed)
    sink = _chosen("max_sink_mps", configured.max_sink_mps, sure, assumed)
    slowest, fastest, doubts = _airspeeds(assumed, configured, _banked(sure, bank.value))
    taken = [
        _taken("min airspeed", slowest, "m/s"),
        _taken("max airspeed", fastest, "m/s"),
        _taken("max bank", replace(bank, value=math.degrees(bank.value)), "deg"),
        _taken("max climb", climb, "m/s"),
        _taken("max sink", sink, "m/s"),
    ]
    radius_m = configured.loiter_radius_m or sure.limits.loiter_radius_m
    if radius_m is not None:
        source = CONFIGURED if configured.loiter_radius_m else sure.names["loiter_radius_m"]
        taken.append(_taken("loiter radius", _Value(radius_m, source), "m"))
    envelope = replace(
        assumed,
        min_airspeed_mps=slowest.value,
        max_airspeed_mps=fastest.value,
        max_bank_rad=bank.value,
        max_climb_mps=climb.value,
        max_sink_mps=sink.value,
    )
    return PerformanceLimits(
        envelope, tuple(taken), radius_m, (*belief.doubts, *doubts, *_trusted(configured, sure))
    )


def _as_reached(belief: ReportedLimits) -> ReportedLimits:
    """What the aircraft reaches of its limits: the share of its rates, the bank that cruise airspeed carries.

    In a turn the stall speed grows by 1 / sqrt(cos(bank)). ArduPlane's stall prevention gives no more bank
    than keeps the airspeed above the lowest one grown alike; PX4 flies faster instead.
    """
    limits, names = belief.limits, dict(belief.names)
    for name in ("max_climb_mps", "max_sink_mps"):
        rate_mps = getattr(limits, name)
        if rate_mps is not None:
            limits = replace(limits, **{name: _REACHED * rate_mps})
            names[name] = f"{_REACHED:g} {names[name]}"
    bank_rad, low, cruise = limits.max_bank_rad, limits.min_airspeed_mps, limits.cruise_airspeed_mps
    if belief.stall_prevention and bank_rad is not None and low is not None and cruise is not None:
        carried_rad = max(math.acos((low / cruise) ** 2), _LEAST_BANK_RAD)
        if carried_rad < bank_rad:
            limits = replace(limits, max_bank_rad=carried_rad)
            names["max_bank_rad"] = f"{names['max_bank_rad']}, at cruise airspeed"
    return replace(belief, limits=limits, names=names)


def _banked(belief: ReportedLimits, bank_rad: float) -> ReportedLimits:
    """With the lowest airspeed at which this bank is flown."""
    limits = belief.limits
    if limits.min_airspeed_mps is None:
        return belief
    low = limits.min_airspeed_mps / math.sqrt(math.cos(bank_rad))
    low = min(low, math.inf if limits.max_airspeed_mps is None else limits.max_airspeed_mps)
    names = {**belief.names, "min_airspeed_mps": f"{belief.names['min_airspeed_mps']}, banked"}
    return replace(belief, limits=replace(limits, min_airspeed_mps=low), names=names)


def _chosen(name: str, configured: float | None, belief: ReportedLimits, assumed: Envelope) -> _Value:
    """A limit and where it was taken from."""
    known = getattr(belief.limits, name)
    if configured is not None:
        # Both are told.
        beside = "" if known is None else f"; {belief.names[name]} {_shown(name, known)}"
        return _Value(configured, f"{CONFIGURED}{beside}")
    if known is None:
        return _Value(getattr(assumed, name), ASSUMED)
    return _Value(known, belief.names[name])


def _trusted(configured: AircraftLimits, belief: ReportedLimits) -> list[str]:
    """In which the configuration trusts the aircraft with more than its own parameters do."""
    doubts = []
    for name, quantity in _QUANTITIES.items():
        wanted, known = getattr(configured, name), getattr(belief.limits, name)
        if wanted is None or known is None:
            continue
        more = wanted < known if name.startswith("min_") else wanted > known
        if more:
            beyond = f"{quantity} {_shown(name, wanted)} configured"
            doubts.append(f"{beyond}, {belief.names[name]} allows {_shown(name, known)}")
    return doubts


def _shown(name: str, value: float) -> str:
    """A limit in the unit that it is told in."""
    return f"{math.degrees(value) if name.endswith('_rad') else value:.3g}"


def _airspeeds(
    assumed: Envelope, configured: AircraftLimits, belief: ReportedLimits
) -> tuple[_Value, _Value, tuple[str, ...]]:
    """Slowest and fastest airspeed. Where they contradict each other, the less certain one yields."""
    slowest = _chosen("min_airspeed_mps", configured.min_airspeed_mps, belief, assumed)
    fastest = _chosen("max_airspeed_mps", configured.max_airspeed_mps, belief, assumed)
    if slowest.value <= fastest.value:
        return slowest, fastest, ()
    if fastest.source == ASSUMED:
        return slowest, _Value(slowest.value, ASSUMED), ()
    if slowest.source == ASSUMED:
        return _Value(fastest.value, ASSUMED), fastest, ()
    # A configured speed against one of the aircraft's own.
    low, high, _ = _airspeeds(assumed, AircraftLimits(), belief)
    return low, high, ("configured airspeeds not used: outside those of the autopilot",)


def _taken(quantity: str, value: _Value, unit: str) -> Taken:
    return Taken(quantity, round(value.value, 2), unit, value.source)
