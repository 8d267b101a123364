"""What is sent to PX4 1.18: which way of flying is chosen, and the commands of GUIDED_COURSE."""

import math
from dataclasses import replace

import pytest

from companion.autopilots import MODES_OF, ArduPlane, Px4FixedWing
from companion.autopilots.adapter import GuidanceCommand, RefusedValue, is_setpoint
from companion.avoidance import Control
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import AVAILABLE_MODES, Encoder, Message, mavlink
from companion.mavlink.facts import (
    AttitudeTarget,
    AutopilotVersion,
    AvailableMode,
    CommandResult,
    Heartbeat,
    NavigationTarget,
    Parameter,
    Sender,
)
from companion.model import Guidance

TARGET = Sender(1, 1)
PLACE = GeoPoint(47.4, 8.5, 600.0)
GUIDANCE = Guidance(math.radians(40.0), 18.0, 680.0)
COMMAND = GuidanceCommand(GUIDANCE, PLACE, (0.0, 15.0, 0.0), 15.0, math.radians(30.0))
OFFBOARD, COURSE_MODE, HOLD = 6 << 16, 4 << 16 | 19 << 24, 4 << 16 | 3 << 24
COURSE, HEIGHT, SPEED = 43002, 186, 178
REQUEST_MESSAGE = mavlink.MAV_CMD_REQUEST_MESSAGE
ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3


def of_version(major: int, minor: int) -> Px4FixedWing:
    adapter = Px4FixedWing(TARGET)
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_TRIM", 15.0), 0.0)
    adapter.observe(AutopilotVersion(TARGET, "", major, minor, capabilities=0), 0.0)
    adapter.choose_way()
    return adapter


@pytest.fixture
def adapter() -> Px4FixedWing:
    """In GUIDED_COURSE since 9.9 s, at 600 m; it takes commands from 10 s on."""
    adapter = of_version(1, 18)
    adapter.entering(COMMAND, 9.0)
    adapter.observe(NavigationTarget(TARGET, 47.5, 8.6, 650.0), 9.5)  # of the mission
    adapter.command(COMMAND, 9.9, urgent=False)
    return adapter


def mode(index: int, custom_mode: int, *, selectable: bool = True) -> AvailableMode:
    return AvailableMode(TARGET, custom_mode, index, 2, selectable=selectable)


def flown(adapter: Px4FixedWing, now_s: float, command: GuidanceCommand = COMMAND) -> list[Message]:
    """The commands of one tick, without requests; also those that are repeated."""
    sent = [*adapter.command(command, now_s, urgent=False), *adapter.tick(now_s)]
    return [message for message in sent if getattr(message, "command", None) != REQUEST_MESSAGE]


def kinds(messages: list[Message]) -> list[int]:
    return [message.command for message in messages]


def answer(adapter: Px4FixedWing, now_s: float, command: int, result: int = ACCEPTED) -> None:
    adapter.observe(CommandResult(TARGET, command, result, None), now_s)


# --- the way of flying


@pytest.mark.parametrize(
    ("version", "guided"),
    [((1, 16), OFFBOARD), ((1, 17), OFFBOARD), ((1, 18), COURSE_MODE), ((2, 0), COURSE_MODE)],
)
def test_the_version_decides_on_the_way(version: tuple[int, int], guided: int) -> None:
    assert of_version(*version).guided_mode == guided


def test_without_a_version_it_is_offboard() -> None:
    adapter = Px4FixedWing(TARGET)
    adapter.choose_way()
    assert adapter.guided_mode == OFFBOARD


@pytest.mark.parametrize(
    ("modes", "guided"),
    [
        ((mode(1, OFFBOARD),), COURSE_MODE),  # not all of them yet
        ((mode(1, OFFBOARD), mode(2, HOLD)), OFFBOARD),
        ((mode(1, OFFBOARD), mode(2, COURSE_MODE)), COURSE_MODE),
        ((mode(2, COURSE_MODE, selectable=False),), OFFBOARD),
    ],
)
def test_a_vehicle_that_lists_its_modes_without_it_is_flown_in_offboard(
    modes: tuple[AvailableMode, ...], guided: int
) -> None:
    adapter = of_version(1, 18)
    for one in modes:
        adapter.observe(one, 1.0)
    adapter.choose_way()
    assert adapter.guided_mode == guided


def test_the_list_of_modes_is_requested_a_few_times_and_not_before_1_18() -> None:
    requests = [m for tick in range(300) for m in of_version(1, 16).tick(tick / 10)]
    assert requests == []
    adapter = of_version(1, 18)
    requests = [m for tick in range(300) for m in adapter.tick(tick / 10)]
    assert [(m.command, m.param1, m.param2) for m in requests] == 4 * [(REQUEST_MESSAGE, AVAILABLE_MODES, 0)]
    listed = of_version(1, 18)
    listed.tick(0.0)
    for one in (mode(1, OFFBOARD), mode(2, COURSE_MODE)):
        listed.observe(one, 0.5)
    assert [m for tick in range(300) for m in listed.tick(tick / 10)] == []


def test_after_a_refusal_offboard_is_flown_until_a_restart_and_that_is_said() -> None:
    adapter = of_version(1, 18)
    assert not adapter.fall_back(1)
    assert not adapter.fall_back(2)
    assert adapter.fall_back(3), "temporarily rejected again and again"
    assert not adapter.fall_back(0), "there is no third way"
    adapter.choose_way()
    assert adapter.guided_mode == OFFBOARD
    assert adapter.entry_s > 0.0
    assert "GUIDED_COURSE refused, flying OFFBOARD" in adapter.advice({})
    adapter.restarted()
    adapter.choose_way()
    assert adapter.guided_mode == COURSE_MODE
    assert adapter.entry_s == adapter.exit_s == 0.0


def test_it_flies_on_without_us_and_needs_no_parameter_and_no_watch(adapter: Px4FixedWing) -> None:
    assert adapter.setpoint_loss_mode() == COURSE_MODE
    assert not adapter.leaves_guided_by_itself
    flown(adapter, 10.0)
    for tick in range(20):
        adapter.observe(AttitudeTarget(TARGET, finite=False), 10.0 + tick / 10)
    assert not adapter.setpoint_invalid(12.0)
    assert adapter.changed_parameters == {}
    assert adapter.lost_controls == frozenset()


# --- its commands


def test_course_height_and_speed_are_one_command_each(adapter: Px4FixedWing) -> None:
    speed, course, height = flown(adapter, 10.0)
    assert (speed.command, speed.param1, speed.param2) == (SPEED, 0.0, 18.0)
    assert (course.command, course.param1) == (COURSE, 0.0)
    assert course.param2 == pytest.approx(40.0)
    assert course.param3 == pytest.approx(9.80665 * math.tan(math.radians(30.0)))
    assert (height.command, height.param1, height.param2) == (HEIGHT, 680.0, 0.0)
    for message in (speed, course, height):
        assert Encoder().encode(message, 1, 196)


def test_only_requests_are_setpoints_not_our_answers_with_the_same_command(adapter: Px4FixedWing) -> None:
    speed, course, height = flown(adapter, 10.0)
    assert [is_setpoint(message) for message in (speed, course, height)] == [False, True, True]
    assert not is_setpoint(mavlink.MAVLink_command_ack_message(COURSE, UNSUPPORTED, 0, 0, 255, 190))


def test_a_course_is_in_0_to_360_degrees(adapter: Px4FixedWing) -> None:
    west = replace(COMMAND, guidance=replace(GUIDANCE, course_rad=math.radians(-90.0)))
    (course,) = [m for m in flown(adapter, 10.0, west) if m.command == COURSE]
    assert course.param2 == pytest.approx(270.0)


def test_answered_commands_are_repeated_slowly_and_changes_sent_at_once(adapter: Px4FixedWing) -> None:
    flown(adapter, 10.0)
    for command in (COURSE, HEIGHT, SPEED):
        answer(adapter, 10.05, command)
    assert flown(adapter, 11.9) == []
    assert kinds(flown(adapter, 12.1)) == [SPEED, COURSE, HEIGHT]
    other = replace(COMMAND, guidance=replace(GUIDANCE, course_rad=math.radians(45.0)))
    assert COURSE in kinds(flown(adapter, 12.2, other))


def test_unanswered_commands_are_resent(adapter: Px4FixedWing) -> None:
    flown(adapter, 10.0)
    assert set(kinds(flown(adapter, 10.6))) == {COURSE, HEIGHT, SPEED}


def test_the_cruise_speed_is_flown_anyway_and_others_within_the_limits(adapter: Px4FixedWing) -> None:
    cruise = replace(COMMAND, guidance=replace(GUIDANCE, airspeed_mps=15.6))
    assert SPEED not in kinds(flown(adapter, 10.0, cruise))
    adapter.observe(Parameter(TARGET, "FW_AIRSPD_MAX", 20.0), 10.0)
    fast = replace(COMMAND, guidance=replace(GUIDANCE, airspeed_mps=31.0))
    (speed,) = [m for m in flown(adapter, 10.1, fast) if m.command == SPEED]
    assert speed.param2 == 20.0
    back = [m for m in flown(adapter, 11.0, cruise) if m.command == SPEED]
    assert back
    assert back[0].param2 == pytest.approx(15.6)


def test_without_a_sensor_no_speed_is_commanded(adapter: Px4FixedWing) -> None:
    assert SPEED not in kinds(flown(adapter, 10.0, replace(COMMAND, airspeed_mps=None)))


@pytest.mark.parametrize(("command", "result"), [(COURSE, DENIED), (HEIGHT, REJECTED)])
def test_a_refusal_may_be_a_mode_change_and_silences_it_for_a_moment(
    adapter: Px4FixedWing, command: int, result: int
) -> None:
    flown(adapter, 10.0)
    for other in {COURSE, HEIGHT, SPEED} - {command}:
        answer(adapter, 10.1, other)
    answer(adapter, 10.1, command, result)
    turned = replace(COMMAND, guidance=Guidance(2.0, 18.0, 640.0))
    assert flown(adapter, 10.3, turned) == []
    assert flown(adapter, 10.6, turned) == []
    assert set(kinds(flown(adapter, 10.8, turned))) >= {COURSE, HEIGHT}


def test_a_course_that_is_unsupported_is_lost_and_the_next_way_is_offboard(adapter: Px4FixedWing) -> None:
    flown(adapter, 10.0)
    answer(adapter, 10.1, COURSE, UNSUPPORTED)
    assert adapter.lost_controls == {Control.HEADING}
    assert COURSE not in kinds(flown(adapter, 20.0))
    adapter.choose_way()
    assert adapter.guided_mode == OFFBOARD


def refuse(adapter: Px4FixedWing, command: int, *, shown: int | None, times: int = 12) -> int:
    """Refuse a command whenever it is sent, for 1.5 s each time; how often it was sent.

    `shown`: the mode of the heartbeats that follow each refusal; `None`: none follows.
    """
    sent = 0
    for tick in range(times * 15):
        now_s = 12.0 + tick / 10
        turned = replace(COMMAND, guidance=replace(GUIDANCE, course_rad=tick / 100))
        for message in flown(adapter, now_s, turned):
            refused = message.command == command
            sent += refused
            answer(adapter, now_s + 0.05, message.command, DENIED if refused else ACCEPTED)
            adapter.refusals()
        if shown is not None and tick % 2:
            adapter.observe(Heartbeat(TARGET, 1, 12, True, shown, 4), now_s + 0.06)
    return sent


@pytest.mark.parametrize("command", [COURSE, HEIGHT, SPEED])
def test_a_command_that_is_denied_again_and_again_in_its_mode_is_lost(
    adapter: Px4FixedWing, command: int
) -> None:
    control = {COURSE: Control.HEADING, HEIGHT: Control.HEIGHT, SPEED: Control.SPEED}[command]
    assert refuse(adapter, command, shown=COURSE_MODE) <= 8
    assert adapter.lost_controls == {control}
    adapter.restarted()
    assert adapter.lost_controls == frozenset()


def test_a_course_that_is_denied_twice_is_given_up(adapter: Px4FixedWing) -> None:
    for now_s in (12.0, 13.0):
        assert COURSE in kinds(flown(adapter, now_s))
        answer(adapter, now_s + 0.1, COURSE, DENIED)
        adapter.observe(Heartbeat(TARGET, 1, 12, True, COURSE_MODE, 4), now_s + 0.3)
    flown(adapter, 14.0)
    assert adapter.refused_values() == [RefusedValue(Control.HEADING, GUIDANCE.course_rad)]
    assert adapter.lost_controls == frozenset()


@pytest.mark.parametrize("shown", [None, HOLD])
def test_a_refusal_counts_only_when_the_mode_is_shown_after_it(
    adapter: Px4FixedWing, shown: int | None
) -> None:
    assert refuse(adapter, COURSE, shown=shown) > 8
    assert adapter.lost_controls == frozenset()
    assert adapter.refused_values() == []


def test_refusals_just_after_the_entry_do_not_count(adapter: Px4FixedWing) -> None:
    """The mode is acknowledged, and shown, before it takes commands."""
    for tick in range(10):
        for message in flown(adapter, 10.0 + tick / 10):
            answer(adapter, 10.0 + tick / 10, message.command, DENIED)
        adapter.observe(Heartbeat(TARGET, 1, 12, True, COURSE_MODE, 4), 10.05 + tick / 10)
    assert set(kinds(flown(adapter, 11.6))) == {COURSE, HEIGHT, SPEED}
    assert adapter.refused_values() == []


def target(altitude_m: float) -> NavigationTarget:
    return NavigationTarget(TARGET, 47.4, 8.5, altitude_m)


def test_a_height_that_is_acknowledged_and_not_flown_is_refused_once(adapter: Px4FixedWing) -> None:
    flown(adapter, 10.0)
    for command in (COURSE, HEIGHT, SPEED):
        answer(adapter, 10.05, command)
    for half_seconds in range(20):
        now_s = 10.1 + half_seconds / 2
        adapter.observe(target(600.0), now_s)
        flown(adapter, now_s)
        for command in (COURSE, HEIGHT, SPEED):
            answer(adapter, now_s, command)
    assert adapter.refused_values() == [RefusedValue(Control.HEIGHT, 680.0)]
    assert adapter.refusals() == ["height not taken, outside PX4's fence?"]
    assert adapter.refusals() == adapter.refused_values() == []
    assert not adapter.is_foreign_target(target(600.0))


def test_a_height_that_the_target_shows_is_not_repeated(adapter: Px4FixedWing) -> None:
    flown(adapter, 10.0)
    for command in (COURSE, HEIGHT, SPEED):
        answer(adapter, 10.05, command)
    for now_s in (12.1, 14.2, 16.3):
        adapter.observe(target(680.0), now_s)
        assert kinds(flown(adapter, now_s)) == [SPEED, COURSE]
    assert HEIGHT in kinds(flown(adapter, 20.0)), "no target is reported any more"


def test_another_height_is_someone_elses_order_and_is_not_fought(adapter: Px4FixedWing) -> None:
    flown(adapter, 10.0)
    answer(adapter, 10.05, HEIGHT)
    adapter.observe(target(680.0), 14.0)
    assert not adapter.is_foreign_target(target(680.0))
    assert not adapter.is_foreign_target(target(650.0)), "the mission's, from before"
    adapter.observe(target(700.0), 14.5)
    assert adapter.is_foreign_target(target(700.0))
    assert HEIGHT not in kinds(flown(adapter, 14.6))
    adapter.drop_commands()
    assert adapter.is_foreign_target(target(700.0)), "it is still theirs after we let go"


# --- the autopilot's own avoidance


@pytest.mark.parametrize(
    ("parameters", "found"),
    [
        ({"NAV_TRAFF_AVOID": 2.0}, "NAV_TRAFF_AVOID 2"),
        ({"NAV_TRAFF_AVOID": 1.0}, None),
        ({"DAA_EN": 1.0, "DAA_LVL_LOW_ACT": 1.0, "NAV_TRAFF_AVOID": 4.0}, None),
        ({"DAA_EN": 1.0, "NAV_TRAFF_AVOID": 4.0}, "NAV_TRAFF_AVOID 4"),
        ({"DAA_EN": 1.0, "DAA_LVL_MED_ACT": 3.0, "NAV_TRAFF_AVOID": 1.0}, "DAA_LVL_MED_ACT 3"),
        ({"DAA_EN": 0.0, "DAA_LVL_MED_ACT": 3.0, "NAV_TRAFF_AVOID": 4.0}, None),
    ],
)
def test_what_acts_on_traffic(adapter: Px4FixedWing, parameters: dict[str, float], found: str | None) -> None:
    assert adapter.other_avoider(parameters) == found
    assert of_version(1, 16).other_avoider(parameters) == (None if "DAA_EN" in parameters else found)
    adapter.fall_back(0)
    daa = "DAA_EN" in parameters
    assert adapter.other_avoider(parameters) == (None if daa else found), "DAA never acts from OFFBOARD"


@pytest.mark.parametrize(
    ("action", "advice"),
    [
        (0.0, []),
        (1.0, ["COM_TRAFF_AVOID 1: warns without receiver heartbeats"]),
        (3.0, ["COM_TRAFF_AVOID 3: returns home without receiver heartbeats"]),
    ],
)
def test_what_px4_demands_of_a_receiver(adapter: Px4FixedWing, action: float, advice: list[str]) -> None:
    assert adapter.advice({"COM_TRAFF_AVOID": action, "COM_OBL_RC_ACT": 0.0}) == advice


# --- modes


@pytest.mark.parametrize(
    ("main", "sub", "name"),
    [
        (4, 10, "VTOL_TAKEOFF"), (4, 11, "EXTERNAL1"), (4, 18, "EXTERNAL8"), (4, 19, "GUIDED_COURSE"),
        (4, 20, "DESCEND"), (4, 9, "PRECLAND"), (3, 0, "POSCTL"), (3, 1, "ORBIT"), (3, 2, "POSITION_SLOW"),
        (10, 0, "TERMINATION"), (11, 0, "ALTITUDE_CRUISE"), (4, 99, "AUTO 99"), (77, 0, "MODE 77"),
    ],
)  # fmt: skip
def test_every_mode_has_a_name(main: int, sub: int, name: str) -> None:
    assert Px4FixedWing.mode_name(main << 16 | sub << 24) == name
    assert name in MODES_OF["px4"] or " " in name


def test_every_mode_of_arduplane_has_a_name() -> None:
    names = {ArduPlane.mode_name(number) for number in range(27)}
    assert {name for name in names if name.startswith("MODE")} == {"MODE 9"}
    assert {"QAUTOTUNE", "QACRO", "AUTOLAND"} <= names
