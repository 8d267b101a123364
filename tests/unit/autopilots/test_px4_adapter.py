"""What is sent to PX4: a stream of setpoints that keeps its attitude setpoint valid, and the speed."""

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

from companion.autopilots import Px4FixedWing
from companion.autopilots.adapter import GuidanceCommand
from companion.avoidance import Control
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.facts import AttitudeTarget, AutopilotVersion, CommandResult, Parameter, Sender
from companion.model import Guidance, PriorFlightState

TARGET = Sender(1, 1)
PLACE = GeoPoint(47.4, 8.5, 600.0)
GUIDANCE = Guidance(math.radians(40.0), 18.0, 680.0)
COMMAND = GuidanceCommand(GUIDANCE, PLACE, (0.0, 15.0, 0.0), 15.0, math.radians(30.0))
VELOCITY_ONLY, POSITION_AND_VELOCITY = 3527, 3520
HOLD, MISSION = 4 << 16 | 3 << 24, 4 << 16 | 4 << 24


@pytest.fixture
def adapter() -> Px4FixedWing:
    adapter = Px4FixedWing(TARGET)
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 15.0), 0.0)
    return adapter


def ticks(first_s: float, seconds: float) -> Iterator[float]:
    return (round(first_s + tick / 10, 1) for tick in range(round(seconds * 10)))


def setpoints(messages: list[Message]) -> list[Message]:
    return [message for message in messages if message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"]


def masks(adapter: Px4FixedWing, first_s: float, seconds: float, *, urgent: bool = False) -> list[int]:
    return [
        message.type_mask
        for now_s in ticks(first_s, seconds)
        for message in setpoints(adapter.command(COMMAND, now_s, urgent=urgent))
    ]


def test_offboard_is_entered_with_velocity_alone_along_the_present_course(adapter: Px4FixedWing) -> None:
    sent = [message for now_s in ticks(10.0, 1.0) for message in adapter.entering(COMMAND, now_s)]
    assert len(sent) == 10, "10 Hz"
    assert {message.type_mask for message in sent} == {VELOCITY_ONLY}
    assert {message.coordinate_frame for message in sent} == {5}
    assert sent[0].vx == pytest.approx(0.0, abs=1e-9)
    assert sent[0].vy > 5.0


def test_in_offboard_position_with_velocity_follows(adapter: Px4FixedWing) -> None:
    adapter.entering(COMMAND, 10.0)
    assert masks(adapter, 10.1, 2.0) == [VELOCITY_ONLY] + [POSITION_AND_VELOCITY] * 19


def test_the_setpoint_is_a_line_through_our_position_at_the_commanded_height(adapter: Px4FixedWing) -> None:
    for now_s in ticks(10.0, 0.5):
        messages = setpoints(adapter.command(COMMAND, now_s, urgent=False))
    (message,) = messages
    assert (message.lat_int, message.lon_int, message.alt) == (474_000_000, 85_000_000, 680.0)
    assert math.atan2(message.vy, message.vx) == pytest.approx(GUIDANCE.course_rad)
    assert math.hypot(message.vx, message.vy) > 5.0
    assert message.vz == 0.0


def test_offboard_is_left_level_at_the_present_height(adapter: Px4FixedWing) -> None:
    masks(adapter, 10.0, 1.0)
    sent = [message for now_s in ticks(11.0, 0.5) for message in adapter.leaving(COMMAND, now_s)]
    assert {message.type_mask for message in sent} == {POSITION_AND_VELOCITY}
    assert {message.alt for message in sent} == {600.0}
    assert math.atan2(sent[0].vy, sent[0].vx) == pytest.approx(math.radians(90.0))
    assert adapter.exit_s >= 0.35
    assert adapter.entry_s >= 0.5


def test_velocity_alone_recovers_an_invalid_attitude_setpoint(adapter: Px4FixedWing) -> None:
    masks(adapter, 10.0, 1.0)
    for now_s in ticks(11.0, 0.5):
        adapter.observe(AttitudeTarget(TARGET, finite=False), now_s)
    assert adapter.setpoint_invalid(11.4)
    assert masks(adapter, 11.5, 1.6) == [VELOCITY_ONLY] * 16
    adapter.observe(AttitudeTarget(TARGET, finite=True), 13.1)
    assert not adapter.setpoint_invalid(13.1)
    assert set(masks(adapter, 13.1, 1.0)) == {POSITION_AND_VELOCITY}


def test_one_invalid_attitude_setpoint_does_not_count(adapter: Px4FixedWing) -> None:
    adapter.observe(AttitudeTarget(TARGET, finite=False), 11.0)
    assert not adapter.setpoint_invalid(11.1)
    adapter.observe(AttitudeTarget(TARGET, finite=True), 11.2)
    assert not adapter.setpoint_invalid(12.0)


def trims(adapter: Px4FixedWing, first_s: float, seconds: float) -> list[float]:
    return [
        message.param_value
        for now_s in ticks(first_s, seconds)
        for message in adapter.tick(now_s)
        if message.get_type() == "PARAM_SET"
    ]


def test_the_speed_parameter_is_set_until_confirmed_and_restored(adapter: Px4FixedWing) -> None:
    masks(adapter, 10.0, 1.0)
    assert trims(adapter, 11.0, 2.5) == [18.0, 18.0, 18.0]
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 18.0), 13.5)
    assert trims(adapter, 13.6, 3.0) == []
    assert adapter.changed_parameters == {"FW_AIRSPD_TRIM": 15.0}
    adapter.drop_commands()
    assert trims(adapter, 17.0, 1.0) == [15.0]
    assert adapter.changed_parameters == {"FW_AIRSPD_TRIM": 15.0}, "until the autopilot confirms it"
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 15.0), 18.0)
    assert adapter.changed_parameters == {}
    assert trims(adapter, 19.0, 3.0) == []


def test_an_unknown_speed_is_not_changed() -> None:
    adapter = Px4FixedWing(TARGET)
    masks(adapter, 10.0, 1.0)
    assert trims(adapter, 11.0, 3.0) == []


def test_a_tiny_change_of_speed_is_not_sent(adapter: Px4FixedWing) -> None:
    near = GuidanceCommand(Guidance(0.0, 15.4, 680.0), PLACE, (0.0, 15.0, 0.0), 15.0, 0.5)
    for now_s in ticks(10.0, 1.0):
        adapter.command(near, now_s, urgent=False)
    assert trims(adapter, 11.0, 1.0) == []


def test_a_speed_that_a_former_run_changed_is_restored() -> None:
    adapter = Px4FixedWing(TARGET)
    adapter.restore_parameters({"FW_AIRSPD_TRIM": 15.0})
    assert trims(adapter, 0.0, 1.0) == [15.0]
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 15.0), 1.0)
    assert adapter.changed_parameters == {}


def test_unanswered_changes_are_dropped_and_restorations_repeated(adapter: Px4FixedWing) -> None:
    masks(adapter, 10.0, 1.0)
    assert len(trims(adapter, 11.0, 60.0)) <= 5, "a change is dropped"
    adapter.drop_commands()
    assert 5 < len(trims(adapter, 80.0, 100.0)) < 15, "a restoration is not"


def test_hold_is_given_back_at_its_former_place(adapter: Px4FixedWing) -> None:
    (message,) = adapter.restore_mode(PriorFlightState(HOLD, target=GeoPoint(47.41, 8.52, 640.0)))
    assert (message.command, message.param2) == (mavlink.MAV_CMD_DO_REPOSITION, 1.0)
    assert (message.x, message.y, message.z) == (474_100_000, 85_200_000, 640.0)
    (mission,) = adapter.restore_mode(PriorFlightState(MISSION, target=GeoPoint(47.41, 8.52, 640.0)))
    assert (mission.command, mission.param2, mission.param3) == (mavlink.MAV_CMD_DO_SET_MODE, 4, 4)


@pytest.mark.parametrize(
    ("action", "mode"), [(5.0, HOLD), (3.0, 4 << 16 | 5 << 24), (0.0, None), (2.0, None)]
)
def test_the_mode_after_the_last_setpoint(action: float, mode: int | None) -> None:
    adapter = Px4FixedWing(TARGET)
    adapter.observe(Parameter(TARGET, "COM_OBL_RC_ACT", action), 0.0)
    assert adapter.setpoint_loss_mode() == mode


def test_all_messages_can_be_packed(adapter: Px4FixedWing) -> None:
    encoder = Encoder()
    messages = [*adapter.entering(COMMAND, 1.0), *adapter.command(COMMAND, 2.0, urgent=True)]
    messages += adapter.command(COMMAND, 2.2, urgent=True) + adapter.leaving(COMMAND, 3.0) + adapter.tick(3.0)
    messages += adapter.restore_mode(PriorFlightState(HOLD, target=PLACE))
    assert len(messages) >= 5
    for message in messages:
        assert encoder.encode(message, 1, 196)


def test_an_answer_ends_the_repetition_of_a_command(adapter: Px4FixedWing) -> None:
    adapter.commands.ask(adapter.select_item(3), 1.0)
    adapter.observe(CommandResult(TARGET, mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, 0, None), 1.1)
    assert adapter.tick(5.0) == []


def test_a_late_change_after_the_restoration_is_restored_again(adapter: Px4FixedWing) -> None:
    masks(adapter, 10.0, 1.0)
    (change,) = [m for m in adapter.tick(11.0) if m.get_type() == "PARAM_SET"]
    assert change.param_value == 18.0
    adapter.drop_commands()
    assert [m.param_value for m in adapter.tick(11.1)] == [15.0]
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 15.0), 11.2)
    assert adapter.changed_parameters == {}
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 18.0), 12.0)  # a datagram that came twice
    assert [m.param_value for m in adapter.tick(12.1)] == [15.0]
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 15.0), 12.2)
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 18.0), 40.0)  # a ground station set it
    assert adapter.tick(40.1) == []


@pytest.mark.parametrize(
    ("version", "loses"), [(None, True), ((1, 16), True), ((1, 17), False), ((2, 0), False)]
)
def test_up_to_version_1_16_climbs_may_invalidate_the_setpoint(
    adapter: Px4FixedWing, version: tuple[int, int] | None, loses: bool
) -> None:
    if version is not None:
        adapter.observe(AutopilotVersion(TARGET, "", *version, capabilities=0), 1.0)
    assert adapter.invalid_after_climbs is loses


def speeds(adapter: Px4FixedWing, command: GuidanceCommand, first_s: float, seconds: float) -> int:
    """Number of changes of FW_AIRSPD_TRIM that are sent; each is answered with the present value."""
    sent = 0
    for now_s in ticks(first_s, seconds):
        adapter.command(command, now_s, urgent=False)
        for message in adapter.tick(now_s):
            assert message.get_type() == "PARAM_SET"
            sent += 1
            adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 15.0), now_s)
    return sent


def test_no_speed_is_commanded_without_a_sensor_or_when_the_present_one_is_wanted(
    adapter: Px4FixedWing,
) -> None:
    assert speeds(adapter, replace(COMMAND, airspeed_mps=None), 10.0, 20.0) == 0
    assert speeds(adapter, replace(COMMAND, airspeed_mps=17.5), 40.0, 20.0) == 0
    assert adapter.changed_parameters == {}


def test_a_speed_that_px4_does_not_accept_is_lost_and_reported_once(adapter: Px4FixedWing) -> None:
    assert speeds(adapter, COMMAND, 10.0, 30.0) == 5
    assert adapter.lost_controls == {Control.SPEED}
    assert adapter.changed_parameters == {}, "it still has the original"
    assert adapter.refusals() == ["FW_AIRSPD_TRIM not accepted"]
    assert speeds(adapter, COMMAND, 50.0, 30.0) == 0
    assert adapter.refusals() == []
    adapter.restarted()
    assert adapter.lost_controls == set()
    assert speeds(adapter, COMMAND, 90.0, 1.0) == 1


def test_the_speed_cannot_be_flown_while_its_parameter_is_unknown() -> None:
    adapter = Px4FixedWing(TARGET)
    assert adapter.lost_controls == {Control.SPEED}
    assert speeds(adapter, COMMAND, 10.0, 5.0) == 0
