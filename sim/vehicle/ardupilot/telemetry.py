"""ArduPlane's telemetry: its own messages, default streams and stream groups."""

import math

from companion.geodesy import wrap_pi
from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.ardupilot.flight import ArduPlaneFlight
from sim.vehicle.ardupilot.modes import base_mode
from sim.vehicle.ardupilot.parameters import Firmware
from sim.vehicle.telemetry import Builder, Telemetry

_EXTENDED_STATUS = (
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
)
_POSITION = (mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
_RC_CHANNELS = (mavlink.MAVLINK_MSG_ID_RC_CHANNELS,)
_EXTRA_1 = (mavlink.MAVLINK_MSG_ID_ATTITUDE,)
_EXTRA_2 = (mavlink.MAVLINK_MSG_ID_VFR_HUD,)
_EXTRA_3 = (
    mavlink.MAVLINK_MSG_ID_WIND,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
)
_SENSORS = (mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,)

DEFAULT_STREAM = (*_EXTENDED_STATUS, *_POSITION, *_EXTRA_1, *_EXTRA_2, *_EXTRA_3, *_SENSORS, *_RC_CHANNELS)
STREAM_GROUPS: dict[int, tuple[int, ...]] = {  # of REQUEST_DATA_STREAM
    mavlink.MAV_DATA_STREAM_ALL: DEFAULT_STREAM,
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: _SENSORS,
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: _EXTENDED_STATUS,
    mavlink.MAV_DATA_STREAM_POSITION: _POSITION,
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: _RC_CHANNELS,
    mavlink.MAV_DATA_STREAM_EXTRA1: _EXTRA_1,
    mavlink.MAV_DATA_STREAM_EXTRA2: _EXTRA_2,
    mavlink.MAV_DATA_STREAM_EXTRA3: _EXTRA_3,
}

_POSITION_ONLY = 65016  # POSITION_TARGET_GLOBAL_INT.type_mask as recorded
_UINT16_MAX = 65535
_VERSIONS: dict[Firmware, int] = {"4.7": 4 << 24 | 7 << 16, "4.3": 4 << 24 | 3 << 16 | 255}


class ArduPlaneTelemetry(Telemetry):
    """Builds the messages of a fake ArduPlane."""

    autopilot = 3
    # Float parameters, int missions, COMMAND_INT, targets, MAVLink 2, fences
    capabilities = 2 | 4 | 8 | 256 | 4096 | 8192 | 16384
    sensors = 325188671
    sensors_healthy = 322042943

    def __init__(
        self, flight: ArduPlaneFlight, boot_s: float, firmware: Firmware, geoid_height_m: float
    ) -> None:
        """`firmware` is the version in AUTOPILOT_VERSION."""
        super().__init__(flight, boot_s, geoid_height_m, (_VERSIONS[firmware], 0))
        self._flight: ArduPlaneFlight = flight

    def _base_mode(self) -> int:
        return base_mode(self._flight.mode, armed=self._flight.armed)

    def wind(self, _time_s: float) -> Message:
        """WIND: `direction` is the direction that the wind comes from."""
        north_mps, east_mps = self._flight.aircraft.wind_mps
        return mavlink.MAVLink_wind_message(
            direction=math.degrees(math.atan2(-east_mps, -north_mps)),
            speed=math.hypot(north_mps, east_mps),
            speed_z=0.0,
        )

    def nav_controller_output(self, _time_s: float) -> Message:
        """NAV_CONTROLLER_OUTPUT."""
        flight = self._flight
        aircraft = flight.aircraft
        north_m = east_m = 0.0
        if flight.target is not None:
            target_m = flight.frame.to_ned_m(flight.target)
            north_m, east_m = target_m[0] - aircraft.north_m, target_m[1] - aircraft.east_m
        bearing_deg = round(math.degrees(math.atan2(east_m, north_m)))
        return mavlink.MAVLink_nav_controller_output_message(
            nav_roll=math.degrees(aircraft.bank_rad),
            nav_pitch=math.degrees(self.pitch_rad()),
            nav_bearing=round(math.degrees(wrap_pi(aircraft.course_rad))),
            target_bearing=bearing_deg,
            wp_dist=min(round(math.hypot(north_m, east_m)), _UINT16_MAX),
            alt_error=flight.wanted_altitude_m - aircraft.altitude_m,
            aspd_error=aircraft.airspeed_command_mps - aircraft.airspeed_mps,
            xtrack_error=0.0,
        )

    def position_target_global_int(self, time_s: float) -> Message:
        """POSITION_TARGET_GLOBAL_INT: the present target, height above mean sea level."""
        target = self._flight.target or self._flight.place
        return mavlink.MAVLink_position_target_global_int_message(
            time_boot_ms=self.boot_ms(time_s),
            coordinate_frame=0,
            type_mask=_POSITION_ONLY,
            lat_int=round(target.lat_deg * 1e7),
            lon_int=round(target.lon_deg * 1e7),
            alt=self._flight.wanted_altitude_m,
            vx=0.0,
            vy=0.0,
            vz=0.0,
            afx=0.0,
            afy=0.0,
            afz=0.0,
            yaw=0.0,
            yaw_rate=0.0,
        )

    def _all_builders(self) -> dict[int, Builder]:
        return {
            **super()._all_builders(),
            mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: self.nav_controller_output,
            mavlink.MAVLINK_MSG_ID_WIND: self.wind,
            mavlink.MAVLINK_MSG_ID_FENCE_STATUS: self.fence_status,
        }
