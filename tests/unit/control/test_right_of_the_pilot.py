"""Nothing is sent against the pilot, and no aircraft is left in the guided mode without control."""

import pytest

from companion.control.state_machine import State, SupervisorParams
from companion.mavlink.dialect import Message
from companion.mavlink.facts import FenceStatus, MissionProgress, NavigationTarget, Parameter
from companion.output.persisted_state import PersistedState
from tests.support.pilots_seat import (
    AUTO,
    AUTOPILOT,
    FBWA,
    GUIDED,
    LOITER,
    MISSION,
    OFFBOARD,
    PX4,
    REPOSITION,
    SELECT_ITEM,
    SET_MODE,
    T0,
    Seat,
)

FLYING = (State.OUTER, State.INNER)


def commands(messages: list[Message]) -> list[int]:
    return [message.command for message in messages if hasattr(message, "command")]


def modes(messages: list[Message]) -> list[int]:
    """The requested modes."""
    return [round(m.param2) for m in messages if getattr(m, "command", None) == SET_MODE]


def test_a_pilot_who_uses_the_guided_mode_is_left_alone() -> None:
    seat = Seat()
    seat.until(*FLYING)
    seat.mode = LOITER
    seat.fly(3.0)
    assert seat.state is State.HANDS_OFF
    seat.mode = GUIDED  # "fly to here"
    assert seat.fly(20.0) == []
    assert seat.mode == GUIDED


def test_a_new_target_in_the_guided_mode_is_respected() -> None:
    seat = Seat(rules=SupervisorParams(take_over_from=("AUTO", "GUIDED")))
    seat.mode = GUIDED
    seat.receive(NavigationTarget(AUTOPILOT, -34.9, 149.0, 884.0))
    while seat.state not in FLYING:
        seat.receive(NavigationTarget(AUTOPILOT, -34.9, 149.0, 884.0))
        seat.fly(0.5)
    seat.fly(1.0)
    seat.receive(NavigationTarget(AUTOPILOT, -35.0, 149.1, 884.0))
    seat.fly(0.1)
    assert seat.state is State.SUPPRESSED
    assert seat.fly(8.0) == []


def test_an_aircraft_left_in_the_guided_mode_is_given_back() -> None:
    seat = Seat()
    seat.until(*FLYING)
    seat.status = 5
    seat.fly(0.5)
    assert seat.state is State.HANDS_OFF
    seat.status = 4
    seat.fly(4.0)
    assert seat.mode == GUIDED
    assert modes(seat.fly(4.0))[0] == AUTO


def test_a_take_over_that_was_not_yet_requested_needs_no_release() -> None:
    seat = Seat(PX4)
    seat.until(State.ENGAGING)
    seat.set_role(1)
    sent = seat.fly(3.0)
    assert SET_MODE not in commands(seat.sent), "the stream had only begun"
    assert commands(sent) == []
    assert seat.state in (State.MONITOR, State.STANDBY)


def test_a_second_request_may_succeed_after_the_first_was_refused() -> None:
    seat = Seat()
    seat.obeys = lambda _message: False
    seat.until(State.ENGAGING)
    seat.fly(1.3)
    assert commands(seat.sent).count(SET_MODE) == 2
    seat.answer(SET_MODE, 4)
    seat.fly(0.2)
    assert seat.state is State.WAITING
    seat.obeys = lambda _message: True
    seat.mode = GUIDED  # the second one arrives
    assert modes(seat.fly(1.0)) == [AUTO]


def test_a_request_that_arrives_very_late_is_undone() -> None:
    seat = Seat()
    seat.obeys = lambda _message: False
    seat.until(State.ENGAGING)
    seat.set_role(1)
    seat.fly(2.0)
    assert seat.state in (State.MONITOR, State.STANDBY)
    seat.obeys = lambda _message: True
    seat.mode = GUIDED  # a repeated datagram
    seat.fly(3.0)
    assert seat.mode == AUTO


def given_back(seat: Seat) -> None:
    """Fly past the intruder, until the mission is flown again."""
    seat.meet_s = T0 + 15.0
    seat.fly(0.5)
    seat.receive(Parameter(AUTOPILOT, "MIS_RESTART", 1.0))
    seat.receive(MissionProgress(AUTOPILOT, 4))
    seat.until(*FLYING)
    seat.until(State.MONITOR, limit_s=120.0)
    assert seat.mode == AUTO


def test_the_mission_item_is_not_restored_when_the_pilot_has_the_aircraft() -> None:
    seat = Seat()
    given_back(seat)
    seat.receive(MissionProgress(AUTOPILOT, 1))
    assert SELECT_ITEM in commands(seat.fly(0.2))
    seat.mode = FBWA
    seat.fly(0.3)
    assert seat.fly(5.0) == []


def test_an_item_that_the_pilot_chose_is_not_changed() -> None:
    seat = Seat()
    given_back(seat)
    seat.mode = LOITER
    seat.fly(1.0)
    seat.receive(MissionProgress(AUTOPILOT, 1))
    seat.mode = AUTO
    assert SELECT_ITEM not in commands(seat.fly(5.0))


def test_without_heartbeats_the_aircraft_is_no_longer_flown() -> None:
    seat = Seat()
    seat.until(*FLYING)
    seat.heartbeats = False
    seat.fly(7.0)
    assert not seat.engine.supervisor.flying
    seat.heartbeats, seat.mode = True, FBWA
    seat.fly(1.0)
    assert seat.fly(5.0) == []


def test_no_setpoints_are_sent_to_an_autopilot_that_is_not_heard() -> None:
    seat = Seat(PX4)
    seat.until(*FLYING)
    seat.heartbeats = seat.positions = False
    seat.obeys = lambda _message: False
    seat.fly(12.0)
    sent = seat.fly(5.0)
    assert [message for message in sent if message.get_type() != "PARAM_SET"] == [], (
        "PX4 would enter OFFBOARD again"
    )


def test_the_pilots_mode_ends_a_stop_even_in_a_failsafe() -> None:
    seat = Seat()
    seat.until(*FLYING)
    seat.obeys = lambda _message: False
    seat.stop()
    seat.status = 5
    seat.fly(0.5)
    assert seat.state is State.STOPPING
    seat.mode = FBWA
    assert seat.fly(1.0) == []
    assert seat.engine.finished
    assert seat.fly(5.0) == []


def test_nothing_is_sent_after_disarming() -> None:
    seat = Seat()
    seat.until(*FLYING)
    seat.armed = False
    seat.fly(0.5)
    assert seat.state is State.HANDS_OFF
    assert seat.fly(20.0) == []


@pytest.mark.parametrize("heard", [True, False])
def test_a_breach_ends_when_the_fence_is_switched_off(heard: bool) -> None:
    seat = Seat()
    seat.receive(FenceStatus(AUTOPILOT, True))
    for _ in range(20):
        if heard:
            seat.receive(FenceStatus(AUTOPILOT, True))
        seat.fly(1.0)
    assert (seat.state is State.STANDBY) is heard


# --- PX4


def test_an_aircraft_with_an_invalid_setpoint_is_not_given_back() -> None:
    seat = Seat(PX4)
    seat.until(*FLYING)
    seat.fly(3.0)
    seat.finite, seat.intruder = False, False
    seat.meet_s -= 1e4
    seat.fly(40.0)
    assert seat.mode == OFFBOARD
    seat.finite = True
    seat.fly(6.0)
    assert seat.mode == MISSION


def test_one_bad_attitude_setpoint_does_not_count_as_invalid() -> None:
    seat = Seat(PX4)
    seat.until(*FLYING)
    adapter = seat.engine.aircraft.adapter
    assert adapter is not None
    seat.finite = False
    seat.fly(0.1)
    assert not adapter.setpoint_invalid(seat.now_s)
    assert not adapter.setpoint_invalid(seat.now_s + 5.0)


def test_the_speed_is_restored_before_the_service_ends() -> None:
    seat = Seat(PX4)
    seat.until(*FLYING)
    adapter = seat.engine.aircraft.adapter
    assert adapter is not None
    adapter.restore_parameters({"FW_AIRSPD_TRIM": 15.0})
    seat.obeys = lambda message: message.get_type() != "PARAM_SET"
    seat.stop()
    seat.fly(3.0)
    assert seat.mode == MISSION
    assert not seat.engine.finished
    seat.obeys = lambda _message: True
    seat.fly(2.0)
    assert seat.trim_mps == 15.0
    assert seat.engine.finished


def test_the_stream_after_a_late_entry_begins_with_velocity_alone() -> None:
    seat = Seat(PX4)
    seat.obeys = lambda _message: False
    seat.until(State.ENGAGING)
    seat.until(State.WAITING)
    seat.mode = OFFBOARD
    setpoints = [m for m in seat.fly(0.4) if m.get_type().startswith("SET_POSITION")]
    assert setpoints[0].type_mask == 3527


def test_the_target_of_the_guided_mode_is_sent_again_when_it_was_lost() -> None:
    seat = Seat(rules=SupervisorParams(take_over_from=("AUTO", "GUIDED")))
    seat.mode = GUIDED
    while seat.state not in FLYING:
        seat.receive(NavigationTarget(AUTOPILOT, -34.9, 149.0, 884.0))
        seat.fly(0.5)
    seat.set_role(1)
    assert commands(seat.fly(6.0)).count(REPOSITION) >= 2
    assert seat.state in (State.MONITOR, State.STANDBY)


def test_the_saved_speed_of_another_aircraft_is_not_restored_in_this_one() -> None:
    for system_id, expected in ((1, [15.0]), (2, [])):
        seat = Seat(PX4)
        seat.intruder = False
        saved = PersistedState(T0 - 3600.0, system_id, borrowed={"FW_AIRSPD_TRIM": 15.0})
        seat.engine.recover(saved.to_text(), T0, 0.0)
        sent = seat.fly(3.0)
        assert [message.param_value for message in sent] == expected


def test_an_emergency_release_restores_the_speed_too() -> None:
    seat = Seat(PX4)
    seat.until(*FLYING)
    seat.fly(1.0)
    adapter = seat.engine.aircraft.adapter
    assert adapter is not None
    adapter.restore_parameters({"FW_AIRSPD_TRIM": 15.0})
    release = seat.engine.emergency_release(seat.now_s)
    sent = [m for tick in range(14) for m in release.messages(seat.now_s + tick / 10)]
    assert MISSION >> 16 & 0xFF in modes(sent)
    assert next(m.param_value for m in sent if m.get_type() == "PARAM_SET") == 15.0
    setpoints = [m for m in sent if m.get_type().startswith("SET_POSITION")]
    assert {m.alt for m in setpoints} == {884.0}, "level"
