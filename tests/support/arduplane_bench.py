"""A fake ArduPlane under test."""

import math
from typing import Any

from companion.geodesy import GeoPoint, LocalFrame
from sim.vehicle import FakeArduPlane, MissionItem, Mode, takeoff_item, waypoint_item
from tests.support.vehicle_bench import ACCEPTED, SET_MODE, Bench

START_S = 1_800_000_000.0
HOME = GeoPoint(-35.363261, 149.1652299, 584.1)
FRAME = LocalFrame(HOME.lat_deg, HOME.lon_deg)


def waypoint(north_m: float, east_m: float, height_m: float = 300.0) -> MissionItem:
    return waypoint_item(FRAME.to_geo(north_m, east_m, -(HOME.altitude_m + height_m)))


MISSION = [takeoff_item(60.0), waypoint(4000.0, 0.0), waypoint(4000.0, 3000.0)]


class PlaneBench(Bench):
    """A bench with an ArduPlane."""

    vehicle: FakeArduPlane

    def guided(self) -> None:
        """Enter GUIDED."""
        assert self.by_long(SET_MODE, 1, Mode.GUIDED) == ACCEPTED


def airborne(**options: Any) -> PlaneBench:
    """A plane in AUTO, northbound 300 m above home; `channels` and `rate_hz` are the bench's."""
    bench = {name: options.pop(name) for name in ("channels", "rate_hz") if name in options}
    vehicle = FakeArduPlane.airborne(
        HOME,
        START_S,
        mission=options.pop("mission", MISSION),
        position=FRAME.to_geo(0.0, 0.0, -(HOME.altitude_m + 300.0)),
        course_rad=0.0,
        sequence=options.pop("sequence", 2),
        **options,
    )
    return PlaneBench(vehicle, **bench)


def on_ground(**options: Any) -> PlaneBench:
    return PlaneBench(FakeArduPlane(HOME, START_S, mission=MISSION), **options)


def course_deg(bench: PlaneBench) -> float:
    north_mps, east_mps, _ = bench.vehicle.truth.velocity_mps
    return math.degrees(math.atan2(east_mps, north_mps)) % 360.0


def height_m(bench: PlaneBench) -> float:
    return -bench.vehicle.truth.position_m[2] - HOME.altitude_m
