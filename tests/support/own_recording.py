"""A short recording of a fake vehicle that is taken from its mission and given back, as a telemetry log."""

import math
import struct
from collections.abc import Iterator
from pathlib import Path

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Encoder, Message, mavlink
from sim.scenario import Autopilot
from sim.vehicle import FakeArduPlane, takeoff_item, waypoint_item
from sim.vehicle.vehicle import FakeVehicle
from sim.world import kind_of

HOME = GeoPoint(46.5, 7.5, 560.0)
_FRAME = LocalFrame(HOME.lat_deg, HOME.lon_deg)
_START_S, _STEP_S = 1_750_000_000.0, 0.05
_TAKEN_S, _TURN_S, _GIVEN_BACK_S, _END_S = 30.0, 31.0, 70.0, 150.0
_HEIGHT_M, _CLIMB_M, _COURSE_DEG = 250.0, 60.0, 50.0
_COMPANION = (1, 196)
_INTERVALS_S = {
    "GLOBAL_POSITION_INT": 0.1,
    "ATTITUDE": 0.1,
    "VFR_HUD": 0.2,
    "MISSION_CURRENT": 1.0,
    "HOME_POSITION": 10.0,
}
_POSITION_VELOCITY, _VELOCITY_ONLY = 3520, 3527


def write_recording(path: Path, autopilot: Autopilot) -> Path:
    """Fly 150 s of AUTO, GUIDED and AUTO, or of MISSION, OFFBOARD and MISSION; returns the log's path."""
    kind, options = kind_of(autopilot)
    vehicle = kind.airborne(
        HOME,
        _START_S,
        position=_FRAME.to_geo(0.0, 0.0, -(HOME.altitude_m + _HEIGHT_M)),
        course_rad=0.0,
        sequence=kind.first_item + 1,
        mission=[takeoff_item(60.0), waypoint_item(_FRAME.to_geo(20_000.0, 0.0, -(HOME.altitude_m + 250.0)))],
        **options,
    )
    vehicle.add_channel(0, stream_rate_hz=0.0)
    encoder = Encoder()
    with path.open("wb") as log:
        for number in range(round(_END_S / _STEP_S)):
            now_s = _START_S + number * _STEP_S
            for message in _companion(vehicle, number * _STEP_S):
                raw = encoder.encode(message, *_COMPANION)
                vehicle.receive(message, now_s, 0)
                log.write(struct.pack(">Q", round(now_s * 1e6)) + raw)
            for out in vehicle.step(now_s + _STEP_S):
                raw = encoder.encode(out.message, vehicle.system_id, vehicle.component_id)
                log.write(struct.pack(">Q", round((now_s + _STEP_S) * 1e6)) + raw)
    return path


def _companion(vehicle: FakeVehicle, time_s: float) -> Iterator[Message]:
    """What a companion sends at a time since the start."""
    if time_s == 0.0:
        yield from _questions(vehicle)
        return
    tick = round(time_s / _STEP_S)
    ardupilot = isinstance(vehicle, FakeArduPlane)
    if tick == round(_TAKEN_S / _STEP_S):
        yield _command(mavlink.MAV_CMD_DO_SET_MODE, 1, *((15,) if ardupilot else (6, 0)))
    elif tick == round(_GIVEN_BACK_S / _STEP_S):
        yield _command(mavlink.MAV_CMD_DO_SET_MODE, 1, *((10,) if ardupilot else (4, 4)))
    elif ardupilot and tick == round(_TURN_S / _STEP_S):
        yield _guided(mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, 0.0, _COURSE_DEG, 5.0)
        yield _guided(mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE, z_m=HOME.altitude_m + _HEIGHT_M + _CLIMB_M)
        yield _guided(mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, 0.0, 26.0, 1.0)
    elif not ardupilot and tick % 2 == 0 and _TAKEN_S - 0.6 <= time_s < _GIVEN_BACK_S:
        yield _setpoint(vehicle, straight=time_s < _TURN_S)


def _questions(vehicle: FakeVehicle) -> Iterator[Message]:
    for name, interval_s in _INTERVALS_S.items():
        message_id = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
        yield _command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_s * 1e6)
    yield _command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    yield mavlink.MAVLink_mission_request_list_message(1, 1)
    for sequence in range(len(vehicle.flight.mission.items)):
        yield mavlink.MAVLink_mission_request_int_message(1, 1, sequence)


def _command(command: int, *params: float) -> Message:
    padded = (*params, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[:7]
    return mavlink.MAVLink_command_long_message(1, 1, command, 0, *padded)


def _guided(command: int, *params: float, z_m: float = 0.0) -> Message:
    padded = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return mavlink.MAVLink_command_int_message(1, 1, 0, command, 0, 0, *padded, 0, 0, z_m)


def _setpoint(vehicle: FakeVehicle, *, straight: bool) -> Message:
    """First velocity only at the present height, then the line through here along the course."""
    place, course_rad = vehicle.flight.place, 0.0 if straight else math.radians(_COURSE_DEG)
    height_m = place.altitude_m if straight else HOME.altitude_m + _HEIGHT_M + _CLIMB_M
    return mavlink.MAVLink_set_position_target_global_int_message(
        time_boot_ms=0,
        target_system=1,
        target_component=1,
        coordinate_frame=mavlink.MAV_FRAME_GLOBAL_INT,
        type_mask=_VELOCITY_ONLY if straight else _POSITION_VELOCITY,
        lat_int=round(place.lat_deg * 1e7),
        lon_int=round(place.lon_deg * 1e7),
        alt=height_m,
        vx=14.0 * math.cos(course_rad),
        vy=14.0 * math.sin(course_rad),
        vz=0.0,
        afx=0.0,
        afy=0.0,
        afz=0.0,
        yaw=0.0,
        yaw_rate=0.0,
    )
