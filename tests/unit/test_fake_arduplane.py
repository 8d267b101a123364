"""The fake ArduPlane against the manners that were measured on the real one, the unhelpful ones included."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import FrameSplitter, decode
from companion.units import wrap_pi
from sim.vehicle import FakeArduPlane, MissionItem, Mode, takeoff_item, waypoint_item
from sim.vehicle.mission import DO_CHANGE_SPEED, NAV_LAND, NAV_LOITER_UNLIM, NAV_RETURN_TO_LAUNCH

REAL_LOG = Path(__file__).parents[2].parent / "shared/data/tlogs/arduplane_sitl_adsb_two_intruders.tlog"

START_S = 1_800_000_000.0
HOME = GeoPoint(-35.363261, 149.1652299, 584.1)
FRAME = LocalFrame(HOME.lat_deg, HOME.lon_deg)
GCS, COMPANION = (255, 190), (1, 191)
ACCEPTED, DENIED, UNSUPPORTED, FAILED, INT_ONLY = 0, 2, 3, 4, 8
SET_MODE, ARM, SET_INTERVAL, REPOSITION = 176, 400, 511, 192
CHANGE_SPEED, CHANGE_ALTITUDE, CHANGE_HEADING = 43000, 43001, 43002


def waypoint(north_m: float, east_m: float, height_m: float = 300.0) -> MissionItem:
    return waypoint_item(FRAME.to_geo(north_m, east_m, -(HOME.altitude_m + height_m)))


MISSION = [takeoff_item(60.0), waypoint(4000.0, 0.0), waypoint(4000.0, 3000.0)]


class Bench:
    """A vehicle and all that it said, by channel."""

    def __init__(self, vehicle: FakeArduPlane, channels: Sequence[int] = (0,), rate_hz: float = 0.0) -> None:
        self.vehicle = vehicle
        self.said: list[tuple[int, Message]] = []
        for channel in channels:
            vehicle.add_channel(channel, stream_rate_hz=rate_hz)

    def fly(self, seconds: float) -> None:
        self.said += self.vehicle.step(self.vehicle.time_s + seconds)

    def send(self, message: Message, sender: tuple[int, int] = GCS, channel: int = 0) -> None:
        message.get_header().srcSystem, message.get_header().srcComponent = sender
        self.vehicle.receive(message, self.vehicle.time_s, channel)
        self.said += self.vehicle.step(self.vehicle.time_s)

    def heard(self, kind: str, channel: int = 0) -> list[Message]:
        return [m for c, m in self.said if c == channel and m.get_type() == kind]

    def texts(self) -> list[str]:
        return [m.text for m in self.heard("STATUSTEXT")]

    def by_long(
        self, command: int, *params: float, target: tuple[int, int] = (1, 1), channel: int = 0
    ) -> int:
        values = (*params, *(0.0,) * (7 - len(params)))
        message = mavlink.MAVLink_command_long_message(*target, command, 0, *values)
        return self._result(message, command, channel)

    def by_int(
        self, command: int, *params: float, frame: int = 0, place: tuple[int, int, float] = (0, 0, 0.0)
    ) -> int:
        values = (*params, *(0.0,) * (4 - len(params)))
        return self._result(
            mavlink.MAVLink_command_int_message(1, 1, frame, command, 0, 0, *values, *place), command
        )

    def _result(self, message: Message, command: int, channel: int = 0) -> int:
        before = len(self.heard("COMMAND_ACK", channel))
        self.send(message, channel=channel)
        answers = self.heard("COMMAND_ACK", channel)[before:]
        if not answers:
            return -1
        (answer,) = answers
        assert answer.command == command
        assert (answer.target_system, answer.target_component) == GCS
        return int(answer.result)

    def guided(self) -> None:
        assert self.by_long(SET_MODE, 1, Mode.GUIDED) == ACCEPTED


def airborne(**options: Any) -> Bench:
    """At 300 m above home on the way north, in AUTO."""
    vehicle = FakeArduPlane.airborne(
        HOME,
        START_S,
        mission=options.pop("mission", MISSION),
        position=FRAME.to_geo(0.0, 0.0, -(HOME.altitude_m + 300.0)),
        course_rad=0.0,
        sequence=options.pop("sequence", 2),
        wind_mps=options.pop("wind_mps", (0.0, 0.0)),
    )
    return Bench(vehicle, **options)


def on_ground(**options: Any) -> Bench:
    return Bench(FakeArduPlane(HOME, START_S, mission=MISSION), **options)


def course_deg(bench: Bench) -> float:
    north_mps, east_mps, _ = bench.vehicle.truth.velocity_mps
    return math.degrees(math.atan2(east_mps, north_mps)) % 360.0


def height_m(bench: Bench) -> float:
    return -bench.vehicle.truth.position_m[2] - HOME.altitude_m


# --- telling about itself ---


def test_heartbeat_once_a_second_on_every_channel_with_the_recorded_modes() -> None:
    bench = on_ground(channels=(0, 1))
    bench.fly(10.0)
    assert len(bench.heard("HEARTBEAT", 0)) == len(bench.heard("HEARTBEAT", 1)) == 10
    bench.vehicle.set_mode(Mode.AUTO)
    bench.fly(1.0)
    bench.vehicle.arm()
    bench.fly(20.0)
    told = [
        (m.type, m.autopilot, m.base_mode, m.custom_mode, m.system_status) for m in bench.heard("HEARTBEAT")
    ]
    assert told[0] == (1, 3, 81, 0, 3)
    assert (1, 3, 89, 10, 3) in told
    assert told[-1] == (1, 3, 217, 10, 4)


def test_every_message_can_be_packed_and_says_the_truth() -> None:
    bench = airborne(rate_hz=2.0, wind_mps=(2.0, -1.0))
    bench.guided()
    bench.by_int(CHANGE_ALTITUDE, frame=3, place=(0, 0, 400.0))
    bench.fly(5.0)
    encoder, splitter = Encoder(), FrameSplitter()
    decoded: dict[str, Any] = {}
    for _, message in bench.said:
        assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 1)
        (frame,) = splitter.feed_datagram(encoder.encode(message, 1, 1))
        decoded[message.get_type()] = decode(frame)
    truth = bench.vehicle.truth
    position = decoded["GLOBAL_POSITION_INT"]
    assert position.lat / 1e7 == pytest.approx(truth.place.lat_deg, abs=1e-6)
    assert position.alt / 1e3 == pytest.approx(truth.place.altitude_m, abs=0.1)
    assert position.relative_alt == position.alt - 584_100
    assert position.vz / 100.0 == pytest.approx(-4.5, abs=0.1)  # down is positive
    assert decoded["VFR_HUD"].climb == pytest.approx(4.5, abs=0.1)  # up is positive
    assert position.hdg / 100.0 == pytest.approx(math.degrees(truth.heading_rad), abs=1.0)
    assert decoded["ATTITUDE"].roll == pytest.approx(truth.bank_rad, abs=0.02)
    assert decoded["WIND"].direction == pytest.approx(math.degrees(math.atan2(1.0, -2.0)))  # where it is from
    assert decoded["WIND"].speed == pytest.approx(math.hypot(2.0, 1.0))
    assert decoded["POSITION_TARGET_GLOBAL_INT"].alt == pytest.approx(984.1, abs=0.01)
    assert decoded["LOCAL_POSITION_NED"].z == pytest.approx(HOME.altitude_m + truth.position_m[2], abs=0.1)
    assert decoded["SYSTEM_TIME"].time_unix_usec == pytest.approx(truth.time_s * 1e6, abs=1e6)
    assert 0 < decoded["BATTERY_STATUS"].battery_remaining <= 100


@pytest.mark.skipif(not REAL_LOG.exists(), reason="the recorded flight is not beside this checkout")
def test_fields_that_never_change_are_those_of_the_recorded_flight() -> None:
    real: dict[str, Message] = {}
    for frame in FrameSplitter().feed(REAL_LOG.read_bytes()):
        message = decode(frame)
        if message is not None:
            real[message.get_type()] = message  # the last one: level in AUTO
    bench = airborne(rate_hz=2.0)
    bench.by_long(512, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    bench.fly(2.0)
    fake = {message.get_type(): message for _, message in bench.said}
    constant = {
        "HEARTBEAT": ("type", "autopilot", "base_mode", "custom_mode", "system_status", "mavlink_version"),
        "POSITION_TARGET_GLOBAL_INT": ("coordinate_frame", "type_mask", "vx", "afx", "yaw"),
        "MISSION_CURRENT": ("mission_state", "mission_mode"),
        "SYS_STATUS": ("onboard_control_sensors_present", "onboard_control_sensors_health"),
        "GPS_RAW_INT": ("fix_type", "satellites_visible", "eph", "epv"),
        "BATTERY_STATUS": ("id", "temperature", "charge_state"),
        "HOME_POSITION": ("approach_x",),
    }
    for kind, names in constant.items():
        for name in names:
            assert getattr(fake[kind], name) == getattr(real[kind], name), (kind, name)
    assert all(math.isnan(q) for q in (*fake["HOME_POSITION"].q, *real["HOME_POSITION"].q))
    # Both fly level to the north, so what the fields mean shows in their signs and sizes.
    for said in (real, fake):
        assert abs(said["ATTITUDE"].yaw) < 0.1
        assert abs(said["VFR_HUD"].airspeed - 22.0) < 0.5
        assert abs(said["GLOBAL_POSITION_INT"].relative_alt - 300_000) < 1000


def test_message_intervals_belong_to_the_channel() -> None:
    bench = on_ground(channels=(0, 1))
    assert bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, 100_000, channel=1) == ACCEPTED
    bench.fly(10.0)
    assert len(bench.heard("ATTITUDE", 0)) == 0
    assert len(bench.heard("ATTITUDE", 1)) == 100
    assert bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, -1, channel=1) == ACCEPTED
    bench.fly(10.0)
    assert len(bench.heard("ATTITUDE", 1)) == 100


def test_an_interval_for_a_message_that_is_not_streamed_is_denied_aloud() -> None:
    bench = on_ground()
    assert bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_COLLISION, 1_000_000) == DENIED
    assert "No ap_message for mavlink id (247)" in bench.texts()


def test_data_streams_set_a_group_at_once() -> None:
    bench = on_ground()
    group = mavlink.MAV_DATA_STREAM_POSITION
    bench.send(mavlink.MAVLink_request_data_stream_message(1, 1, group, 5, 1))
    bench.fly(4.0)
    assert len(bench.heard("GLOBAL_POSITION_INT")) == len(bench.heard("LOCAL_POSITION_NED")) == 20
    bench.send(mavlink.MAVLink_request_data_stream_message(1, 1, group, 5, 0))
    bench.fly(4.0)
    assert len(bench.heard("GLOBAL_POSITION_INT")) == 20


def test_a_message_on_request() -> None:
    bench = on_ground()
    assert bench.by_long(512, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == ACCEPTED
    (version,) = bench.heard("AUTOPILOT_VERSION")
    assert version.flight_sw_version >> 16 == 0x0407
    assert bench.by_long(512, 9999) == FAILED


def test_timesync_and_ping_are_answered() -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_timesync_message(tc1=0, ts1=123))
    (answer,) = bench.heard("TIMESYNC")
    assert answer.ts1 == 123
    assert answer.tc1 > 0
    bench.send(mavlink.MAVLink_ping_message(5, 7, 0, 0))
    (pong,) = bench.heard("PING")
    assert (pong.seq, pong.target_system, pong.target_component) == (7, *GCS)


# --- who is spoken to ---


@pytest.mark.parametrize(
    ("target", "answered"),
    [((1, 1), True), ((1, 0), True), ((0, 0), True), ((2, 1), False), ((1, 191), False), ((255, 0), False)],
)
def test_only_its_own_addresses(target: tuple[int, int], answered: bool) -> None:
    bench = airborne()
    assert (bench.by_long(SET_MODE, 1, Mode.LOITER, target=target) == ACCEPTED) is answered
    assert (bench.vehicle.truth.mode == "LOITER") is answered


def test_the_answer_goes_to_the_channel_that_asked() -> None:
    bench = airborne(channels=(0, 1))
    assert bench.by_long(SET_MODE, 1, Mode.LOITER, channel=1) == ACCEPTED
    assert bench.heard("COMMAND_ACK", 0) == []


def test_unknown_commands_are_unsupported() -> None:
    assert airborne().by_long(31_000, 1.0) == UNSUPPORTED


# --- modes and arming ---


@pytest.mark.parametrize("mode", list(Mode))
def test_every_mode_flies_on_without_falling(mode: Mode) -> None:
    bench = airborne()
    assert bench.by_long(SET_MODE, 1, mode) == ACCEPTED
    bench.fly(60.0)
    truth = bench.vehicle.truth
    assert not truth.on_ground
    assert truth.mode == mode.name
    assert truth.airspeed_mps == pytest.approx(22.0, abs=6.0)


def test_mode_by_the_old_message_and_by_command_int() -> None:
    bench = airborne()
    bench.send(mavlink.MAVLink_set_mode_message(1, 1, Mode.CIRCLE))
    assert bench.vehicle.truth.mode == "CIRCLE"
    assert [(a.command, a.result) for a in bench.heard("COMMAND_ACK")] == [(11, ACCEPTED)]
    assert bench.by_int(SET_MODE, 1, Mode.RTL) == ACCEPTED
    assert bench.vehicle.truth.mode == "RTL"


@pytest.mark.parametrize("params", [(0.0, 15.0), (1.0, 99.0), (1.0, math.nan), (math.nan, 15.0), (1.0, 15.5)])
def test_modes_that_do_not_exist_are_refused(params: tuple[float, float]) -> None:
    bench = airborne()
    assert bench.by_long(SET_MODE, *params) in (DENIED, FAILED)
    assert bench.vehicle.truth.mode == "AUTO"


def test_disarming_in_the_air_needs_force() -> None:
    bench = airborne()
    assert bench.by_long(ARM, 0.0) == FAILED
    assert bench.vehicle.truth.armed
    assert bench.by_long(ARM, 0.0, 21196.0) == ACCEPTED
    bench.fly(200.0)
    assert bench.vehicle.truth.on_ground
    assert bench.vehicle.truth.velocity_mps == (0.0, 0.0, 0.0)


def test_take_off_as_recorded() -> None:
    """Throttle to 60 m within 11 s of arming, 10 m/s of climb, then the mission goes on."""
    bench = on_ground()
    assert bench.by_long(SET_MODE, 1, Mode.AUTO) == ACCEPTED
    bench.fly(5.0)
    assert bench.vehicle.truth.position_m == (0.0, 0.0, -HOME.altitude_m)  # not before arming
    assert bench.by_long(ARM, 1.0) == ACCEPTED
    fastest_mps = 0.0
    for _ in range(200):
        bench.fly(0.05)
        fastest_mps = max(fastest_mps, -bench.vehicle.truth.velocity_mps[2])
    assert fastest_mps == pytest.approx(10.0, abs=0.5)
    bench.fly(2.0)
    assert height_m(bench) > 60.0
    assert [m.seq for m in bench.heard("MISSION_ITEM_REACHED")] == [1]
    texts = bench.texts()
    assert texts[:2] == ["Mission: 1 Takeoff", "Throttle armed"]
    assert texts[2].startswith("Takeoff complete at 60.")
    assert texts[3] == "Mission: 2 WP"
    bench.fly(30.0)
    assert -bench.vehicle.truth.velocity_mps[2] == pytest.approx(4.5, abs=0.1)


# --- AUTO ---


def test_the_mission_is_flown_to_its_end_and_then_home() -> None:
    bench = airborne(wind_mps=(0.0, 5.0))
    aside_m = 0.0
    while bench.vehicle.truth.mission_sequence == 2:
        bench.fly(1.0)
        aside_m = max(aside_m, abs(bench.vehicle.truth.position_m[1]))
    assert aside_m < 70.0  # turning early at the corner is all
    bench.fly(200.0)
    assert bench.vehicle.truth.mission_completed
    assert bench.vehicle.truth.mode == "RTL"
    assert [m.seq for m in bench.heard("MISSION_ITEM_REACHED")] == [2, 3]
    assert "Mission complete, changing mode to RTL" in bench.texts()
    bench.fly(300.0)
    assert math.hypot(*bench.vehicle.truth.position_m[:2]) == pytest.approx(60.0, abs=25.0)
    assert height_m(bench) == pytest.approx(100.0, abs=1.0)


def test_back_to_auto_resumes_the_same_item_straight() -> None:
    bench = airborne()
    bench.fly(20.0)
    bench.guided()
    assert bench.by_int(CHANGE_HEADING, 0, 90.0, 5.0) == ACCEPTED
    bench.fly(60.0)
    truth = bench.vehicle.truth
    assert truth.mission_sequence == 2
    assert bench.by_long(SET_MODE, 1, Mode.AUTO) == ACCEPTED
    assert bench.texts()[-1] == "Mission: 2 WP"
    start_n, start_e, _ = truth.position_m
    bench.fly(40.0)
    north_m, east_m, _ = bench.vehicle.truth.position_m
    line_rad = math.atan2(-start_e, 4000.0 - start_n)
    aside_m = (east_m - start_e) * math.cos(line_rad) - (north_m - start_n) * math.sin(line_rad)
    assert abs(aside_m) < 25.0
    bench.fly(140.0)
    assert [m.seq for m in bench.heard("MISSION_ITEM_REACHED")] == [2]


def test_setting_the_current_item() -> None:
    bench = airborne()
    assert bench.by_long(224, 3.0) == ACCEPTED
    assert bench.vehicle.truth.mission_sequence == 3
    assert bench.by_long(224, 17.0) == FAILED
    bench.send(mavlink.MAVLink_mission_set_current_message(1, 1, 2))
    assert bench.vehicle.truth.mission_sequence == 2


def test_an_acceptance_radius_is_kept() -> None:
    place = FRAME.to_geo(1000.0, 0.0, -(HOME.altitude_m + 300.0))
    bench = airborne(
        mission=[takeoff_item(60.0), waypoint_item(place, acceptance_m=200.0), waypoint(1000.0, 900.0)]
    )
    while bench.vehicle.truth.mission_sequence == 2:
        bench.fly(0.05)
    assert 1000.0 - bench.vehicle.truth.position_m[0] == pytest.approx(200.0, abs=2.0)


def test_loitering_without_end_does_not_complete_the_waypoints_after() -> None:
    loiter = MissionItem(
        NAV_LOITER_UNLIM,
        (0.0, 0.0, -80.0, 0.0),
        round(FRAME.to_geo(500.0, 0.0, 0.0).lat_deg * 1e7),
        round(HOME.lon_deg * 1e7),
        300.0,
    )
    bench = airborne(mission=[takeoff_item(60.0), loiter, waypoint(3000.0, 0.0)])
    bench.fly(120.0)
    headings = []
    for _ in range(20):
        bench.fly(1.0)
        truth = bench.vehicle.truth
        headings.append(truth.heading_rad)
        assert math.dist(truth.position_m[:2], (500.0, 0.0)) == pytest.approx(80.0, abs=12.0)
    assert wrap_pi(headings[3] - headings[0]) < 0.0  # a negative radius turns left
    assert not truth.mission_completed


def test_speed_rtl_and_landing_items() -> None:
    speed = MissionItem(DO_CHANGE_SPEED, (0.0, 26.0, 0.0, 0.0))
    bench = airborne(mission=[takeoff_item(60.0), waypoint(300.0, 0.0), speed, waypoint(2000.0, 0.0)])
    bench.fly(30.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(26.0, abs=0.2)

    home = MissionItem(NAV_RETURN_TO_LAUNCH)
    bench = airborne(mission=[takeoff_item(60.0), waypoint(300.0, 0.0), home])
    bench.fly(120.0)
    assert bench.vehicle.truth.mission_completed
    assert math.hypot(*bench.vehicle.truth.position_m[:2]) < 100.0

    field = FRAME.to_geo(3000.0, 0.0, 0.0)
    land = MissionItem(NAV_LAND, lat_e7=round(field.lat_deg * 1e7), lon_e7=round(field.lon_deg * 1e7))
    bench = airborne(mission=[takeoff_item(60.0), waypoint(300.0, 0.0), land])
    bench.fly(60.0)
    assert not bench.vehicle.truth.mission_completed
    bench.fly(150.0)
    truth = bench.vehicle.truth
    assert truth.on_ground
    assert not truth.armed
    assert truth.mission_completed
    assert truth.position_m[0] == pytest.approx(3000.0, abs=150.0)


def test_auto_without_a_mission_goes_home() -> None:
    bench = airborne()
    bench.send(mavlink.MAVLink_mission_clear_all_message(1, 1))
    assert bench.vehicle.truth.mode == "RTL"
    assert "Aircraft in auto without a running mission" in bench.texts()


# --- GUIDED ---


def test_entering_guided_loiters_where_it_is() -> None:
    bench = airborne()
    bench.fly(20.0)
    here_m = bench.vehicle.truth.position_m
    bench.guided()
    bench.fly(60.0)
    for _ in range(20):
        bench.fly(1.0)
        assert math.dist(bench.vehicle.truth.position_m[:2], here_m[:2]) == pytest.approx(60.0, abs=12.0)
    assert height_m(bench) == pytest.approx(300.0, abs=0.5)


def test_change_heading_turns_as_measured_and_holds_for_ever() -> None:
    bench = airborne(wind_mps=(-3.0, 4.0))
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 91.0, 5.0)
    bench.fly(30.0)
    bench.by_int(CHANGE_HEADING, 0, 10.0, 5.0)
    bench.fly(4.0)
    assert math.degrees(-bench.vehicle.truth.bank_rad) == pytest.approx(
        math.degrees(math.atan(5 / 9.80665)), abs=0.5
    )
    bench.fly(26.0)
    assert course_deg(bench) == pytest.approx(10.0, abs=0.1)  # over ground, in wind
    bench.fly(600.0)
    assert course_deg(bench) == pytest.approx(10.0, abs=0.01)


def test_a_heading_may_be_asked_for_instead_of_a_course() -> None:
    bench = airborne(wind_mps=(0.0, 6.0))
    bench.guided()
    assert bench.by_int(CHANGE_HEADING, 1, 20.0, 5.0) == ACCEPTED
    bench.fly(60.0)
    assert math.degrees(bench.vehicle.truth.heading_rad) == pytest.approx(20.0, abs=0.1)


@pytest.mark.parametrize(
    "params",
    [
        (0.0, 360.0, 5.0),
        (0.0, -1.0, 5.0),
        (0.0, math.nan, 5.0),
        (0.0, math.inf, 5.0),
        (0.0, 90.0, math.nan),
        (7.0, 90.0, 5.0),
        (math.nan, 90.0, 5.0),
    ],
)
def test_bad_headings_are_denied_and_change_nothing(params: tuple[float, float, float]) -> None:
    bench = airborne()
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 270.0, 5.0)
    assert bench.by_int(CHANGE_HEADING, *params) == DENIED
    bench.fly(30.0)
    assert course_deg(bench) == pytest.approx(270.0, abs=0.2)


def test_the_roll_limit_caps_the_bank() -> None:
    bench = airborne()
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"ROLL_LIMIT_DEG", 20.0, 9))
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 180.0, 50.0)
    bench.fly(5.0)
    assert math.degrees(abs(bench.vehicle.truth.bank_rad)) == pytest.approx(20.0, abs=0.1)


def test_speed_is_flown_within_the_parameters_only() -> None:
    bench = airborne()
    bench.guided()
    assert bench.by_int(CHANGE_SPEED, 0, 26.0, 1.0) == ACCEPTED
    bench.fly(15.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(26.0, abs=0.1)
    assert bench.by_int(CHANGE_SPEED, 0, 9.0) == FAILED
    assert bench.by_int(CHANGE_SPEED, 0, 31.0) == FAILED
    assert bench.by_int(CHANGE_SPEED, 0, math.nan) == FAILED
    assert bench.by_int(CHANGE_SPEED, 1, 20.0) == DENIED  # ground speed
    bench.fly(15.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(26.0, abs=0.1)


@pytest.mark.parametrize(
    ("frame", "z_m", "expected_m"),
    [(3, 360.0, 360.0), (6, 250.0, 250.0), (0, 944.1, 360.0), (5, 834.1, 250.0)],
)
def test_altitude_is_flown_in_every_frame(frame: int, z_m: float, expected_m: float) -> None:
    bench = airborne()
    bench.guided()
    assert bench.by_int(CHANGE_ALTITUDE, frame=frame, place=(0, 0, z_m)) == ACCEPTED
    bench.fly(6.0)
    assert abs(height_m(bench) - 300.0) == pytest.approx(4.5 * 6.0, abs=6.0)
    bench.fly(30.0)
    assert height_m(bench) == pytest.approx(expected_m, abs=0.5)


def test_altitude_with_a_rate() -> None:
    bench = airborne()
    bench.guided()
    assert bench.by_int(CHANGE_ALTITUDE, 0.0, 0.0, 1.0, frame=3, place=(0, 0, 330.0)) == ACCEPTED
    bench.fly(20.0)
    assert height_m(bench) == pytest.approx(319.5, abs=1.0)
    bench.fly(40.0)
    assert height_m(bench) == pytest.approx(330.0, abs=0.5)


@pytest.mark.parametrize(("frame", "z_m"), [(3, 0.0), (3, -1.0), (0, math.nan), (1, 300.0), (8, 300.0)])
def test_bad_altitudes_are_denied(frame: int, z_m: float) -> None:
    bench = airborne()
    bench.guided()
    assert bench.by_int(CHANGE_ALTITUDE, frame=frame, place=(0, 0, z_m)) == DENIED


@pytest.mark.parametrize("command", [CHANGE_SPEED, CHANGE_ALTITUDE, CHANGE_HEADING])
def test_guided_commands_fail_outside_guided_and_need_command_int(command: int) -> None:
    bench = airborne()
    assert bench.by_int(command, 0, 20.0, 1.0, frame=3, place=(0, 0, 330.0)) == FAILED
    bench.guided()
    assert bench.by_long(command, 0, 20.0, 1.0) == INT_ONLY
    assert bench.by_int(command, 0, 20.0, 1.0, frame=3, place=(0, 0, 330.0)) == ACCEPTED


@pytest.mark.parametrize("between", [Mode.LOITER, Mode.AUTO, Mode.FBWA])
def test_entering_a_mode_forgets_the_guided_targets(between: Mode) -> None:
    bench = airborne()
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 90.0, 5.0)
    bench.by_int(CHANGE_SPEED, 0, 28.0)
    bench.by_int(CHANGE_ALTITUDE, frame=3, place=(0, 0, 500.0))
    bench.fly(10.0)
    bench.by_long(SET_MODE, 1, between)
    bench.guided()
    here_m = bench.vehicle.truth.position_m
    bench.fly(90.0)
    truth = bench.vehicle.truth
    assert math.dist(truth.position_m[:2], here_m[:2]) < 100.0
    assert truth.position_m[2] == pytest.approx(here_m[2], abs=10.0)
    assert truth.airspeed_mps == pytest.approx(22.0, abs=0.2)


def test_reposition_switches_flies_there_and_circles() -> None:
    bench = airborne()
    place = FRAME.to_geo(1500.0, 1500.0, 0.0)
    target = (round(place.lat_deg * 1e7), round(place.lon_deg * 1e7), 250.0)
    assert bench.by_int(REPOSITION, -1, 0, 0, math.nan, frame=3, place=target) == FAILED  # without the flag
    assert bench.vehicle.truth.mode == "AUTO"
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 270.0, 5.0)
    bench.by_long(SET_MODE, 1, Mode.AUTO)
    assert bench.by_int(REPOSITION, -1, 1, 0, math.nan, frame=3, place=target) == ACCEPTED
    assert bench.vehicle.truth.mode == "GUIDED"
    bench.fly(150.0)
    assert math.dist(bench.vehicle.truth.position_m[:2], (1500.0, 1500.0)) == pytest.approx(60.0, abs=15.0)
    assert height_m(bench) == pytest.approx(250.0, abs=0.5)
    bench.by_int(CHANGE_HEADING, 0, 270.0, 5.0)
    bench.fly(30.0)
    assert bench.by_int(REPOSITION, -1, 0, 120, 1.0, frame=3, place=target) == ACCEPTED  # cancels the course
    bench.fly(120.0)
    assert math.dist(bench.vehicle.truth.position_m[:2], (1500.0, 1500.0)) == pytest.approx(120.0, abs=15.0)
    assert bench.vehicle.truth.bank_rad < 0.0  # p4 = 1 turns left
    assert bench.by_long(REPOSITION, -1, 1) == INT_ONLY


def position_target(frame: int, alt_m: float, mask: int, *, local: bool = False) -> Message:
    build = mavlink.MAVLink_set_position_target_global_int_message
    place: tuple[float, float, float] = (round(-35.3e7), round(149.3e7), alt_m)
    if local:
        build = mavlink.MAVLink_set_position_target_local_ned_message
        place = (0.0, 0.0, alt_m)
    return build(0, 1, 1, frame, mask, *place, 0.0, 25.0, 0.0, 0.0, 0.0, 0.0, 1.5, 0.0)


def test_local_setpoints_are_silently_ignored() -> None:
    bench, undisturbed = airborne(), airborne()
    for each in (bench, undisturbed):
        each.guided()
    before = len(bench.said)
    for _ in range(50):
        bench.send(position_target(mavlink.MAV_FRAME_LOCAL_NED, -100.0, 0, local=True), COMPANION)
        for each in (bench, undisturbed):
            each.fly(0.2)
    assert bench.vehicle.truth == undisturbed.vehicle.truth
    assert {m.get_type() for _, m in bench.said[before:]} == {"HEARTBEAT"}


def test_of_a_local_offset_only_the_height_is_taken() -> None:
    bench = airborne()
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 45.0, 5.0)
    bench.send(position_target(mavlink.MAV_FRAME_LOCAL_OFFSET_NED, -50.0, 0, local=True), COMPANION)
    assert bench.texts()[-1] == "Change alt to 350.0"
    bench.fly(40.0)
    assert height_m(bench) == pytest.approx(350.0, abs=0.5)
    assert course_deg(bench) == pytest.approx(45.0, abs=0.2)


@pytest.mark.parametrize(
    ("frame", "alt_m"), [(0, 944.1), (5, 944.1), (3, 360.0), (6, 360.0), (10, 360.0), (11, 360.0)]
)
def test_of_a_global_setpoint_only_the_height_is_taken_and_stays(frame: int, alt_m: float) -> None:
    bench = airborne()
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 90.0, 5.0)
    for _ in range(90):
        bench.send(position_target(frame, alt_m, 0), COMPANION)
        bench.fly(0.2)
    assert height_m(bench) == pytest.approx(360.0, abs=3.0)  # 60 m in 18 s
    assert course_deg(bench) == pytest.approx(90.0, abs=2.0)
    bench.fly(60.0)
    assert height_m(bench) == pytest.approx(360.0, abs=0.5)
    assert bench.texts() == []


def test_wrong_frames_masked_heights_and_other_modes() -> None:
    bench = airborne()
    bench.send(position_target(0, 944.1, 0), COMPANION)  # in AUTO
    bench.guided()
    bench.send(position_target(0, 944.1, 4), COMPANION)  # Z masked
    assert bench.texts() == []
    bench.send(position_target(1, 944.1, 0), COMPANION)
    assert bench.texts() == ["Invalid coord frame"]
    bench.send(position_target(0, math.nan, 0), COMPANION)
    bench.fly(30.0)
    assert height_m(bench) == pytest.approx(300.0, abs=0.5)


# --- missions and parameters by protocol ---


def item_message(item: MissionItem, sequence: int, *, as_int: bool = True) -> Message:
    if as_int:
        place: tuple[float, float] = (item.lat_e7, item.lon_e7)
        build = mavlink.MAVLink_mission_item_int_message
    else:
        place = (item.lat_e7 / 1e7, item.lon_e7 / 1e7)
        build = mavlink.MAVLink_mission_item_message
    return build(1, 1, sequence, item.frame, item.command, 0, 1, *item.params, *place, item.altitude_m)


@pytest.mark.parametrize("as_int", [True, False])
def test_upload_and_download(as_int: bool) -> None:
    bench = on_ground()
    items = [waypoint(0.0, 0.0), takeoff_item(50.0), waypoint(1000.0, 0.0), waypoint(1000.0, 1000.0)]
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, len(items)))
    while requests := bench.heard("MISSION_REQUEST"):
        bench.said.clear()
        (request,) = requests
        assert (request.target_system, request.target_component) == GCS
        bench.send(item_message(items[request.seq], request.seq, as_int=as_int))
    (done,) = bench.heard("MISSION_ACK")
    assert done.type == mavlink.MAV_MISSION_ACCEPTED
    assert bench.texts() == ["Flight plan received"]
    assert [(m.param_id, m.param_value) for m in bench.heard("PARAM_VALUE")] == [("MIS_TOTAL", 4.0)]

    bench.send(mavlink.MAVLink_mission_request_list_message(1, 1))
    assert bench.heard("MISSION_COUNT")[-1].count == 4
    for sequence in range(4):
        bench.send(mavlink.MAVLink_mission_request_int_message(1, 1, sequence))
        bench.send(mavlink.MAVLink_mission_request_message(1, 1, sequence))
    told = bench.heard("MISSION_ITEM_INT")
    assert [m.seq for m in told] == [0, 1, 2, 3]
    assert (told[0].x, told[0].z) == (round(HOME.lat_deg * 1e7), pytest.approx(HOME.altitude_m))  # home
    for message, item in zip(told[1:], items[1:], strict=True):
        assert message.command == item.command
        assert message.x == pytest.approx(item.lat_e7, abs=0 if as_int else 40)
        assert message.z == pytest.approx(item.altitude_m)
    assert [m.x for m in bench.heard("MISSION_ITEM")] == pytest.approx([m.x / 1e7 for m in told], abs=1e-6)
    bench.send(mavlink.MAVLink_mission_request_int_message(1, 1, 4))
    assert bench.heard("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_INVALID_SEQUENCE


def test_an_upload_that_stalls_is_asked_for_again_and_then_given_up() -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 3))
    bench.fly(7.0)
    assert {m.seq for m in bench.heard("MISSION_REQUEST")} == {0}
    assert 5 <= len(bench.heard("MISSION_REQUEST")) <= 8
    bench.fly(3.0)
    assert bench.heard("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_OPERATION_CANCELLED
    assert len(bench.vehicle.flight.mission.items) == 4  # the old one stays


@pytest.mark.parametrize(
    ("item", "result"),
    [
        (MissionItem(82), mavlink.MAV_MISSION_UNSUPPORTED),
        (MissionItem(16, altitude_m=math.nan), mavlink.MAV_MISSION_INVALID),
        (MissionItem(16, lat_e7=2_000_000_000), mavlink.MAV_MISSION_INVALID),
        (MissionItem(16, frame=1), mavlink.MAV_MISSION_UNSUPPORTED_FRAME),
    ],
)
def test_items_that_cannot_be_flown_end_the_upload(item: MissionItem, result: int) -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 2))
    bench.send(item_message(item, 0))
    assert [m.type for m in bench.heard("MISSION_ACK")] == [result]
    assert len(bench.vehicle.flight.mission.items) == 4


@pytest.mark.parametrize("command", [DO_CHANGE_SPEED, NAV_LOITER_UNLIM, 16])
def test_parameters_that_are_not_given_do_no_harm(command: int) -> None:
    bench = airborne()
    place = waypoint(500.0, 100.0)
    odd = MissionItem(command, (0.0, *(math.nan,) * 3), place.lat_e7, place.lon_e7, 300.0)
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 3))
    for sequence, item in enumerate((place, odd, place)):
        bench.send(item_message(item, sequence))
    bench.fly(60.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(22.0, abs=0.5)
    assert math.dist(bench.vehicle.truth.position_m[:2], (0.0, 0.0)) < 2000.0


def test_rally_points_are_an_empty_list() -> None:
    bench, mission_type = on_ground(), mavlink.MAV_MISSION_TYPE_RALLY
    bench.send(mavlink.MAVLink_mission_request_list_message(1, 1, mission_type))
    (count,) = bench.heard("MISSION_COUNT")
    assert (count.count, count.mission_type) == (0, mission_type)
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 2, mission_type))
    assert bench.heard("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_UNSUPPORTED
    assert bench.heard("MISSION_REQUEST") == []


def test_a_mission_uploaded_in_flight_is_flown_at_once() -> None:
    bench = airborne()
    items = [waypoint(0.0, 0.0), waypoint(500.0, -2000.0)]
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 2))
    for sequence, item in enumerate(items):
        bench.send(item_message(item, sequence))
    bench.fly(60.0)
    assert bench.vehicle.truth.position_m[1] < -800.0


def test_parameters_by_name_by_number_and_as_a_list() -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_param_request_list_message(1, 1))
    told = bench.heard("PARAM_VALUE")
    assert [m.param_index for m in told] == list(range(len(told)))
    assert {m.param_count for m in told} == {len(told)}
    assert {"AIRSPEED_MIN", "AIRSPEED_MAX", "AIRSPEED_CRUISE", "ROLL_LIMIT_DEG", "TECS_CLMB_MAX"} <= {
        m.param_id for m in told
    }
    bench.said.clear()
    bench.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WP_LOITER_RAD", -1))
    bench.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", 3))
    bench.send(mavlink.MAVLink_param_request_read_message(1, 1, b"NO_SUCH_THING", -1))
    assert [m.param_value for m in bench.heard("PARAM_VALUE")] == [60.0, 1.0]


def test_a_parameter_set_is_answered_and_used() -> None:
    bench = airborne(channels=(0, 1))
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"AIRSPEED_MAX", 27.4, 4))
    for channel in (0, 1):
        assert [m.param_value for m in bench.heard("PARAM_VALUE", channel)] == [27.0]  # it is an integer
    bench.guided()
    assert bench.by_int(CHANGE_SPEED, 0, 28.0) == FAILED
    assert bench.by_int(CHANGE_SPEED, 0, 27.0) == ACCEPTED
    for name, value in ((b"AIRSPEED_MAX", math.nan), (b"MIS_TOTAL", 99.0)):
        bench.said.clear()
        bench.send(mavlink.MAVLink_param_set_message(1, 1, name, value, 4))
        assert [m.param_value for m in bench.heard("PARAM_VALUE")] == [
            27.0 if name == b"AIRSPEED_MAX" else 4.0
        ]


# --- traffic through the autopilot ---


def adsb(icao: int = 0xA00001, *, flags: int = 415, north_m: float = 3000.0, **fields: int) -> Message:
    place = FRAME.to_geo(north_m, 0.0, 0.0)
    values: dict[str, Any] = {
        "ICAO_address": icao,
        "lat": round(place.lat_deg * 1e7),
        "lon": round(place.lon_deg * 1e7),
        "altitude_type": 1,
        "altitude": 884_100,
        "heading": 18_000,
        "hor_velocity": 6000,
        "ver_velocity": 0,
        "callsign": b"T000",
        "emitter_type": 1,
        "tslc": 0,
        "flags": flags,
        "squawk": 1200,
    }
    return mavlink.MAVLink_adsb_vehicle_message(**{**values, **fields})


RECEIVER = 7


def traffic_bench(interval_us: float = 200_000) -> Bench:
    bench = airborne(channels=(0, 1))
    bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, interval_us)
    return bench


def test_traffic_is_resent_where_it_was_asked_for_as_from_the_autopilot() -> None:
    bench = traffic_bench()
    bench.send(adsb(), (1, 156), RECEIVER)
    bench.fly(0.5)
    told = bench.heard("ADSB_VEHICLE")
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in told} == {(1, 1)}
    assert told[0].to_dict() == adsb().to_dict()
    assert bench.heard("ADSB_VEHICLE", 1) == []
    assert bench.heard("ADSB_VEHICLE", RECEIVER) == []


def test_the_same_report_comes_again_unaged_for_five_seconds() -> None:
    bench = traffic_bench()
    bench.send(adsb(tslc=1), (1, 156), RECEIVER)
    bench.fly(20.0)
    told = bench.heard("ADSB_VEHICLE")
    assert 5 <= len(told) <= 7  # at most once a second, twice at the very first as recorded
    assert {m.tslc for m in told} == {1}


def test_the_list_is_told_one_by_one() -> None:
    bench = traffic_bench()
    for _ in range(10):
        for icao in (1, 2, 3):
            bench.send(adsb(icao), (1, 156), RECEIVER)
        bench.fly(1.0)
    told = [m.ICAO_address for m in bench.heard("ADSB_VEHICLE")]
    assert told[:6] == [1, 2, 3, 1, 2, 3]
    assert 27 <= len(told) <= 33


def test_any_of_two_flags_is_enough_and_no_flag_is_not() -> None:
    bench = traffic_bench()
    bench.send(adsb(1, flags=1, altitude=2**31 - 1, heading=65_535, hor_velocity=65_535), (1, 156), RECEIVER)
    bench.send(adsb(2, flags=12), (1, 156), RECEIVER)
    bench.send(adsb(3, north_m=11_000.0), (1, 156), RECEIVER)
    bench.send(adsb(0x1000000), (1, 156), RECEIVER)
    bench.fly(3.0)
    assert {m.ICAO_address for m in bench.heard("ADSB_VEHICLE")} == {1}
    assert bench.heard("ADSB_VEHICLE")[0].hor_velocity == 65_535


def test_the_own_transponder_comes_back_unless_its_address_is_known() -> None:
    bench = traffic_bench()
    bench.send(adsb(0xBEEF), (1, 156), RECEIVER)
    bench.fly(1.0)
    assert bench.heard("ADSB_VEHICLE")
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"ADSB_ICAO_ID", float(0xBEEF), 6))
    bench.send(adsb(0xBEEF), (1, 156), RECEIVER)
    bench.said.clear()
    bench.fly(5.0)
    assert bench.heard("ADSB_VEHICLE") == []


def test_without_a_receiver_type_nothing_is_forwarded() -> None:
    bench = traffic_bench()
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"ADSB_TYPE", 0.0, 2))
    bench.send(adsb(), (1, 156), RECEIVER)
    bench.fly(3.0)
    assert bench.heard("ADSB_VEHICLE") == []


# --- time ---


def test_the_rhythm_of_stepping_changes_nothing() -> None:
    often, seldom = airborne(rate_hz=2.0), airborne(rate_hz=2.0)
    for step in range(1, 15_001):
        often.said += often.vehicle.step(START_S + step * 0.01)
    for step in range(1, 31):
        seldom.said += seldom.vehicle.step(START_S + step * 5.0)
    assert often.vehicle.truth == seldom.vehicle.truth
    assert [str(m) for _, m in often.said] == [str(m) for _, m in seldom.said]
