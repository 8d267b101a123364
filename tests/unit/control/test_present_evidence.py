"""Every command rests on evidence that is fresh, is about this aircraft, and shows no one else in control."""

import pytest

from companion.control.state_machine import FLYING, State
from companion.engine import Say
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    Fact,
    Heartbeat,
    LandedState,
    MissionCount,
    MissionProgress,
    NavigationTarget,
    OtherCompanion,
    OtherVehicle,
    Parameter,
    RcChannels,
    Sender,
)
from tests.support.pilots_seat import (
    ARDUPILOT,
    AUTO,
    AUTOPILOT,
    CENTERED_US,
    FBWA,
    GUIDED,
    HOLD,
    MISSION,
    MOVED_US,
    OFFBOARD,
    PX4,
    SELECT_ITEM,
    SET_MODE,
    T0,
    US,
    Seat,
)

RETURN = 4 << 16 | 5 << 24  # PX4's
BOTH = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
IN_AIR = mavlink.MAV_LANDED_STATE_IN_AIR
ENTERED = NavigationTarget(AUTOPILOT, -34.99, 149.0, 884.0)  # where the guided mode was entered


def modes(messages: list[Message]) -> list[int]:
    return [round(m.param2) for m in messages if getattr(m, "command", None) == SET_MODE]


def flying(autopilot: int = ARDUPILOT, *facts: Fact) -> Seat:
    seat = Seat(autopilot)
    seat.until(*FLYING)
    seat.fly(1.0)
    for fact in facts:
        seat.receive(fact)
    seat.fly(0.5)
    assert seat.state in FLYING
    return seat


def stall(seat: Seat, seconds: float, then_mode: int | None = None) -> None:
    """Nothing is done for a while; the aircraft flies on, perhaps in another mode."""
    seat._tick += round(seconds * 10)
    if then_mode is not None:
        seat.mode = then_mode
    for message in seat.engine.note_gap(seconds, seat.now_s):
        assert not hasattr(message, "message") or message.message.get_type() == "STATUSTEXT"


# --- a stall of our own (A1, A2)


@BOTH
def test_after_a_stall_nothing_acts_on_the_aircraft_before_a_heartbeat(autopilot: int) -> None:
    seat = flying(autopilot)
    seat.heartbeats = False
    stall(seat, 0.8)
    assert seat.state is State.RESYNCHRONISING
    assert seat.fly(3.0) == []
    seat.heartbeats = True


@BOTH
@pytest.mark.parametrize("before", [False, True])
def test_a_pilot_who_took_over_in_the_stall_is_left_alone(autopilot: int, before: bool) -> None:
    seat = Seat(autopilot)
    seat.until(State.MONITOR if before else State.OUTER)
    if not before:
        seat.fly(1.0)
    stall(seat, 4.0, FBWA if autopilot == ARDUPILOT else 3 << 16)
    assert seat.fly(8.0) == []


def test_arduplane_flies_on_as_commanded_after_a_stall() -> None:
    seat = flying()
    stall(seat, 1.5)
    sent = seat.fly(1.0)
    assert seat.state in FLYING
    assert modes(sent) == []
    assert [m for m in sent if getattr(m, "command", None) == mavlink.MAV_CMD_GUIDED_CHANGE_HEADING]


def test_px4_that_fell_out_of_offboard_in_the_stall_is_given_back() -> None:
    """As measured on PX4 1.16, it reports a failsafe in that Hold until a mode is chosen."""
    seat = flying(PX4, Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 5.0))
    seat.status = 5
    stall(seat, 1.2, HOLD)
    while seat.mode == HOLD:
        sent = seat.fly(0.1)
        assert [m for m in sent if m.get_type().startswith("SET_POSITION")] == []
        assert seat.now_s - T0 < 60.0
    assert seat.mode == MISSION


def test_an_alarm_names_the_mode_that_px4_fell_into_and_cannot_leave() -> None:
    seat = flying(PX4, Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 3.0))
    texts: list[str] = []

    def refuses(message: Message) -> bool:
        if getattr(message, "command", None) == SET_MODE:
            seat.answer(SET_MODE, mavlink.MAV_RESULT_DENIED)
            return False
        return True

    seat.obeys = refuses
    announce = seat._perform
    seat._perform = lambda effects: (  # type: ignore[method-assign]
        texts.extend(one.text for one in effects if isinstance(one, Say)),
        announce(effects),
    )[1]
    seat.status = 5
    stall(seat, 1.2, RETURN)
    seat.fly(40.0)
    assert "Avoidance: cannot leave RETURN, take over" in texts


def test_px4_that_fell_out_of_offboard_with_an_invalid_setpoint_recovers_first() -> None:
    seat = flying(PX4, Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 5.0))
    seat.status, seat.finite = 5, False
    stall(seat, 1.2, HOLD)
    seat.until(State.RE_ENTERING, limit_s=6.0)
    seat.until(State.RECOVERING, limit_s=6.0)
    assert seat.mode == OFFBOARD


def test_px4_still_in_offboard_after_a_stall_is_entered_again_as_ever() -> None:
    seat = flying(PX4)
    stall(seat, 0.7)
    sent = seat.fly(2.0)
    setpoints = [m.type_mask for m in sent if m.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"]
    assert setpoints[:4] == [3527] * 4, "velocity alone first"
    assert setpoints[-1] == 3520
    assert seat.state in FLYING
    assert seat.mode == OFFBOARD


def test_a_take_over_requested_before_the_stall_is_not_taken_for_refused_or_done() -> None:
    seat = Seat()
    seat.obeys = lambda _message: False
    seat.until(State.ENGAGING)
    stall(seat, 2.0)
    assert modes(seat.fly(1.0)) == []
    seat.obeys = lambda _message: True
    seat.until(*FLYING, limit_s=15.0)


# --- no reception (A3)


@BOTH
@pytest.mark.parametrize("stops", [False, True])
def test_no_mode_is_commanded_without_reception(autopilot: int, stops: bool) -> None:
    seat = flying(autopilot)
    seat.heartbeats = seat.positions = seat.intruder = False
    seat.fly(1.6)
    if stops:
        seat.stop()
    assert modes(seat.fly(60.0)) == []


# --- an item of a plan that is not the present one (A5)


def given_back(*meanwhile: Fact, restarts: bool = True) -> Seat:
    """Fly past the intruder from item 4 on; the facts come while we fly."""
    seat = Seat()
    seat.meet_s = T0 + 15.0
    seat.fly(0.5)
    if restarts:
        seat.receive(Parameter(AUTOPILOT, "MIS_RESTART", 1.0))
    seat.receive(MissionProgress(AUTOPILOT, 4, 6, 77))
    seat.until(*FLYING)
    for fact in meanwhile:
        seat.fly(0.5)
        seat.receive(fact)
    seat.until(State.MONITOR, limit_s=120.0)
    return seat


def items(seat: Seat, now_at: MissionProgress) -> list[int]:
    seat.receive(now_at)
    sent = seat.fly(0.5)
    return [round(m.param1) for m in sent if getattr(m, "command", None) == SELECT_ITEM]


def test_the_item_is_restored_when_the_autopilot_began_anew() -> None:
    assert items(given_back(), MissionProgress(AUTOPILOT, 1, 6, 77)) == [4]


@pytest.mark.parametrize(
    ("meanwhile", "restarts", "now_at"),
    [
        ([MissionProgress(AUTOPILOT, 2, 6, 77)], True, MissionProgress(AUTOPILOT, 1, 6, 77)),
        ([MissionProgress(AUTOPILOT, 4, 9, 78)], True, MissionProgress(AUTOPILOT, 1, 9, 78)),
        ([], False, MissionProgress(AUTOPILOT, 1, 6, 77)),
        ([], True, MissionProgress(AUTOPILOT, 2, 6, 77)),
    ],
    ids=["another item was selected", "another mission was uploaded", "it never restarts", "a jump"],
)
def test_the_item_is_not_imposed_on_another_plan(
    meanwhile: list[Fact], restarts: bool, now_at: MissionProgress
) -> None:
    assert items(given_back(*meanwhile, restarts=restarts), now_at) == []


# --- the guided mode with no one flying (A6)


@pytest.mark.parametrize("other", [AUTO, FBWA, 99])
@pytest.mark.parametrize("target", [True, False])
def test_after_a_flicker_of_the_mode_the_aircraft_is_given_back(other: int, target: bool) -> None:
    seat = flying(ARDUPILOT, *([ENTERED] if target else []))
    seat.extra_facts = [ENTERED] if target else []
    seat.mode = other
    seat.fly(0.2)
    seat.mode = GUIDED
    seat.fly(3.0)
    assert seat.state not in FLYING, "the other mode may be the pilot's choice"
    seat.fly(7.0)
    assert modes(seat.sent)[-1] == AUTO
    assert seat.mode == AUTO


def test_after_a_longer_flicker_the_target_shows_that_the_guided_mode_was_never_left() -> None:
    seat = flying(ARDUPILOT, ENTERED)
    seat.extra_facts = [ENTERED]
    seat.mode = FBWA
    seat.fly(4.0)
    seat.mode = GUIDED
    seat.fly(8.0)
    assert seat.mode == AUTO


def test_px4_that_falls_out_of_offboard_after_a_flicker_is_given_back() -> None:
    seat = flying(PX4, Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 5.0))
    seat.mode = 3 << 16
    seat.fly(0.2)
    seat.mode = OFFBOARD
    seat.fly(1.0)
    seat.mode, seat.status = HOLD, 5  # as no setpoints came
    seat.fly(8.0)
    assert seat.mode == MISSION


@pytest.mark.parametrize("after_s", [0.0, 0.4, 1.5])
def test_px4_in_the_hold_of_a_stall_that_the_pilot_chooses_is_left_alone(after_s: float) -> None:
    """As recorded on PX4 1.16: critical in Hold after a failsafe, active in the pilot's Hold."""
    seat = flying(PX4, Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 5.0))
    seat.mode, seat.status = HOLD, 5
    for effect in seat.engine.note_gap(4.0, seat.now_s):
        seat._perform([effect])
    seat.obeys = lambda _message: False
    seat.fly(after_s)
    seat.status = 4
    seat.fly(0.5)
    assert seat.fly(20.0) == []
    assert seat.mode == HOLD


def test_px4_in_a_hold_that_the_pilot_chose_is_left_alone() -> None:
    seat = flying(PX4, Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 5.0))
    seat.mode = HOLD
    seat.fly(0.5)
    assert seat.fly(20.0) == []


def test_a_stop_after_hands_off_gives_back_what_was_left_in_the_guided_mode() -> None:
    seat = flying()
    seat.status = 5
    seat.fly(0.5)
    assert seat.state is State.HANDS_OFF
    seat.stop()
    assert seat.state is State.STOPPING
    seat.fly(8.0)
    assert seat.mode == AUTO
    assert seat.engine.finished


def test_a_stop_while_the_pilot_flies_ends_at_once() -> None:
    seat = flying()
    seat.mode = FBWA
    seat.fly(0.5)
    seat.stop()
    assert seat.state is State.STOPPED
    assert seat.fly(5.0) == []


# --- claims at any instant (A7, A8, A12, A15)

FLOWN_ELSEWHERE = NavigationTarget(AUTOPILOT, -35.05, 149.1, 884.0)
ON_ROTORS = LandedState(AUTOPILOT, IN_AIR, mavlink.MAV_VTOL_STATE_MC)


def test_fly_here_in_the_guided_mode_is_a_claim() -> None:
    seat = flying(ARDUPILOT, ENTERED)
    seat.receive(FLOWN_ELSEWHERE)
    seat.fly(0.3)
    assert seat.state is State.HANDS_OFF
    seat.extra_facts = [FLOWN_ELSEWHERE]
    assert seat.fly(30.0) == []
    assert seat.mode == GUIDED


@BOTH
@pytest.mark.parametrize("fact", [ON_ROTORS, OtherVehicle(AUTOPILOT)], ids=["on rotors", "two vehicles"])
def test_a_claim_ends_our_control_at_once_and_nothing_follows(autopilot: int, fact: Fact) -> None:
    seat = flying(autopilot)
    seat.extra_facts = [fact]
    seat.receive(fact)
    seat.fly(0.1)
    assert seat.state is State.HANDS_OFF
    assert [m for m in seat.fly(4.0) if m.get_type() != "PARAM_SET"] == []


@pytest.mark.parametrize("fact", [ON_ROTORS, OtherVehicle(AUTOPILOT), OtherCompanion(US)])
def test_a_claim_keeps_the_aircraft_from_being_taken(fact: Fact) -> None:
    seat = Seat()
    seat.extra_facts = [fact]
    seat.fly(35.0)
    assert seat.sent == []
    assert seat.engine.decision.threats, "advised as ever"
    assert seat.engine.conditions


@BOTH
def test_two_vehicles_are_reported_in_any_mode(autopilot: int) -> None:
    seat = flying(autopilot)
    seat.extra_facts = [OtherVehicle(AUTOPILOT)]
    seat.fly(4.0)
    assert seat.state is State.HANDS_OFF
    assert [one.text for one in seat.engine.conditions if "two vehicles" in one.text]
    seat.extra_facts = []
    seat.fly(15.0)
    assert not [one.text for one in seat.engine.conditions if "two vehicles" in one.text]


@pytest.mark.parametrize("component_id", [197, 196])
def test_beside_another_companion_the_aircraft_is_given_back(component_id: int) -> None:
    seat = flying()
    other = Heartbeat(Sender(1, component_id), 18, 8, False, 2, 4, is_companion=True)
    seat.extra_facts = [other if component_id != US.component_id else OtherCompanion(US)]
    seat.fly(4.0)
    assert seat.mode == AUTO
    assert seat.state is State.STANDBY
    assert modes(seat.fly(10.0)) == []


def test_mavros_and_cameras_are_no_companions() -> None:
    seat = Seat()
    for component_id, kind, mode in ((191, 18, 0), (100, 30, 0), (240, 18, 0)):
        seat.extra_facts.append(Heartbeat(Sender(1, component_id), kind, 8, False, mode, 4))
    seat.until(*FLYING)


STICKS = RcChannels(AUTOPILOT, MOVED_US)
CENTRED = RcChannels(AUTOPILOT, CENTERED_US)


@BOTH
def test_while_stopping_the_sticks_delay_the_release(autopilot: int) -> None:
    seat = flying(autopilot, CENTRED)
    seat.obeys = lambda message: getattr(message, "command", None) != SET_MODE
    seat.stop()
    seat.fly(0.2)
    seat.receive(STICKS)
    seat.fly(0.1)
    seat.extra_facts = [STICKS]
    assert [m for m in seat.fly(3.0) if m.get_type() != "PARAM_SET"] == []
    seat.extra_facts = [CENTRED]
    seat.obeys = lambda _message: True
    seat.fly(9.0)
    assert seat.mode == seat.prior_mode


# --- what is not known (A9), below home (A19), going on and on (A18)


@pytest.mark.parametrize(("counted", "longest_s"), [(False, 6.0), (True, 25.0)])
def test_the_mission_is_awaited_longer_when_the_autopilot_answers(counted: bool, longest_s: float) -> None:
    seat = Seat()
    seat.knows_mission = False
    seat.meet_s = T0 + longest_s + 40.0
    while seat.now_s - T0 < longest_s:
        seat.fly(0.1)
        if counted:
            seat.receive(MissionCount(AUTOPILOT, US, 0, 40))
        assert seat.sent == []
    seat.until(*FLYING, limit_s=20.0)


def test_in_a_low_descent_of_a_mission_that_is_not_known_the_aircraft_is_not_taken() -> None:
    seat = Seat()
    seat.knows_mission = False
    seat.height_m, seat.intruder_altitude_m, seat.sink_mps = 98.0, 682.0, 2.0
    seat.fly(30.0)
    assert seat.sent == []
    assert any("landing" in condition.text for condition in seat.engine.conditions)


def test_below_home_it_advises_and_says_why_it_does_not_fly() -> None:
    seat = Seat()
    seat.extra_facts = [LandedState(AUTOPILOT, IN_AIR)]
    seat.height_m = -40.0
    seat.intruder_altitude_m = 544.0
    seat.fly(35.0)
    assert seat.sent == []
    assert seat.engine.decision.threats
    assert any("below" in condition.text for condition in seat.engine.conditions)


def test_a_long_avoidance_is_news_again() -> None:
    seat = Seat()
    seat.hovers = True
    seat.fly(125.0)
    held = [condition for condition in seat.engine.conditions if condition.key == "long avoidance"]
    assert held
    assert "RESUME" in held[0].text
