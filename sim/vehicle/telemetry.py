"""The telemetry messages that both fake autopilots fill in the same way."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Literal

from companion.geodesy import course_deg, wrap_pi
from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.flight import Flight
from sim.vehicle.peripherals import Battery

_FIXED_WING = 1  # MAV_TYPE
_STANDBY, _ACTIVE, _CRITICAL = 3, 4, 5
_ON_GROUND, _IN_AIR, _TAKING_OFF, _LANDING = 1, 2, 3, 4
_NO_MISSION, _NOT_STARTED, _MISSION_ACTIVE, _MISSION_PAUSED, _MISSION_COMPLETE = 1, 2, 3, 4, 5
_MISSION_MODE_ACTIVE, _MISSION_MODE_SUSPENDED = 1, 2
_UINT16_MAX = 65535
_TEMPERATURE_UNKNOWN = 32767
_FENCE_BOUNDARY = 3
_RSSI_UNKNOWN = 255

_DIFFERENTIAL_PRESSURE = mavlink.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE

Builder = Callable[[float], Message]
# "fitted", or what an autopilot without a sensor puts into VFR_HUD: 0, NaN, ground speed, an estimate.
AirspeedSensor = Literal["fitted", "zero", "nan", "ground speed", "estimate"]


class Telemetry(ABC):
    """Builds the messages about one flight, and drains its battery."""

    autopilot: ClassVar[int]  # MAV_AUTOPILOT
    capabilities: ClassVar[int]  # AUTOPILOT_VERSION: MAV_PROTOCOL_CAPABILITY
    # SYS_STATUS: sensors present, and healthy
    sensors = 0
    sensors_healthy = 0
    uid = 1  # AUTOPILOT_VERSION

    def __init__(
        self, flight: Flight, boot_s: float, geoid_height_m: float, versions: tuple[int, int]
    ) -> None:
        """`geoid_height_m`: mean sea level above the ellipsoid at the flight area.

        `versions` are those of flight software and middleware in AUTOPILOT_VERSION.
        """
        self._versions = versions
        self._flight = flight
        self._boot_s = boot_s
        self._geoid_height_m = geoid_height_m
        self.clock_error_s = 0.0  # error of the Unix time in SYSTEM_TIME
        # What VFR_HUD and SYS_STATUS show of the airspeed.
        self.airspeed_sensor: AirspeedSensor = "fitted"
        self.vtol_state = 0  # MAV_VTOL_STATE in EXTENDED_SYS_STATE; 0 for an aircraft without rotors
        self._battery = Battery()
        self._builders = self._all_builders()

    @abstractmethod
    def _base_mode(self) -> int:
        """HEARTBEAT.base_mode."""

    @abstractmethod
    def position_target_global_int(self, time_s: float) -> Message:
        """POSITION_TARGET_GLOBAL_INT: the present target."""

    def heartbeat(self, _time_s: float) -> Message:
        """HEARTBEAT."""
        return mavlink.MAVLink_heartbeat_message(
            type=_FIXED_WING,
            autopilot=self.autopilot,
            base_mode=self._base_mode(),
            custom_mode=int(self._flight.mode),
            system_status=self.system_status,
            mavlink_version=3,
        )

    def autopilot_version(self, _time_s: float) -> Message:
        """AUTOPILOT_VERSION: the imitated version."""
        flight_version, middleware_version = self._versions
        return mavlink.MAVLink_autopilot_version_message(
            capabilities=self.capabilities,
            flight_sw_version=flight_version,
            middleware_sw_version=middleware_version,
            os_sw_version=0,
            board_version=0,
            flight_custom_version=[0] * 8,
            middleware_custom_version=[0] * 8,
            os_custom_version=[0] * 8,
            vendor_id=0,
            product_id=0,
            uid=self.uid,
        )

    @property
    def built(self) -> frozenset[int]:
        """The ids of the messages that `build` can build."""
        return frozenset(self._builders)

    def reboot(self, now_s: float) -> None:
        """Restart the boot time."""
        self._boot_s = now_s

    def consume(self, seconds: float) -> None:
        """Drain the battery for some seconds."""
        flight = self._flight
        self._battery.drain(seconds, armed=flight.armed, full_throttle=flight.taking_off)

    def build(self, message_id: int, time_s: float) -> Message | None:
        """The message with that id at `time_s`, None for an unknown id."""
        builder = self._builders.get(message_id)
        return builder(time_s) if builder is not None else None

    def boot_ms(self, time_s: float) -> int:
        """Milliseconds since boot, as in `time_boot_ms`."""
        return round((time_s - self._boot_s) * 1000.0) & 0xFFFF_FFFF

    @property
    def system_status(self) -> int:
        """HEARTBEAT.system_status (MAV_STATE)."""
        if self._flight.reports_failsafe:
            return _CRITICAL
        return _STANDBY if self._flight.on_ground else _ACTIVE

    def global_position_int(self, time_s: float) -> Message:
        """GLOBAL_POSITION_INT: `vz` positive down, `hdg` is the heading."""
        flight = self._flight
        place = flight.place
        north_mps, east_mps, down_mps = flight.velocity_mps
        return mavlink.MAVLink_global_position_int_message(
            time_boot_ms=self.boot_ms(time_s),
            lat=round(place.lat_deg * 1e7),
            lon=round(place.lon_deg * 1e7),
            alt=round(place.altitude_m * 1000.0),
            relative_alt=round((place.altitude_m - flight.home.altitude_m) * 1000.0),
            vx=round(north_mps * 100.0),
            vy=round(east_mps * 100.0),
            vz=round(down_mps * 100.0),
            hdg=_centidegrees(flight.aircraft.heading_rad),
        )

    def local_position_ned(self, time_s: float) -> Message:
        """LOCAL_POSITION_NED, from home."""
        flight = self._flight
        north_m, east_m, down_m = flight.aircraft.position_m
        north_mps, east_mps, down_mps = flight.velocity_mps
        return mavlink.MAVLink_local_position_ned_message(
            time_boot_ms=self.boot_ms(time_s),
            x=north_m,
            y=east_m,
            z=down_m + flight.home.altitude_m,
            vx=north_mps,
            vy=east_mps,
            vz=down_mps,
        )

    def attitude(self, time_s: float) -> Message:
        """ATTITUDE."""
        aircraft = self._flight.aircraft
        return mavlink.MAVLink_attitude_message(
            time_boot_ms=self.boot_ms(time_s),
            roll=aircraft.bank_rad,
            pitch=self.pitch_rad(),
            yaw=wrap_pi(aircraft.heading_rad),
            rollspeed=0.0,
            pitchspeed=0.0,
            yawspeed=0.0 if self._flight.on_ground else aircraft.turn_rate_rps,
        )

    def vfr_hud(self, _time_s: float) -> Message:
        """VFR_HUD."""
        flight = self._flight
        return mavlink.MAVLink_vfr_hud_message(
            airspeed=self._shown_airspeed_mps(),
            groundspeed=flight.ground_speed_mps,
            heading=int(course_deg(flight.aircraft.heading_rad)),
            throttle=self.throttle_percent(),
            alt=flight.aircraft.altitude_m,
            climb=flight.aircraft.climb_mps,
        )

    def _shown_airspeed_mps(self) -> float:
        substitutes = {"zero": 0.0, "nan": math.nan, "ground speed": self._flight.ground_speed_mps}
        return substitutes.get(self.airspeed_sensor, self._flight.aircraft.airspeed_mps)

    def sys_status(self, _time_s: float) -> Message:
        """SYS_STATUS."""
        missing = 0 if self.airspeed_sensor == "fitted" else _DIFFERENTIAL_PRESSURE
        return mavlink.MAVLink_sys_status_message(
            onboard_control_sensors_present=self.sensors & ~missing,
            onboard_control_sensors_enabled=self.sensors & ~missing,
            onboard_control_sensors_health=self.sensors_healthy & ~missing,
            load=0,
            voltage_battery=self._battery.voltage_mv,
            current_battery=self._battery.current_ca,
            battery_remaining=round(self._battery.remaining * 100.0),
            drop_rate_comm=0,
            errors_comm=0,
            errors_count1=0,
            errors_count2=0,
            errors_count3=0,
            errors_count4=0,
        )

    def battery_status(self, _time_s: float) -> Message:
        """BATTERY_STATUS: one pack, no cell voltages."""
        return mavlink.MAVLink_battery_status_message(
            id=0,
            battery_function=0,
            type=0,
            temperature=_TEMPERATURE_UNKNOWN,
            voltages=[self._battery.voltage_mv] + [_UINT16_MAX] * 9,
            current_battery=self._battery.current_ca,
            current_consumed=round(self._battery.consumed_mah),
            energy_consumed=round(self._battery.consumed_mah * 0.44),
            battery_remaining=round(self._battery.remaining * 100.0),
            time_remaining=0,
            charge_state=1,
        )

    def gps_raw_int(self, time_s: float) -> Message:
        """GPS_RAW_INT."""
        flight = self._flight
        place = flight.place
        return mavlink.MAVLink_gps_raw_int_message(
            time_usec=self.boot_ms(time_s) * 1000,
            fix_type=6,
            lat=round(place.lat_deg * 1e7),
            lon=round(place.lon_deg * 1e7),
            alt=round(place.altitude_m * 1000.0),
            eph=121,
            epv=200,
            vel=min(round(flight.ground_speed_mps * 100.0), _UINT16_MAX),
            cog=_centidegrees(flight.aircraft.course_rad),
            satellites_visible=10,
            alt_ellipsoid=round((place.altitude_m + self._geoid_height_m) * 1000.0),
            h_acc=300,
            v_acc=300,
        )

    def system_time(self, time_s: float) -> Message:
        """SYSTEM_TIME."""
        return mavlink.MAVLink_system_time_message(
            time_unix_usec=round((time_s + self.clock_error_s) * 1e6), time_boot_ms=self.boot_ms(time_s)
        )

    def home_position(self, time_s: float) -> Message:
        """HOME_POSITION."""
        home = self._flight.home
        return mavlink.MAVLink_home_position_message(
            latitude=round(home.lat_deg * 1e7),
            longitude=round(home.lon_deg * 1e7),
            altitude=round(home.altitude_m * 1000.0),
            x=0.0,
            y=0.0,
            z=0.0,
            q=[math.nan] * 4,
            approach_x=0.0,
            approach_y=0.0,
            approach_z=0.0,
            time_usec=self.boot_ms(time_s) * 1000,
        )

    def mission_current(self, _time_s: float) -> Message:
        """MISSION_CURRENT: `total` does not count home."""
        flight = self._flight
        mission = flight.mission
        if not mission.items:
            state = _NO_MISSION
        elif mission.completed and mission.active is None:
            state = _MISSION_COMPLETE
        elif mission.current < mission.first:
            state = _NOT_STARTED
        else:
            state = _MISSION_ACTIVE if flight.on_mission else _MISSION_PAUSED
        return mavlink.MAVLink_mission_current_message(
            seq=min(mission.current, mission.total),
            total=mission.total,
            mission_state=state,
            mission_mode=_MISSION_MODE_ACTIVE if flight.on_mission else _MISSION_MODE_SUSPENDED,
        )

    def extended_sys_state(self, _time_s: float) -> Message:
        """EXTENDED_SYS_STATE: on ground, in air, taking off or landing; the VTOL state as set."""
        flight = self._flight
        if flight.on_ground:
            landed = _ON_GROUND
        elif flight.taking_off:
            landed = _TAKING_OFF
        else:
            landed = _LANDING if flight.landing else _IN_AIR
        return mavlink.MAVLink_extended_sys_state_message(vtol_state=self.vtol_state, landed_state=landed)

    def scaled_pressure(self, time_s: float) -> Message:
        """SCALED_PRESSURE of the standard atmosphere."""
        aircraft = self._flight.aircraft
        return mavlink.MAVLink_scaled_pressure_message(
            time_boot_ms=self.boot_ms(time_s),
            press_abs=1013.25 * max(1.0 - 2.25577e-5 * aircraft.altitude_m, 0.01) ** 5.25588,
            press_diff=0.5 * 1.225 * aircraft.airspeed_mps**2 / 100.0,
            temperature=2500,
        )

    def rc_channels(self, time_s: float) -> Message:
        """RC_CHANNELS: the pilot's sticks."""
        pulses_us = self._flight.sticks.pulses_us
        named = {f"chan{number}_raw": pulse_us for number, pulse_us in enumerate(pulses_us, 1)}
        return mavlink.MAVLink_rc_channels_message(
            time_boot_ms=self.boot_ms(time_s),
            chancount=sum(pulse_us != _UINT16_MAX for pulse_us in pulses_us),
            rssi=_RSSI_UNKNOWN,
            **named,
        )

    def fence_status(self, time_s: float) -> Message:
        """FENCE_STATUS."""
        flight = self._flight
        return mavlink.MAVLink_fence_status_message(
            breach_status=int(flight.fence_broken),
            breach_count=flight.fence_breaches,
            breach_type=_FENCE_BOUNDARY if flight.fence_broken else 0,
            breach_time=self.boot_ms(time_s),
        )

    def pitch_rad(self) -> float:
        """Flight path angle through the air [rad], positive up."""
        aircraft = self._flight.aircraft
        return math.asin(min(max(aircraft.climb_mps / max(aircraft.airspeed_mps, 1.0), -1.0), 1.0))

    def throttle_percent(self) -> int:
        """Throttle, 0 to 100."""
        flight = self._flight
        if not flight.armed or (flight.on_ground and not flight.taking_off):
            return 0
        if flight.taking_off:
            return 100
        return round(min(max(48.0 + 3.0 * flight.aircraft.climb_mps, 0.0), 100.0))

    def _all_builders(self) -> dict[int, Builder]:
        return {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self.sys_status,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: self.system_time,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self.gps_raw_int,
            mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: self.scaled_pressure,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self.attitude,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self.local_position_ned,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self.global_position_int,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self.mission_current,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: self.vfr_hud,
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: self.rc_channels,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: self.position_target_global_int,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self.battery_status,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self.autopilot_version,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self.home_position,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self.extended_sys_state,
        }


def _centidegrees(angle_rad: float) -> int:
    return round(course_deg(angle_rad) * 100.0) % 36_000
