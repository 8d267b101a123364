"""What is varied beside the main campaigns: surveillance, the own aircraft, and when an avoidance begins."""

import math
from dataclasses import dataclass

from sim.campaign.changes import Changes

# The surveillance that sweeps change.
BASE = "adsb-out"


@dataclass(frozen=True, slots=True)
class Point:
    """One value of a sweep: its place on the axis, its label, and how it is flown."""

    value: float
    label: str
    surveillance: str = BASE
    own_limits: Changes = ()
    usual: bool = False


@dataclass(frozen=True, slots=True)
class Sweep:
    """A quantity that is varied, with its unit and its values."""

    name: str
    title: str
    unit: str
    points: tuple[Point, ...]


def _surveillance(name: str, title: str, unit: str, field: str, values: tuple[float, ...]) -> Sweep:
    points = tuple(Point(value, f"{value:g}", f"{BASE},{field}={value:g}") for value in values)
    return Sweep(name, title, unit, points)


def _limits(name: str, title: str, unit: str, field: str, values: tuple[float, ...], scale: float) -> Sweep:
    points = tuple(Point(value, f"{value:g}", own_limits=((field, value * scale),)) for value in values)
    return Sweep(name, title, unit, points)


def _speeds(name: str, title: str, ranges: tuple[tuple[float, float], ...]) -> Sweep:
    """Ranges that contain the airspeeds of the missions, 20 to 30 m/s."""
    points = tuple(
        Point(
            high - low,
            f"{low:g}-{high:g}",
            own_limits=(("min_airspeed_mps", low), ("max_airspeed_mps", high)),
        )
        for low, high in ranges
    )
    return Sweep(name, title, "m/s", points)


SWEEPS = (
    _surveillance("latency", "Latency, not reported", "s", "latency_s", (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)),
    _surveillance("loss", "Share of reports lost", "", "loss", (0.0, 0.15, 0.3, 0.45, 0.6)),
    _surveillance(
        "position-error", "Error of positions, one sigma", "m", "position_sigma_m", (0, 15, 30, 60, 100)
    ),
    _surveillance(
        "velocity-error", "Error of velocities, one sigma", "m/s", "velocity_sigma_mps", (0, 1.5, 3, 6, 10)
    ),
    _surveillance(
        "pop-up", "Late pop-up: first heard within", "m", "first_heard_m", (750, 1000, 1500, 2000, 3000, 5000)
    ),
    _limits("bank", "Own largest bank", "deg", "max_bank_rad", (15.0, 20.0, 30.0, 45.0), math.radians(1.0)),
    _limits("climb", "Own largest climb and sink", "m/s", "max_climb_mps", (1.0, 2.54, 5.0), 1.0),
    _speeds("speed", "Width of the own range of airspeeds", ((20.0, 30.0), (18.0, 36.0), (15.0, 40.0))),
)

# Earlier and later begins of an avoidance; the chosen values are the product's own.
TRADE_OFF: tuple[tuple[str, Changes], ...] = (
    ("chosen", ()),
    ("latest", (("reserve_s", 0.0),)),
    ("later", (("reserve_s", 3.0),)),
    ("earlier", (("reserve_s", 10.0),)),
    ("at once", (("reserve_s", 60.0),)),
    ("at once, if nearer", (("reserve_s", 60.0), ("begin_far", 0.55))),
    ("shorter look", (("outer_time_s", 45.0),)),
    ("longer look", (("outer_time_s", 75.0),)),
)
