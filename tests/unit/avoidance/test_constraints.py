"""Constraints: limits, fence and refusals together."""

import math

import pytest

from companion.avoidance import Control, Envelope, Fence, Zone
from companion.avoidance.constraints import Constraints, Refusals
from companion.avoidance.trajectory import OwnState, turn_around_s
from companion.model import Guidance

ENVELOPE = Envelope(min_altitude_m=100.0, max_altitude_m=400.0)
STATE = OwnState((0.0, 0.0, -300.0), 0.0, 22.0, 0.0, (0.0, 0.0))
FENCE = Fence((Zone(True, ((-900.0, -900.0), (300.0, -900.0), (300.0, 900.0), (-900.0, 900.0))),))
NORTH, EAST = Guidance(0.0, 22.0, 300.0), Guidance(math.pi / 2.0, 22.0, 300.0)


def constraints(fence: Fence | None = None, refusals: Refusals | None = None) -> Constraints:
    return Constraints(ENVELOPE, fence, refusals or Refusals(), 1.2)


def test_airspeed_and_height_are_clamped_and_the_course_is_not() -> None:
    assert constraints().envelope.within_limits(Guidance(1.0, 50.0, 900.0)) == Guidance(1.0, 28.0, 400.0)


def test_without_a_fence_there_is_no_look_ahead() -> None:
    assert constraints().fence_look_ahead_s(STATE) == 0.0
    wanted_s = 1.2 * turn_around_s(STATE, ENVELOPE)
    assert constraints(FENCE).fence_look_ahead_s(STATE) == pytest.approx(wanted_s)


def test_a_guidance_across_the_fence_is_not_allowed() -> None:
    assert constraints().allow(NORTH, STATE)
    assert not constraints(FENCE).allow(NORTH, STATE)
    assert constraints(FENCE).allow(EAST, STATE)


def test_the_fence_is_kept_until_it_is_reached() -> None:
    assert constraints(FENCE).keeps_fence(NORTH, STATE, 8.0)
    assert not constraints(FENCE).keeps_fence(NORTH, STATE, 16.0)


def test_a_refused_guidance_is_not_allowed() -> None:
    refused = constraints(refusals=Refusals().adding(Control.HEADING, 0.0, 0.0))
    assert not refused.allow(NORTH, STATE)
    assert refused.allow(EAST, STATE)
