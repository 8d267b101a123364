"""A fake PX4 under test, with a stream of setpoints."""

import math
from typing import Any

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Message, mavlink
from sim.vehicle import FakePx4, MissionItem, Px4Mode, takeoff_item, waypoint_item
from tests.support.vehicle_bench import Bench

START_S = 1_800_000_000.0
HOME = GeoPoint(47.397742, 8.545594, 488.0)
FRAME = LocalFrame(HOME.lat_deg, HOME.lon_deg)
POSITION_VELOCITY, VELOCITY, POSITION, NO_HEIGHT = 3520, 3527, 3576, 3524
GLOBAL, RELATIVE = 5, 6
RATE_S = 0.1


def waypoint(north_m: float, east_m: float, height_m: float = 100.0) -> MissionItem:
    return waypoint_item(FRAME.to_geo(north_m, east_m, -(HOME.altitude_m + height_m)))


MISSION = [takeoff_item(40.0), waypoint(4000.0, 0.0), waypoint(4000.0, 3000.0)]


class Px4Bench(Bench):
    """A bench with a PX4; it streams setpoints at 10 Hz, as a companion does."""

    vehicle: FakePx4

    def mode(self) -> str:
        return self.vehicle.truth.mode

    def height_m(self) -> float:
        return -self.vehicle.truth.position_m[2] - HOME.altitude_m

    def course_deg(self) -> float:
        north_mps, east_mps, _ = self.vehicle.truth.velocity_mps
        return math.degrees(math.atan2(east_mps, north_mps)) % 360.0

    def request_mode(self, mode: Px4Mode) -> int:
        """Send DO_SET_MODE; the result."""
        return self.by_long(176, 1, mode >> 16 & 0xFF, mode >> 24)

    def setpoint(
        self,
        mask: int = POSITION_VELOCITY,
        *,
        course_deg: float = 0.0,
        height_m: float | None = None,
        frame: int = GLOBAL,
        speed_mps: float = 14.0,
        acceleration_mps2: tuple[float, float] = (0.0, 0.0),
    ) -> Message:
        """A setpoint at the present position; height above home, by default the present one."""
        place = self.vehicle.truth.place
        height_m = self.height_m() if height_m is None else height_m
        course_rad = math.radians(course_deg)
        return mavlink.MAVLink_set_position_target_global_int_message(
            0,
            1,
            1,
            frame,
            mask,
            round(place.lat_deg * 1e7),
            round(place.lon_deg * 1e7),
            height_m + (HOME.altitude_m if frame != RELATIVE else 0.0),
            speed_mps * math.cos(course_rad) if speed_mps else 0.0,
            speed_mps * math.sin(course_rad) if speed_mps else 0.0,
            0.0,
            *acceleration_mps2,
            0.0,
            0.0,
            0.0,
        )

    def stream(self, seconds: float, mask: int = POSITION_VELOCITY, **fields: Any) -> None:
        for _ in range(round(seconds / RATE_S)):
            self.send(self.setpoint(mask, **fields), (1, 196))
            self.fly(RATE_S)

    def engage(self) -> None:
        """Enter OFFBOARD correctly: velocity only, mode request, confirmation, then position and velocity."""
        self.stream(0.5, VELOCITY)
        assert self.request_mode(Px4Mode.OFFBOARD) == 0
        self.stream(0.3, VELOCITY)
        assert self.mode() == "OFFBOARD"
        self.stream(0.1)

    def release(self, mode: Px4Mode = Px4Mode.MISSION) -> None:
        """Leave OFFBOARD correctly: level for a moment, then the mode request."""
        self.stream(0.4, course_deg=self.course_deg())
        assert self.request_mode(mode) == 0


def airborne(*, quiet: bool = True, **options: Any) -> Px4Bench:
    """An aircraft in MISSION, northbound 100 m above home at 14 m/s."""
    parameters = {"FW_AIRSPD_TRIM": 14.0, **options.pop("parameters", {})}
    vehicle = FakePx4.airborne(
        HOME,
        START_S,
        mission=options.pop("mission", MISSION),
        position=FRAME.to_geo(0.0, 0.0, -(HOME.altitude_m + options.pop("height_m", 100.0))),
        course_rad=0.0,
        sequence=1,
        parameters=parameters,
        **options,
    )
    return Px4Bench(vehicle, rate_hz=0.0 if quiet else 10.0)


def on_ground(**options: Any) -> Px4Bench:
    return Px4Bench(FakePx4(HOME, START_S, mission=MISSION, **options))
