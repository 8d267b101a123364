"""Aircraft and streams for tests of receivers of ADS-B."""

import math
from collections.abc import Iterable

from companion.geodesy import GeoPoint, LocalFrame
from companion.model import TrafficReport
from companion.sources.decoder import Decoder
from sim.receivers.encoder import Transmission

PLACE = GeoPoint(47.1234567, 8.7654321, 1234.5)


def aircraft(
    place: GeoPoint = PLACE,
    icao: int = 0x4840D6,
    pressure_altitude_m: float = 1100.0,
    velocity_mps: tuple[float, float, float] = (30.0, -40.0, -2.0),
    **options: object,
) -> Transmission:
    """An aircraft in the air, flying north-west and climbing."""
    return Transmission(icao, "KLM1023", place, pressure_altitude_m, velocity_mps, **options)  # type: ignore[arg-type]


def moved(place: GeoPoint, north_m: float, east_m: float) -> GeoPoint:
    """A place so far north and east of another."""
    there = LocalFrame(place.lat_deg, place.lon_deg).to_geo(north_m, east_m, 0.0)
    return GeoPoint(there.lat_deg, there.lon_deg, place.altitude_m)


def reports(decoder: Decoder, pieces: Iterable[bytes], received_s: float = 100.0) -> list[TrafficReport]:
    """What a decoder reports of pieces that are received at one time."""
    return [heard.report for piece in pieces for heard in decoder.feed(piece, received_s)]


def distance_m(report: TrafficReport, place: GeoPoint) -> float:
    """How far the position of a report is from a place [m]."""
    assert report.lat_deg is not None
    assert report.lon_deg is not None
    frame = LocalFrame(place.lat_deg, place.lon_deg)
    return math.hypot(*frame.to_north_east_m(report.lat_deg, report.lon_deg))
