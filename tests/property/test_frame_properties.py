"""Decisions do not depend on the origin and orientation of the local frame."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from companion.avoidance import AvoidanceParams, Avoider
from companion.avoidance.assess import Survey
from companion.avoidance.cost import Priced, Situation
from companion.avoidance.trajectory import Tracks
from companion.model import Layer, Ownship, Vec3
from companion.units import wrap_pi
from tests.support.avoidance_cases import (
    ALL_STRATEGIES,
    Case,
    cases,
    frames,
    later,
    named,
    seen_from,
)


class Listening(Avoider):
    """Stores the costs of its last decision."""

    priced: Priced | None = None

    def _priced(self, situation: Situation, survey: Survey, pressing: Tracks) -> tuple[Layer, Priced]:
        layer, self.priced = super()._priced(situation, survey, pressing)
        return layer, self.priced


def without_u_turns(priced: Priced, own: Ownship) -> NDArray[np.bool_]:
    """Rows that are not a turn by 180 degrees, whose direction depends on rounding."""
    course_rad = math.atan2(own.velocity_mps[1], own.velocity_mps[0])
    turn_rad = np.abs((priced.commands.course_rad - course_rad + math.pi) % (2.0 * math.pi) - math.pi)
    grounds: NDArray[np.bool_] = turn_rad < math.pi - 1e-6
    return grounds[priced.commands.ground_of]


def clear_choice(priced: Priced, usable: NDArray[np.bool_], gap: float) -> bool:
    """Whether each row that flies differently from the best one costs more by at least `gap`."""
    best = priced.best()
    if not usable[best]:
        return False
    chosen = priced.commands.row(best)
    for row in np.flatnonzero(priced.cost < priced.cost[best] + gap).tolist():
        other = priced.commands.row(row)
        if abs(wrap_pi(other.course_rad - chosen.course_rad)) > 1e-6 or (
            other.airspeed_mps,
            other.altitude_m,
        ) != (chosen.airspeed_mps, chosen.altitude_m):
            return False
    return True


# Single precision of a prediction over some kilometres, times the weight of depth.
PRICE_ROUNDING = 0.05


@pytest.mark.parametrize("params", ALL_STRATEGIES, ids=named)
@settings(max_examples=12, deadline=None, derandomize=True)
@given(case=cases(), frame=frames())
def test_guidance_turns_with_a_turned_and_shifted_frame(
    params: AvoidanceParams, case: Case, frame: tuple[float, Vec3]
) -> None:
    """Two decisions in a row, so that remembered values (cones, guidance, rule's course) are turned too.

    If rows that fly differently cost the same, the choice depends on rounding, and only costs are compared.
    """
    one, other = Listening(params), Listening(params)
    for moment_s in (0.0, 1.0):
        case_now = later(case, moment_s)
        own = case_now[0]
        first = one.decide(moment_s, *case_now)
        second = other.decide(moment_s, *seen_from(case_now, *frame))
        assert first.layer is second.layer
        assert [threat.track_id for threat in first.threats] == [threat.track_id for threat in second.threats]
        if first.guidance is None or second.guidance is None:
            assert first.guidance is second.guidance
            continue
        clear = True
        if one.priced is not None and other.priced is not None and first.threats:
            usable = without_u_turns(one.priced, own)
            assert np.allclose(one.priced.cost[usable], other.priced.cost[usable], atol=PRICE_ROUNDING)
            clear = clear_choice(one.priced, usable, 2.0 * PRICE_ROUNDING)
        if not clear:
            return
        turn_rad = second.guidance.course_rad - first.guidance.course_rad
        assert abs(wrap_pi(turn_rad - frame[0])) < 1e-6
        assert math.isclose(first.guidance.airspeed_mps, second.guidance.airspeed_mps)
        assert math.isclose(first.guidance.altitude_m, second.guidance.altitude_m, abs_tol=1e-6)
