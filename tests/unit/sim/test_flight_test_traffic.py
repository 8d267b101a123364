"""Intruders of a flight test: they meet the aircraft where and when their plan says."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.geodesy import LocalFrame
from sim.flight_test.plan import EncounterPlan, IntruderPlan, Turn
from sim.flight_test.traffic import Meeting, Traffic, aimed

MEETING = Meeting(500.0, (1200.0, -300.0, -784.0), (20.0, 5.0, 0.0))
FRAME = LocalFrame(-35.0, 149.0)
TURNS = st.lists(
    st.builds(
        Turn,
        at_s=st.floats(-80.0, 40.0),
        turn_deg_s=st.floats(-6.0, 6.0),
        climb_mps=st.floats(-8.0, 8.0),
    ),
    max_size=3,
)


@given(
    st.floats(-180.0, 180.0),
    st.floats(20.0, 200.0),
    st.floats(-500.0, 500.0),
    st.floats(-200.0, 200.0),
    TURNS,
)
def test_it_is_at_the_meeting_when_it_should(
    from_deg: float, speed_mps: float, miss_m: float, miss_height_m: float, turns: list[Turn]
) -> None:
    plan = IntruderPlan(speed_mps, from_deg, miss_m=miss_m, miss_height_m=miss_height_m, turns=tuple(turns))
    position_m, velocity_mps = aimed(plan, MEETING, 1).state_at(MEETING.time_s)
    off_m = [position_m[i] - MEETING.position_m[i] for i in range(3)]
    assert math.hypot(off_m[0], off_m[1]) == pytest.approx(abs(miss_m), abs=0.05)
    assert -off_m[2] == pytest.approx(miss_height_m, abs=0.05)
    assert math.hypot(*velocity_mps[:2]) == pytest.approx(speed_mps, rel=1e-6)


@given(st.floats(-179.0, 179.0), TURNS)
def test_it_comes_from_the_planned_direction(from_deg: float, turns: list[Turn]) -> None:
    plan = IntruderPlan(50.0, from_deg, turns=tuple(turns))
    _, (north_mps, east_mps, _) = aimed(plan, MEETING, 1).state_at(MEETING.time_s)
    own_course_rad = math.atan2(5.0, 20.0)
    came_from_rad = math.atan2(-east_mps, -north_mps) - own_course_rad
    assert math.cos(came_from_rad - math.radians(from_deg)) == pytest.approx(1.0, abs=1e-6)


def reports_at(plan: IntruderPlan, flags: int = 0) -> list[float]:
    """The times at which the receiver reports it, a tenth of a second exact."""
    traffic = Traffic(EncounterPlan("one", (plan,)), MEETING, FRAME, 1, flags=flags)
    times = []
    for tenth in range(3000, 6000):
        times += [tenth / 10 for _ in traffic.reports(tenth / 10, (0.0, 0.0, 0.0))]
    return times


def test_it_is_reported_from_when_it_appears_and_not_in_a_gap() -> None:
    times = reports_at(IntruderPlan(50.0, appears_s=60.0, gaps_s=((-30.0, -20.0),)))
    assert times[0] == pytest.approx(440.0, abs=0.2)
    assert not [time_s for time_s in times if 470.0 <= time_s < 480.0]
    assert [time_s for time_s in times if 480.0 <= time_s < 490.0]


def test_reports_can_be_marked_as_simulated() -> None:
    traffic = Traffic(EncounterPlan("one", (IntruderPlan(50.0),)), MEETING, FRAME, 1, flags=64)
    (report, *_) = traffic.reports(420.0, (0.0, 0.0, 0.0))
    assert report.flags & 64
    assert report.altitude_type == 1


def test_each_intruder_has_an_address_of_its_own() -> None:
    plans = IntruderPlan(50.0), IntruderPlan(50.0, 90.0), IntruderPlan(50.0, 20.0, icao=0xABC123)
    traffic = Traffic(EncounterPlan("three", plans), MEETING, FRAME, 7)
    assert len({one.icao for one in traffic.intruders}) == 3
    assert traffic.intruders[2].icao == 0xABC123
