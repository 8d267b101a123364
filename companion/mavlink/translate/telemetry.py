"""Telemetry: messages of an autopilot about its aircraft, its flight and itself."""

import math

from companion.mavlink.dialect import AVAILABLE_MODES, Message, mavlink
from companion.mavlink.facts import (
    AirData,
    AirspeedSensor,
    AttitudeTarget,
    AutopilotVersion,
    AvailableMode,
    Fact,
    GeoidSeparation,
    Heartbeat,
    LandedState,
    NavigationTarget,
    OwnPosition,
    PressureAltitude,
    RcChannels,
    Sender,
    SystemTime,
    TimeSync,
    Wind,
)
from companion.mavlink.translate.wire import Translation, angle_rad, is_altitude, position_deg
from companion.model import Role

_MAX_AIRSPEED_MPS = 200.0
_MAX_ALTITUDE_M = 20_000.0
_SEA_LEVEL_HPA = 1_013.25
_MIN_PRESSURE_HPA, _MAX_PRESSURE_HPA = 230.0, 1_100.0  # 11 km, and below the Dead Sea
# The geoid lies 106 m below the ellipsoid south of India and 85 m above it in New Guinea (EGM96).
_MAX_GEOID_SEPARATION_M = 120.0
_LARGEST_ROLE = max(Role)
_DIFFERENTIAL_PRESSURE = mavlink.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
_NO_PULSE = (0, 65_535)
_CHANNELS = tuple(f"chan{number}_raw" for number in range(1, 19))
_YEAR_2015_S = 1_420_070_400.0  # a clock that shows an earlier time was never set
_NOT_SELECTABLE = 2  # MAV_MODE_PROPERTY_NOT_USER_SELECTABLE
_RELEASES = {0: "dev", 64: "alpha", 128: "beta", 192: "rc", 255: ""}


def _heartbeat(message: Message, sender: Sender, _received_s: float) -> Fact:
    return Heartbeat(
        sender=sender,
        vehicle_type=message.type,
        autopilot=message.autopilot,
        armed=bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        custom_mode=message.custom_mode,
        system_status=message.system_status,
        is_companion=_is_companion(message),
    )


def _is_companion(message: Message) -> bool:
    """Whether an onboard controller sends its role as a custom mode, as our own heartbeat does."""
    onboard = message.type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER
    without_autopilot = message.autopilot == mavlink.MAV_AUTOPILOT_INVALID
    custom = message.base_mode == mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return bool(onboard and without_autopilot and custom and message.custom_mode <= _LARGEST_ROLE)


def _own_position(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`vz` is positive down; without a fix autopilots send 0, 0."""
    position = position_deg(message.lat, message.lon)
    if position is None:
        return None
    return OwnPosition(
        sender=sender,
        boot_time_s=message.time_boot_ms / 1000.0,
        lat_deg=position[0],
        lon_deg=position[1],
        altitude_m=message.alt / 1000.0,
        height_above_home_m=message.relative_alt / 1000.0,
        velocity_mps=(message.vx / 100.0, message.vy / 100.0, message.vz / 100.0),
        heading_rad=angle_rad(message.hdg),
    )


def _landed_state(message: Message, sender: Sender, _received_s: float) -> Fact:
    landed, vtol = message.landed_state, message.vtol_state
    landed_known = mavlink.MAV_LANDED_STATE_UNDEFINED < landed < mavlink.MAV_LANDED_STATE_ENUM_END
    vtol_known = mavlink.MAV_VTOL_STATE_UNDEFINED < vtol < mavlink.MAV_VTOL_STATE_ENUM_END
    return LandedState(sender, landed if landed_known else None, vtol if vtol_known else None)


def _navigation_target(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """The altitude is above mean sea level in the frames GLOBAL and GLOBAL_INT only."""
    if message.type_mask & (
        mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    ):
        return None
    position = position_deg(message.lat_int, message.lon_int)
    if position is None:
        return None
    absolute = message.coordinate_frame in (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
    ignored = message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
    given = absolute and not ignored and is_altitude(message.alt)
    return NavigationTarget(sender, position[0], position[1], message.alt if given else None)


def _air_data(message: Message, sender: Sender, _received_s: float) -> Fact:
    airspeed_mps = message.airspeed
    measured = 0.0 <= airspeed_mps <= _MAX_AIRSPEED_MPS  # false for NaN too
    altitude_m = message.alt if abs(message.alt) <= _MAX_ALTITUDE_M else None
    return AirData(sender, airspeed_mps if measured else None, altitude_m)


def _airspeed_sensor(message: Message, sender: Sender, _received_s: float) -> Fact:
    """Without a usable sensor both autopilots put an estimate, 0 or NaN into VFR_HUD instead."""
    masks = (
        message.onboard_control_sensors_present,
        message.onboard_control_sensors_enabled,
        message.onboard_control_sensors_health,
    )
    return AirspeedSensor(sender, all(mask & _DIFFERENTIAL_PRESSURE for mask in masks))


def _wind(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`direction` is the direction that the wind comes from [deg]."""
    if not (math.isfinite(message.direction) and math.isfinite(message.speed)):
        return None
    from_rad = math.radians(message.direction)
    return Wind(sender, -message.speed * math.cos(from_rad), -message.speed * math.sin(from_rad))


def _wind_cov(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`wind_x` and `wind_y` are the velocity of the air (north, east) [m/s], NaN when unknown."""
    if not (math.isfinite(message.wind_x) and math.isfinite(message.wind_y)):
        return None
    return Wind(sender, message.wind_x, message.wind_y)


def _pressure_altitude(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """The standard atmosphere (ICAO Doc 7488) below 11 km: h = T0 / L (1 - (p / p0)^(L R / g))."""
    if not _MIN_PRESSURE_HPA <= message.press_abs <= _MAX_PRESSURE_HPA:
        return None
    ratio = message.press_abs / _SEA_LEVEL_HPA
    return PressureAltitude(sender, 44_330.77 * (1.0 - ratio**0.190_263))


def _geoid_separation(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`alt_ellipsoid` is 0 if the receiver, or an older autopilot, does not have it."""
    if message.alt_ellipsoid == 0 or message.fix_type < mavlink.GPS_FIX_TYPE_3D_FIX:
        return None
    separation_m = (message.alt_ellipsoid - message.alt) / 1000.0
    return GeoidSeparation(sender, separation_m) if abs(separation_m) <= _MAX_GEOID_SEPARATION_M else None


def _rc_channels(message: Message, sender: Sender, _received_s: float) -> Fact:
    pulses = (getattr(message, name) for name in _CHANNELS[: message.chancount])
    return RcChannels(sender, tuple(None if pulse in _NO_PULSE else pulse for pulse in pulses))


def _attitude_target(message: Message, sender: Sender, _received_s: float) -> Fact:
    return AttitudeTarget(sender, all(math.isfinite(part) for part in message.q))


def _system_time(message: Message, sender: Sender, _received_s: float) -> Fact:
    unix_s = message.time_unix_usec / 1e6
    return SystemTime(sender, unix_s if unix_s > _YEAR_2015_S else None)


def _time_sync(message: Message, sender: Sender, _received_s: float) -> Fact:
    return TimeSync(sender, message.tc1, message.ts1)


def _autopilot_version(message: Message, sender: Sender, _received_s: float) -> Fact:
    number = message.flight_sw_version
    release = _RELEASES.get(number & 0xFF, "")
    major, minor = number >> 24 & 0xFF, number >> 16 & 0xFF
    version = f"{major}.{minor}.{number >> 8 & 0xFF}{release}"
    return AutopilotVersion(sender, version, major, minor, message.capabilities)


def _available_mode(message: Message, sender: Sender, _received_s: float) -> Fact:
    selectable = not message.properties & _NOT_SELECTABLE
    return AvailableMode(
        sender, message.custom_mode, message.mode_index, message.number_modes, selectable=selectable
    )


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: _heartbeat,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: _time_sync,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _own_position,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _landed_state,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: _navigation_target,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _air_data,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: _airspeed_sensor,
    mavlink.MAVLINK_MSG_ID_WIND: _wind,
    mavlink.MAVLINK_MSG_ID_WIND_COV: _wind_cov,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: _pressure_altitude,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: _geoid_separation,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: _rc_channels,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: _attitude_target,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: _autopilot_version,
    AVAILABLE_MODES: _available_mode,
}
