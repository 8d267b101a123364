"""Reports of an aircraft in straight flight, for tests of tracking."""

import math
from dataclasses import replace

from companion.geodesy import LocalFrame
from companion.model import (
    Track,
    TrafficReport,
    TrafficSource,
    Vec3,
    adsb_key,
)
from companion.traffic import ConcernKind, Tracker
from companion.traffic.own_aircraft import OwnshipFix

FRAME = LocalFrame(47.4, 8.5)
ICAO = 0x4B1234
HOME_M = 500.0


def adsb(icao: int, time_s: float, lat_deg: float, lon_deg: float, altitude_m: float) -> TrafficReport:
    """A transponder's report without motion."""
    return TrafficReport(TrafficSource.ADSB, adsb_key(icao), time_s, lat_deg, lon_deg, altitude_m, icao=icao)


def report_at(
    position_m: Vec3, time_s: float, velocity_mps: Vec3 | None = None, icao: int = ICAO
) -> TrafficReport:
    """A perfect report of a position in FRAME, without motion unless a velocity is given."""
    place = FRAME.to_geo(*position_m)
    report = adsb(icao, time_s, place.lat_deg, place.lon_deg, place.altitude_m)
    if velocity_mps is None:
        return report
    north_mps, east_mps, down_mps = velocity_mps
    return replace(
        report,
        course_rad=math.atan2(east_mps, north_mps) % (2.0 * math.pi),
        ground_speed_mps=math.hypot(north_mps, east_mps),
        climb_mps=-down_mps,
    )


def straight(start_m: Vec3, velocity_mps: Vec3, time_s: float) -> Vec3:
    north_m, east_m, down_m = (p + v * time_s for p, v in zip(start_m, velocity_mps, strict=True))
    return north_m, east_m, down_m


def only(tracks: tuple[Track, ...]) -> Track:
    assert len(tracks) == 1
    return tracks[0]


START_M, VELOCITY_MPS = (-600.0, 900.0, -350.0), (48.0, -36.0, -2.5)


def follow(tracker: Tracker, until_s: int, velocity_known: bool = True) -> None:
    """Perfect reports of straight flight, once a second, `until_s` included."""
    for second in range(until_s + 1):
        position_m = straight(START_M, VELOCITY_MPS, second)
        report = report_at(position_m, second, VELOCITY_MPS if velocity_known else None)
        assert tracker.receive(report, second)


def own_at(tracker: Tracker, time_s: float, north_m: float = 0.0, *, north_mps: float = 22.0) -> None:
    """Our own position, 100 m above home."""
    place = FRAME.to_geo(north_m, 0.0, -HOME_M - 100.0)
    tracker.surroundings = tracker.surroundings._replace(home_altitude_m=HOME_M)
    tracker.observe_ownship(OwnshipFix(time_s, *place, north_mps, 0.0, 0.0))


def concerns(tracker: Tracker, now_s: float) -> list[ConcernKind]:
    """The kinds of the present concerns."""
    return [concern.kind for concern in tracker.concerns(now_s)]
