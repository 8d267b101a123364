"""A waypoint within the volume of an aircraft that stays there is passed above or below."""

import math

import numpy as np
import pytest

from sim.campaign.flight import fly
from sim.campaign.plan import Plan
from sim.campaign.plane import Limits
from sim.campaign.route import Route
from sim.encounters import Encounter
from sim.encounters.encounter import Path
from tests.support.thorough import pairs

SPEED_MPS, HEIGHT_M = 25.0, 300.0
WAYPOINT_M = 1500.0


def hovering_at(north_m: float, height_m: float) -> Path:
    times_s = np.array([0.0, 60.0, 120.0])
    places_m = np.tile([north_m, 0.0, -height_m], (3, 1))
    return Path(times_s, places_m, np.zeros((3, 3)))


def route(turn_deg: float) -> Route:
    """A leg to the north, then one of 6 km."""
    turn_rad = math.radians(turn_deg)
    end_m = WAYPOINT_M + 6000.0 * math.cos(turn_rad), 6000.0 * math.sin(turn_rad)
    return Route(((-1500.0, 0.0, -HEIGHT_M), (WAYPOINT_M, 0.0, -HEIGHT_M), (*end_m, -HEIGHT_M)))


TURNS_DEG, BEYOND_M = [0.0, -90.0, 120.0], [-500.0, -250.0, 0.0, 250.0, 540.0]


@pytest.mark.parametrize(("beyond_m", "turn_deg"), pairs(BEYOND_M, TURNS_DEG))
def test_the_waypoint_is_passed_and_the_next_leg_flown(beyond_m: float, turn_deg: float) -> None:
    intruder = hovering_at(WAYPOINT_M + beyond_m, HEIGHT_M + 20.0)
    encounter = Encounter("hovering", (0.0, 0.0, -HEIGHT_M), 0.0, SPEED_MPS, (intruder,))
    plan = Plan(1)
    flown = fly(
        encounter, plan.engine_for("companion"), plan.first_surveillance, Limits(), route=route(turn_deg)
    )
    assert flown.closest.severity > 1.0
    assert flown.back_s is not None
    assert flown.back_s < 400.0
    assert flown.engagements <= 3


def test_without_a_height_to_pass_the_aircraft_keeps_clear() -> None:
    """Floor and ceiling leave neither; this ends only when the other aircraft leaves."""
    intruder = hovering_at(WAYPOINT_M, HEIGHT_M)
    encounter = Encounter("hovering", (0.0, 0.0, -HEIGHT_M), 0.0, SPEED_MPS, (intruder,), duration_s=300.0)
    plan = Plan(1, lock_height=True)
    flown = fly(
        encounter, plan.engine_for("companion"), plan.first_surveillance, plan.limits, route=route(0.0)
    )
    assert flown.closest.severity > 1.0
