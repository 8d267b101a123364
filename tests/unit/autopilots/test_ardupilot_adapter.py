"""What is sent to ArduPlane: commands on change, repeated slowly, and a stream of position targets."""

import math
from collections import Counter

import pytest

from companion.autopilots import ArduPlane, Px4FixedWing, choose
from companion.autopilots.adapter import GuidanceCommand, RefusedValue
from companion.avoidance import Control
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.facts import CommandResult, NavigationTarget, Sender
from companion.model import Guidance, PriorFlightState

TARGET = Sender(1, 1)
PLACE = GeoPoint(-35.0, 149.0, 600.0)
GUIDANCE = Guidance(math.radians(40.0), 22.0, 680.0)


def guidance_command(
    guidance: Guidance = GUIDANCE, airspeed_mps: float | None = 22.0, place: GeoPoint = PLACE
) -> GuidanceCommand:
    return GuidanceCommand(guidance, place, (24.0, 0.0, 0.0), airspeed_mps, math.radians(30.0))


def kinds(messages: list[Message]) -> Counter[str]:
    return Counter(
        f"{message.get_type()} {message.command}" if hasattr(message, "command") else message.get_type()
        for message in messages
    )


def accept_all(adapter: ArduPlane, messages: list[Message], now_s: float) -> None:
    for message in messages:
        if hasattr(message, "command"):
            adapter.observe(CommandResult(TARGET, message.command, 0, None), now_s)


def stream(adapter: ArduPlane, seconds: float, *, urgent: bool = False) -> list[Message]:
    sent = []
    for tick in range(round(seconds * 10)):
        now_s = 100.0 + tick / 10
        messages = adapter.command(guidance_command(), now_s, urgent=urgent) + adapter.tick(now_s)
        accept_all(adapter, messages, now_s)
        sent += messages
    return sent


def test_the_first_command_sends_heading_height_and_position() -> None:
    messages = ArduPlane(TARGET).command(guidance_command(), 100.0, urgent=False)
    assert kinds(messages) == {
        "COMMAND_INT 43002": 1,
        "COMMAND_INT 43001": 1,
        "SET_POSITION_TARGET_GLOBAL_INT": 1,
    }


def test_another_speed_than_the_present_one_is_commanded_and_then_every_change_of_it() -> None:
    adapter = ArduPlane(TARGET)
    faster = Guidance(GUIDANCE.course_rad, 28.0, 680.0)
    assert kinds(adapter.command(guidance_command(faster), 100.0, urgent=False))["COMMAND_INT 43000"] == 1
    assert (
        kinds(adapter.command(guidance_command(faster, 27.5), 100.1, urgent=False))["COMMAND_INT 43000"] == 0
    )
    back = adapter.command(guidance_command(GUIDANCE, 22.5), 100.2, urgent=False)
    assert kinds(back)["COMMAND_INT 43000"] == 1, "the command stands until another one"


def test_no_speed_is_commanded_without_a_sensor() -> None:
    adapter = ArduPlane(TARGET)
    for tick in range(300):
        wanted = Guidance(GUIDANCE.course_rad, 16.0 + tick % 12, 680.0)
        sent = adapter.command(guidance_command(wanted, None), 100.0 + tick / 10, urgent=False)
        assert "COMMAND_INT 43000" not in kinds(sent)


def test_steady_guidance_is_streamed_at_5_hz_and_the_heading_every_two_seconds() -> None:
    counts = kinds(stream(ArduPlane(TARGET), 10.0))
    assert counts["SET_POSITION_TARGET_GLOBAL_INT"] == 50
    assert counts["COMMAND_INT 43002"] == 5
    assert counts["COMMAND_INT 43000"] == 0
    assert counts["COMMAND_INT 43001"] == 1


def test_urgent_setpoints_stay_below_10_hz() -> None:
    adapter = ArduPlane(TARGET)
    sent = [
        message
        for tick in range(200)
        for message in adapter.command(guidance_command(), 100.0 + tick * 0.02, urgent=True)
        if message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"
    ]
    assert 35 <= len(sent) <= 44, "in four seconds"


def test_a_change_is_sent_at_once_unless_it_is_tiny() -> None:
    adapter = ArduPlane(TARGET)
    accept_all(adapter, adapter.command(guidance_command(), 100.0, urgent=False), 100.0)
    tiny = Guidance(GUIDANCE.course_rad + math.radians(0.5), 22.1, 680.4)
    assert "COMMAND_INT 43002" not in kinds(adapter.command(guidance_command(tiny), 100.1, urgent=False))
    turned = Guidance(GUIDANCE.course_rad + math.radians(5.0), 22.0, 680.0)
    counts = kinds(adapter.command(guidance_command(turned), 100.2, urgent=False))
    assert counts["COMMAND_INT 43002"] == 1
    assert counts["COMMAND_INT 43000"] == counts["COMMAND_INT 43001"] == 0


def test_slow_drifts_add_up_to_changes() -> None:
    adapter = ArduPlane(TARGET)
    headings = 0
    for tick in range(15):
        wanted = Guidance(math.radians(40.0 + 0.2 * tick), 22.0, 680.0)
        messages = adapter.command(guidance_command(wanted), 100.0 + tick / 10, urgent=False)
        accept_all(adapter, messages, 100.0)
        headings += kinds(messages)["COMMAND_INT 43002"]
    assert headings == 3


def test_the_heading_command_has_course_type_course_and_acceleration() -> None:
    first = ArduPlane(TARGET).command(guidance_command(Guidance(-0.0, 22.0, 680.0)), 100.0, urgent=False)[0]
    assert (first.target_system, first.target_component) == (1, 1)
    assert first.param1 == 0, "course over ground"
    assert 0.0 <= first.param2 < 360.0
    assert first.param3 == pytest.approx(9.80665 * math.tan(math.radians(30.0)))


def test_the_position_target_is_complete() -> None:
    messages = ArduPlane(TARGET).command(guidance_command(), 100.0, urgent=False)
    target = next(m for m in messages if m.get_type() == "SET_POSITION_TARGET_GLOBAL_INT")
    north_m = (target.lat_int / 1e7 - PLACE.lat_deg) * 110_940.0
    east_m = (target.lon_int / 1e7 - PLACE.lon_deg) * 91_290.0
    assert math.degrees(math.atan2(east_m, north_m)) == pytest.approx(40.0, abs=0.2)
    assert math.hypot(north_m, east_m) == pytest.approx(500.0, rel=0.01)
    assert math.degrees(math.atan2(target.vy, target.vx)) == pytest.approx(40.0)
    assert math.hypot(target.vx, target.vy) == pytest.approx(24.0)
    assert target.vz < 0.0, "up, as the height is above us"
    assert target.yaw == pytest.approx(math.radians(40.0))
    assert target.alt == 680.0
    assert target.coordinate_frame == mavlink.MAV_FRAME_GLOBAL
    assert target.type_mask == 0b1001_1100_0000


def test_all_messages_can_be_packed() -> None:
    adapter = ArduPlane(TARGET)
    messages = [
        adapter.set_mode(adapter.guided_mode),
        *adapter.command(guidance_command(), 1.7e9, urgent=True),
        adapter.set_mode(adapter.fallback_mode),
        Px4FixedWing(TARGET).set_mode(4 << 16 | 4 << 24),
        adapter.request_interval(33, 0.1),
        adapter.request_parameter("ADSB_ICAO_ID"),
    ]
    for message in messages:
        assert Encoder().encode(message, 1, 196)


def test_after_standing_back_all_values_are_sent_again() -> None:
    adapter = ArduPlane(TARGET)
    adapter.command(guidance_command(), 100.0, urgent=False)
    adapter.drop_commands()
    assert kinds(adapter.command(guidance_command(), 101.1, urgent=False))["COMMAND_INT 43001"] == 1


def test_after_standing_back_no_command_is_repeated() -> None:
    adapter = ArduPlane(TARGET)
    adapter.command(guidance_command(), 100.0, urgent=False)
    adapter.drop_commands()
    assert adapter.tick(105.0) == []


@pytest.mark.parametrize(
    ("custom_mode", "name"),
    [(0, "MANUAL"), (10, "AUTO"), (15, "GUIDED"), (14, "AVOID_ADSB"), (99, "MODE 99")],
)
def test_ardupilot_mode_names(custom_mode: int, name: str) -> None:
    assert ArduPlane.mode_name(custom_mode) == name


@pytest.mark.parametrize(
    ("main", "sub", "name"),
    [(4, 4, "MISSION"), (4, 3, "HOLD"), (4, 5, "RETURN"), (6, 0, "OFFBOARD"), (1, 0, "MANUAL")],
)
def test_px4_mode_names(main: int, sub: int, name: str) -> None:
    assert Px4FixedWing.mode_name(main << 16 | sub << 24) == name


def refuse(adapter: ArduPlane, command: int, now_s: float) -> None:
    adapter.observe(CommandResult(TARGET, command, mavlink.MAV_RESULT_FAILED, None), now_s)


def commands(adapter: ArduPlane, now_s: float, guidance: Guidance = GUIDANCE) -> dict[int, Message]:
    messages = adapter.command(guidance_command(guidance), now_s, urgent=False)
    return {message.command: message for message in messages if hasattr(message, "command")}


def test_a_refused_speed_is_moderated_once_and_then_given_up() -> None:
    adapter = ArduPlane(TARGET)
    fast = Guidance(GUIDANCE.course_rad, 28.0, GUIDANCE.altitude_m)
    speed = mavlink.MAV_CMD_GUIDED_CHANGE_SPEED
    assert commands(adapter, 100.0, fast)[speed].param2 == 28.0
    refuse(adapter, speed, 100.1)
    assert adapter.refused_values() == []
    assert commands(adapter, 100.2, fast)[speed].param2 == 27.0  # moderated towards the 22 m/s flown
    refuse(adapter, speed, 100.3)
    assert adapter.refused_values() == [RefusedValue(Control.SPEED, 28.0)]
    assert adapter.refused_values() == []
    assert speed not in commands(adapter, 100.4, fast)
    slower = Guidance(GUIDANCE.course_rad, 25.0, GUIDANCE.altitude_m)
    assert commands(adapter, 100.5, slower)[speed].param2 == 25.0  # another value is sent as usual


def test_a_refused_height_is_moderated() -> None:
    adapter = ArduPlane(TARGET)
    at_zero = Guidance(GUIDANCE.course_rad, 22.0, 0.0)
    height = mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE
    assert commands(adapter, 100.0, at_zero)[height].z == 0.0
    refuse(adapter, height, 100.1)
    assert commands(adapter, 100.2, at_zero)[height].z == 2.0


def test_a_late_refusal_of_an_accepted_command_is_ignored() -> None:
    adapter = ArduPlane(TARGET)
    speed = mavlink.MAV_CMD_GUIDED_CHANGE_SPEED
    commands(adapter, 100.0)
    adapter.observe(CommandResult(TARGET, speed, 0, None), 100.1)
    refuse(adapter, speed, 100.2)
    refuse(adapter, speed, 100.3)
    assert adapter.refused_values() == []


def test_guided_is_given_back_with_its_former_target() -> None:
    adapter = ArduPlane(TARGET)
    (message,) = adapter.restore_mode(PriorFlightState(15, target=GeoPoint(-35.1, 149.2, 650.0)))
    assert (message.get_type(), message.command) == ("COMMAND_INT", 192)
    assert (message.param2, message.x, message.y, message.z) == (1.0, -351_000_000, 1_492_000_000, 650.0)
    (mission,) = adapter.restore_mode(PriorFlightState(10, target=GeoPoint(-35.1, 149.2, 650.0)))
    assert (mission.command, mission.param2) == (176, 10)


def test_modes_are_requested_by_number() -> None:
    plane = ArduPlane(TARGET).set_mode(15)
    assert (plane.command, plane.param1, plane.param2) == (176, 1, 15)
    px4 = Px4FixedWing(TARGET).set_mode(4 << 16 | 4 << 24)
    assert (px4.command, px4.param1, px4.param2, px4.param3) == (176, 1, 4, 4)


def test_the_heartbeat_selects_the_adapter() -> None:
    assert isinstance(choose(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, TARGET), ArduPlane)
    assert isinstance(choose(mavlink.MAV_AUTOPILOT_PX4, TARGET), Px4FixedWing)
    assert choose(mavlink.MAV_AUTOPILOT_GENERIC, TARGET) is None


UNSUPPORTED, DENIED = 3, 2
HEADING, SPEED, HEIGHT, REPOSITION = 43002, 43000, 43001, 192


def answer(adapter: ArduPlane, results: dict[int, int], *, seconds: float = 20.0) -> Counter[str]:
    """Fly a guidance that turns, climbs and speeds up; counts of what was sent."""
    counts: Counter[str] = Counter()
    for tick in range(round(seconds * 10)):
        now_s = 100.0 + tick / 10
        wanted = Guidance(math.radians(5.0 * tick), 16.0 + tick % 10, 500.0 + tick)
        messages = adapter.command(guidance_command(wanted), now_s, urgent=False) + adapter.tick(now_s)
        for message in messages:
            if (command := getattr(message, "command", None)) is not None:
                adapter.observe(CommandResult(TARGET, command, results.get(command, 0), None), now_s)
        counts += kinds(messages)
    return counts


def test_unsupported_commands_are_sent_once_and_flown_in_another_way() -> None:
    adapter = ArduPlane(TARGET)
    counts = answer(adapter, dict.fromkeys((HEADING, SPEED, HEIGHT), UNSUPPORTED))
    assert counts["COMMAND_INT 43002"] == counts["COMMAND_INT 43000"] == counts["COMMAND_INT 43001"] == 1
    assert counts["SET_POSITION_TARGET_GLOBAL_INT"] == 100, "the height"
    assert counts["COMMAND_INT 192"] > 10, "the course"
    assert len(adapter.refusals()) == 3
    assert adapter.lost_controls == {Control.SPEED}
    adapter.drop_commands()
    assert answer(adapter, {HEADING: UNSUPPORTED})["COMMAND_INT 43002"] == 0, "for the whole flight"
    adapter.restarted()
    assert adapter.lost_controls == set()
    assert answer(adapter, {}, seconds=1.0)["COMMAND_INT 43002"] == 10


def test_a_course_by_place_is_far_ahead_at_the_commanded_height_and_obeyed_in_guided_only() -> None:
    adapter = ArduPlane(TARGET)
    answer(adapter, {HEADING: UNSUPPORTED}, seconds=0.1)
    (course,) = [
        message
        for message in adapter.command(guidance_command(), 200.0, urgent=False)
        if getattr(message, "command", None) == REPOSITION
    ]
    assert course.param2 == 0, "no change of mode"
    north_m = (course.x / 1e7 - PLACE.lat_deg) * 110_940.0
    east_m = (course.y / 1e7 - PLACE.lon_deg) * 91_290.0
    assert math.hypot(north_m, east_m) > 5_000.0
    assert math.degrees(math.atan2(east_m, north_m)) == pytest.approx(40.0, abs=0.3)
    assert course.z == GUIDANCE.altitude_m
    assert adapter.is_own_target(NavigationTarget(TARGET, course.x / 1e7, course.y / 1e7, None))
    assert not adapter.is_own_target(NavigationTarget(TARGET, PLACE.lat_deg, PLACE.lon_deg, None))
    adapter.observe(CommandResult(TARGET, REPOSITION, 0, None), 200.0)
    repeated = sum(
        kinds(adapter.command(guidance_command(), 200.0 + tick / 10, urgent=False))["COMMAND_INT 192"]
        for tick in range(1, 250)
    )
    assert repeated == 2


def test_a_control_that_is_refused_with_every_value_is_lost() -> None:
    adapter = ArduPlane(TARGET)
    counts = answer(adapter, dict.fromkeys((HEADING, SPEED, HEIGHT, REPOSITION), DENIED))
    assert all(counts[f"COMMAND_INT {command}"] <= 6 for command in (HEADING, SPEED, HEIGHT, REPOSITION))
    assert adapter.lost_controls == {Control.HEADING, Control.SPEED}


def test_one_refused_value_does_not_lose_the_control() -> None:
    adapter = ArduPlane(TARGET)
    for value in range(10):
        result = DENIED if value % 3 else 0
        wanted = Guidance(math.radians(20.0 * value), 22.0, 680.0)
        for _ in range(2):
            adapter.command(guidance_command(wanted), 100.0 + value, urgent=False)
            adapter.observe(CommandResult(TARGET, HEADING, result, None), 100.0 + value)
    assert adapter.lost_controls == set()
    assert kinds(adapter.command(guidance_command(), 200.0, urgent=False))["COMMAND_INT 43002"] == 1


def test_leaving_guided_drops_a_course_that_is_under_way() -> None:
    adapter = ArduPlane(TARGET)
    answer(adapter, {HEADING: UNSUPPORTED}, seconds=0.1)
    assert kinds(adapter.command(guidance_command(), 200.0, urgent=False))["COMMAND_INT 192"] == 1
    assert adapter.leaving(guidance_command(), 200.1) == []
    assert "COMMAND_INT 192" not in kinds(adapter.tick(201.0))
