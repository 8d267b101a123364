"""PX4's interpretation of SET_POSITION_TARGET_* as a fixed wing: flown, frozen, or invalid."""

import math
from dataclasses import dataclass
from enum import Enum, auto

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.model import Vec2
from sim.dynamics import FixedWing
from sim.vehicle.navigation import circle
from sim.vehicle.px4.path import OFFBOARD_TIME_S, course_to_line_rad

_LOCAL_FRAMES = frozenset({mavlink.MAV_FRAME_LOCAL_NED})
_BODY_FRAMES = frozenset({mavlink.MAV_FRAME_BODY_NED})
_ABSOLUTE_FRAME, _RELATIVE_FRAME = mavlink.MAV_FRAME_GLOBAL_INT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
_GLOBAL_FRAMES = frozenset({_ABSOLUTE_FRAME, _RELATIVE_FRAME})

# type_mask: a set bit means that the field is ignored
_X, _Y, _Z, _VX, _VY, _VZ, _AX, _AY, _AZ = (1 << bit for bit in range(9))


class Kind(Enum):
    """The effect of a setpoint on the aircraft."""

    LINE = auto()  # position + velocity: follows the line through the position
    CURVE = auto()  # position + velocity + acceleration: turns without end
    PLACE = auto()  # position: flies there and circles
    FROZEN = auto()  # velocity: keeps attitude and thrust
    INVALID = auto()  # makes the attitude setpoint NaN


ALONG_A_LINE = frozenset({Kind.LINE, Kind.CURVE})


@dataclass(frozen=True, slots=True)
class Setpoint:
    """A setpoint that PX4 accepts. Positions are north and east from home; unused fields are 0."""

    kind: Kind
    received_s: float
    place_m: Vec2 = (0.0, 0.0)
    altitude_m: float = 0.0
    course_rad: float = 0.0
    lateral_mps2: float = 0.0

    def fly(self, aircraft: FixedWing, loiter_radius_m: float) -> None:
        """Command the aircraft; FROZEN and INVALID command nothing."""
        if self.kind in (Kind.FROZEN, Kind.INVALID):
            return
        aircraft.hold_altitude(self.altitude_m)
        if self.kind is Kind.LINE:
            course_rad = course_to_line_rad(aircraft, self.place_m, self.course_rad, OFFBOARD_TIME_S)
            aircraft.hold_course(course_rad)
        elif self.kind is Kind.CURVE:
            aircraft.hold_bank(math.atan(self.lateral_mps2 / 9.80665))
        else:
            circle(aircraft, self.place_m, loiter_radius_m)


def setpoint_from(
    message: Message, received_s: float, frame: LocalFrame, home_altitude_m: float
) -> Setpoint | None:
    """The setpoint in either message; None for a rejected frame or without any valid field."""
    mask = message.type_mask
    velocity = (_given(message.vx, mask, _VX), _given(message.vy, mask, _VY))
    if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
        if message.coordinate_frame in _BODY_FRAMES:
            return Setpoint(Kind.FROZEN, received_s) if None not in velocity else None
        if message.coordinate_frame not in _LOCAL_FRAMES:
            return None
        north_m, east_m, down_m = message.x, message.y, message.z - home_altitude_m
    else:
        if message.coordinate_frame not in _GLOBAL_FRAMES or abs(message.lat_int) > 900_000_000:
            return None
        relative = message.coordinate_frame == _RELATIVE_FRAME
        altitude_m = message.alt + (home_altitude_m if relative else 0.0)
        place = GeoPoint(message.lat_int / 1e7, message.lon_int / 1e7, altitude_m)
        north_m, east_m, down_m = frame.to_ned_m(place)
    position = (_given(north_m, mask, _X), _given(east_m, mask, _Y), _given(down_m, mask, _Z))
    acceleration = (_given(message.afx, mask, _AX), _given(message.afy, mask, _AY))
    climb = _given(message.vz, mask, _VZ)
    if all(field is None for field in (*position, *velocity, climb, *acceleration)):
        return None
    return _interpreted(received_s, position, velocity, acceleration)


def _interpreted(
    received_s: float,
    position: tuple[float | None, float | None, float | None],
    velocity: tuple[float | None, float | None],
    acceleration: tuple[float | None, float | None],
) -> Setpoint:
    north_m, east_m, down_m = position
    vx_mps, vy_mps = velocity
    moving = bool(vx_mps or vy_mps) and vx_mps is not None and vy_mps is not None
    if all(field is None for field in position):
        return Setpoint(Kind.FROZEN if moving else Kind.INVALID, received_s)
    if north_m is None or east_m is None or down_m is None:
        return Setpoint(Kind.INVALID, received_s)
    place_m = (north_m, east_m)
    if vx_mps is None and vy_mps is None:
        return Setpoint(Kind.PLACE, received_s, place_m, -down_m)
    if not moving or vx_mps is None or vy_mps is None:
        return Setpoint(Kind.INVALID, received_s)
    course_rad = math.atan2(vy_mps, vx_mps)
    ax_mps2, ay_mps2 = acceleration
    # The sign differs between PX4 versions; here an acceleration to the right turns right.
    lateral_mps2 = (ay_mps2 or 0.0) * math.cos(course_rad) - (ax_mps2 or 0.0) * math.sin(course_rad)
    kind = Kind.CURVE if abs(lateral_mps2) > 1e-3 else Kind.LINE
    return Setpoint(kind, received_s, place_m, -down_m, course_rad, lateral_mps2)


def _given(value: float, mask: int, bit: int) -> float | None:
    """The field, None if it is masked or not finite."""
    return None if mask & bit or not math.isfinite(value) else float(value)
