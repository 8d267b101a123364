"""A number that cannot be real never makes a conflict disappear."""

import math
from dataclasses import replace

import pytest

from companion.avoidance import AvoidanceParams, Avoider
from companion.avoidance.avoider import credible_ownship, relevant_track
from companion.model import Goal, Layer, Ownship, Track, TrafficKind

OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
NEAR = Track("A", 0.0, (700.0, 0.0, -300.0), (-60.0, 0.0, 0.0))
GOAL = Goal(position_m=(5000.0, 0.0, -300.0), airspeed_mps=22.0)
ABSURD = [math.nan, math.inf, -math.inf, 1e9, -1e9, 1e17, 1e300]
FIELDS = ["turn_radps", "vertical_uncertainty_m", "protected_horizontal_m", "protected_vertical_m", "time_s"]


def layer(own: Ownship = OWN, track: Track = NEAR) -> Layer:
    return Avoider(AvoidanceParams()).decide(0.0, own, [track], GOAL).layer


@pytest.mark.parametrize("number", ABSURD)
@pytest.mark.parametrize("field", [*FIELDS, "age_s", "position_sigma_m", "velocity_sigma_mps"])
def test_an_absurd_number_of_a_track_does_not_hide_it(field: str, number: float) -> None:
    assert layer(track=replace(NEAR, **{field: number})) is Layer.INNER  # type: ignore[arg-type]


@pytest.mark.parametrize("number", ABSURD)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_absurd_velocity_of_a_track_does_not_hide_it(axis: int, number: float) -> None:
    velocity_mps = [*NEAR.velocity_mps]
    velocity_mps[axis] = number
    assert layer(track=replace(NEAR, velocity_mps=tuple(velocity_mps))) is Layer.INNER  # type: ignore[arg-type]


@pytest.mark.parametrize("own", [
    replace(OWN, airspeed_mps=1e9), replace(OWN, airspeed_mps=-1e9), replace(OWN, time_s=1e17),
    replace(OWN, wind_mps=(1e9, 0.0)), replace(OWN, wind_mps=(0.0, -1e300)), replace(OWN, heading_rad=1e9),
    replace(OWN, velocity_mps=(1e9, 0.0, 0.0)),
])  # fmt: skip
def test_an_absurd_number_of_ownship_does_not_hide_a_track(own: Ownship) -> None:
    assert layer(own) is Layer.INNER


def test_what_is_real_is_left_as_it_is() -> None:
    assert relevant_track(NEAR, 5.0) is NEAR
    assert credible_ownship(OWN, 5.0) is OWN
    own_volume = replace(NEAR, protected_horizontal_m=100.0, turn_radps=-0.3, vertical_uncertainty_m=60.0)
    assert relevant_track(own_volume, 5.0) == own_volume


def test_a_turn_is_limited_to_what_aircraft_fly() -> None:
    turning = relevant_track(replace(NEAR, turn_radps=-2.0), 0.0)
    assert turning is not None
    assert turning.turn_radps == pytest.approx(-math.radians(20.0))


def test_without_a_position_or_on_the_surface_there_is_nothing_to_avoid() -> None:
    assert relevant_track(replace(NEAR, position_m=(math.nan, 0.0, 0.0)), 0.0) is None
    assert relevant_track(replace(NEAR, kind=TrafficKind.SURFACE_VEHICLE), 0.0) is None
