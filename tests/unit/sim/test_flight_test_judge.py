"""The verdict on an encounter."""

import math

import pytest

from companion.geodesy import LocalFrame
from companion.mavlink.dialect import mavlink
from sim.flight_test.judge import Claim, Judged, Leg
from sim.flight_test.observer import Sample
from sim.flight_test.plan import EncounterPlan, Expectation
from sim.traffic import Intruder

FRAME = LocalFrame(47.0, 8.0)
START, END = FRAME.to_geo(0.0, 0.0, -700.0), FRAME.to_geo(5000.0, 0.0, -800.0)
LEG = Leg(START, END)


def sample(time_s: float, north_m: float, east_m: float = 0.0, above_m: float = 0.0) -> Sample:
    height_m = 700.0 + north_m / 50.0 + above_m
    return Sample(time_s, FRAME.to_geo(north_m, east_m, -height_m), height_m - 400.0, (20.0, 0.0, -0.4))


def judged(*intruders: Intruder, **expected: object) -> Judged:
    plan = EncounterPlan("one", expect=Expectation(**expected))  # type: ignore[arg-type]
    return Judged(plan, 0.0, FRAME, intruders, modes=["AUTO"])


def crossing(at_s: float, north_m: float) -> Intruder:
    """Crosses our leg at 200 m/s, at our height."""
    return Intruder(1, "T1", at_s, (north_m, 0.0, -(700.0 + north_m / 50.0)), (0.0, 200.0, 0.0))


def fly(one: Judged, seconds: int, **where: float) -> None:
    for second in range(seconds + 1):
        one.observe_position(sample(float(second), 20.0 * second, **where), LEG)


def test_offsets_from_a_leg_count_sideways_and_from_its_slope() -> None:
    aside_m, above_m = LEG.off_m(FRAME.to_geo(2500.0, 40.0, -760.0))
    assert aside_m == pytest.approx(40.0, abs=0.1)
    assert above_m == pytest.approx(10.0, abs=0.1)
    ahead = LEG.ahead(FRAME.to_geo(1000.0, 40.0, -700.0), 500.0)
    north_m, east_m, down_m = FRAME.to_ned_m(ahead)
    assert (north_m, east_m, -down_m) == pytest.approx((1500.0, 0.0, 730.0), abs=0.5)


def test_the_closest_approach_between_two_positions_is_found() -> None:
    one = judged(crossing(10.5, 210.0))
    fly(one, 20)
    assert one.scores[0].min_slant_m < 15.0  # a second apart, the positions alone show 100 m
    assert one.nmac
    assert "near mid-air collision" in one.failures("AUTO")


def test_a_flight_that_does_what_is_expected_passes() -> None:
    one = judged(avoids=True)
    one.observe_mode(1.0, "GUIDED", guided=True, on_mission=False)
    fly(one, 5, east_m=200.0)
    one.observe_mode(6.0, "AUTO", guided=False, on_mission=True)
    for second in range(7, 20):
        one.observe_position(sample(float(second), 20.0 * second), LEG)
    assert one.failures("AUTO") == []
    assert one.is_over
    assert one.first_action_s == 1.0
    assert one.return_s == pytest.approx(6.0, abs=0.01)
    assert one.max_deviation_m == pytest.approx(200.0, abs=0.5)


def test_given_back_beside_the_leg_is_not_back() -> None:
    one = judged()
    one.observe_mode(1.0, "GUIDED", guided=True, on_mission=False)
    one.observe_mode(2.0, "AUTO", guided=False, on_mission=True)
    fly(one, 20, east_m=60.0)
    assert one.failures("AUTO") == ["not back on its leg and height"]
    assert not one.is_over


def test_back_at_another_height_is_not_back() -> None:
    one = judged()
    one.observe_mode(1.0, "GUIDED", guided=True, on_mission=False)
    one.observe_mode(2.0, "AUTO", guided=False, on_mission=True)
    fly(one, 20, above_m=15.0)
    assert one.back_s is None


def test_a_conflict_that_is_not_avoided_is_a_failure_and_so_is_a_needless_avoidance() -> None:
    assert "not avoided" in judged(avoids=True).failures("AUTO")
    one = judged(avoids=False, back=None)
    one.observe_mode(1.0, "GUIDED", guided=True, on_mission=False)
    one.observe_mode(2.0, "AUTO", guided=False, on_mission=True)
    assert one.failures("AUTO") == ["avoided without need"]


def command() -> mavlink.MAVLink_command_long_message:
    return mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, 10, 0, 0, 0, 0, 0)


def test_a_command_after_the_pilot_took_it_is_a_failure() -> None:
    one = judged(avoids=None, back=None, resumed=False, hands_off_s=1.5)
    one.claim = Claim("LOITER")
    one.observe_command(12.0, command())  # the aircraft does not show it yet
    one.observe_mode(12.1, "LOITER", guided=False, on_mission=False)
    one.observe_command(13.0, command())  # in time
    assert one.failures("LOITER") == []
    one.observe_command(14.0, command())
    assert one.failures("LOITER") == ["commands sent after the pilot took over: 1"]
    assert one.claim.commands == ["DO_SET_MODE"]


def test_commands_count_no_longer_once_the_pilot_resumed_the_mission() -> None:
    one = judged(avoids=None, back=None)
    one.claim = Claim(shown_s=10.0, ended=True)
    one.observe_command(30.0, command())
    assert one.failures("AUTO") == []


def test_a_refused_command_is_named() -> None:
    one = judged()
    one.observe_refusal(mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, mavlink.MAV_RESULT_UNSUPPORTED)
    assert one.refused == ["GUIDED_CHANGE_HEADING: UNSUPPORTED"]


def test_a_mode_that_the_aircraft_never_showed_is_a_failure() -> None:
    one = judged(avoids=None, back=None)
    one.claim = Claim("LOITER")
    one.observe_mode(12.0, "RTL", guided=False, on_mission=True)
    one.observe_command(13.0, command())
    assert one.failures("RTL") == ["the aircraft never showed the pilot's mode LOITER"]


@pytest.mark.parametrize(("given_back_s", "late"), [(14.0, False), (16.0, True), (None, True)])
def test_an_aircraft_that_is_asked_for_must_be_given_back_in_time(
    given_back_s: float | None, late: bool
) -> None:
    one = judged(back=None, resumed=False, released_s=5.0)
    one.observe_mode(5.0, "GUIDED", guided=True, on_mission=False)
    one.release_asked_s = 10.0
    if given_back_s is not None:
        one.observe_mode(given_back_s, "AUTO", guided=False, on_mission=True)
    assert one.failures("?") == (["not given back within 5 s of the request"] if late else [])


def test_a_mode_counts_only_when_it_is_entered_during_the_encounter() -> None:
    one = judged(avoids=None, back=None)
    one.expected_mode = "AUTO"
    assert one.failures("AUTO") == ["never in AUTO"]


def test_an_encounter_that_was_not_observed_does_not_pass() -> None:
    one = judged(crossing(30.0, 600.0), avoids=None, back=None)
    one.meetings_s = [30.0]
    assert one.failures("AUTO") == ["not observed around the meeting"]
    one.observe_position(sample(0.0, 0.0), LEG)
    one.observe_position(sample(60.0, 1200.0), LEG)
    assert len(one.path) == 2
    assert math.isfinite(one.scores[0].min_slant_m)
    assert one.failures("AUTO") == ["not observed around the meeting"], "a gap is not bridged"


def test_an_encounter_is_observed_when_there_is_a_position_each_second() -> None:
    one = judged(crossing(100.0, 5000.0), avoids=None, back=None, well_clear=None)
    one.meetings_s = [30.0]
    for second in range(62):
        one.observe_position(sample(float(second), 20.0 * second), LEG)
    assert one.failures("AUTO") == []
    del one.path[40:45]
    assert one.failures("AUTO") == ["not observed around the meeting"]


def test_intruders_are_scored_where_the_mission_has_no_leg() -> None:
    one = judged(crossing(10.5, 210.0))
    for second in range(20):
        one.observe_position(sample(float(second), 20.0 * second), None)
    assert one.nmac
