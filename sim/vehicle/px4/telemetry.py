"""PX4's telemetry: its own messages and default stream."""

import math

from companion.mavlink.dialect import AvailableModesMessage, Message, mavlink
from sim.vehicle.px4.flight import Px4Flight
from sim.vehicle.px4.modes import Firmware, base_mode, modes_of
from sim.vehicle.telemetry import Builder, Telemetry

_VERSIONS: dict[Firmware, int] = {"1.16": 1 << 24 | 16 << 16 | 255, "1.18": 1 << 24 | 18 << 16 | 64}
_POSITION_ONLY = 3576
_RATES_IGNORED = 7

DEFAULT_STREAM = (
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_VFR_HUD,
    mavlink.MAVLINK_MSG_ID_WIND_COV,
)


class Px4Telemetry(Telemetry):
    """Builds the messages of a fake PX4."""

    autopilot = 12
    # Int missions, COMMAND_INT, parameters bytewise, local and global targets, MAVLink 2, fences
    capabilities = 4 | 8 | 16 | 128 | 256 | 8192 | 16384
    sensors = 0x0120_001F
    sensors_healthy = 0x0120_001F
    uid = 0x4954_414C_4449_4E4F  # that of PX4's own simulation

    def __init__(
        self, flight: Px4Flight, boot_s: float, geoid_height_m: float, firmware: Firmware = "1.16"
    ) -> None:
        version = _VERSIONS[firmware]
        super().__init__(flight, boot_s, geoid_height_m, (version, version))
        self._flight: Px4Flight = flight

    def _base_mode(self) -> int:
        return base_mode(self._flight.mode, armed=self._flight.armed)

    def available_modes(self) -> list[Message]:
        """AVAILABLE_MODES of all modes; none before 1.18, where it depends on the build."""
        if self._flight.firmware != "1.18":
            return []
        modes = modes_of(self._flight.firmware)
        return [
            AvailableModesMessage(len(modes), index, 0, int(mode), 0, mode.name.encode("ascii"))
            for index, mode in enumerate(modes, 1)
        ]

    def attitude_target(self, time_s: float) -> Message:
        """ATTITUDE_TARGET: NaN while the setpoint is invalid; no other message shows that."""
        flight = self._flight
        attitude = _quaternion(flight.aircraft.bank_rad, self.pitch_rad(), flight.aircraft.heading_rad)
        return mavlink.MAVLink_attitude_target_message(
            time_boot_ms=self.boot_ms(time_s),
            type_mask=_RATES_IGNORED,
            q=[math.nan] * 4 if flight.offboard.setpoint_invalid else attitude,
            body_roll_rate=0.0,
            body_pitch_rate=0.0,
            body_yaw_rate=0.0,
            thrust=self.throttle_percent() / 100.0,
        )

    def wind_cov(self, time_s: float) -> Message:
        """WIND_COV: `wind_x`, `wind_y` are the velocity of the air, north and east."""
        north_mps, east_mps = self._flight.aircraft.wind_mps
        return mavlink.MAVLink_wind_cov_message(
            time_usec=self.boot_ms(time_s) * 1000,
            wind_x=north_mps,
            wind_y=east_mps,
            wind_z=0.0,
            var_horiz=0.25,
            var_vert=0.25,
            wind_alt=self._flight.aircraft.altitude_m,
            horiz_accuracy=math.nan,
            vert_accuracy=math.nan,
        )

    def position_target_global_int(self, time_s: float) -> Message:
        """POSITION_TARGET_GLOBAL_INT: the present target, height above mean sea level."""
        target = self._flight.target or self._flight.place
        return mavlink.MAVLink_position_target_global_int_message(
            time_boot_ms=self.boot_ms(time_s),
            coordinate_frame=mavlink.MAV_FRAME_GLOBAL_INT,
            type_mask=_POSITION_ONLY,
            lat_int=round(target.lat_deg * 1e7),
            lon_int=round(target.lon_deg * 1e7),
            alt=target.altitude_m,
            vx=math.nan,
            vy=math.nan,
            vz=math.nan,
            afx=math.nan,
            afy=math.nan,
            afz=math.nan,
            yaw=math.nan,
            yaw_rate=math.nan,
        )

    def _all_builders(self) -> dict[int, Builder]:
        return {
            **super()._all_builders(),
            mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: self.attitude_target,
            mavlink.MAVLINK_MSG_ID_WIND_COV: self.wind_cov,
        }


def _quaternion(roll_rad: float, pitch_rad: float, yaw_rad: float) -> list[float]:
    """Quaternion w, x, y, z of the rotation yaw, then pitch, then roll."""
    cr, sr = math.cos(roll_rad / 2.0), math.sin(roll_rad / 2.0)
    cp, sp = math.cos(pitch_rad / 2.0), math.sin(pitch_rad / 2.0)
    cy, sy = math.cos(yaw_rad / 2.0), math.sin(yaw_rad / 2.0)
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
