"""Wind, terrain, and the floor and ceiling of an avoidance."""

import math

import pytest

from companion.airspace.fences import HeightLimits, limit_heights
from companion.avoidance import Envelope
from companion.geodesy import GeoPoint
from companion.mavlink.facts import OwnPosition, Sender, TerrainReport, Wind
from companion.ownship.kinematics import Terrain, WindEstimator

AUTOPILOT = Sender(1, 1)


def flying(north_mps: float, east_mps: float, heading_rad: float | None = 0.0) -> OwnPosition:
    return OwnPosition(AUTOPILOT, 0.0, 47.0, 8.0, 700.0, 200.0, (north_mps, east_mps, 0.0), heading_rad)


# --- wind


def test_a_fresh_report_counts_before_the_estimate() -> None:
    wind = WindEstimator()
    for tenth in range(100):
        wind.observe(flying(25.0, 3.0), 20.0, tenth / 10)
    wind.report(Wind(AUTOPILOT, 4.0, 2.0), 10.0)
    assert wind.wind_mps(20.0, 12.0) == (4.0, 2.0)
    assert wind.wind_mps(20.0, 16.0) == pytest.approx((5.0, 3.0))
    assert wind.wind_mps(20.0, 60.0) is None, "report and estimate are old"


def test_a_report_of_zero_or_of_an_implausible_wind_is_ignored() -> None:
    for north_mps in (0.0, 90.0):
        wind = WindEstimator()
        wind.observe(flying(25.0, 0.0), 20.0, 0.0)
        wind.report(Wind(AUTOPILOT, north_mps, 0.0), 0.0)
        assert wind.wind_mps(20.0, 1.0) == pytest.approx((5.0, 0.0))


def test_wind_that_the_aircraft_cannot_fly_against_is_unknown() -> None:
    wind = WindEstimator()
    wind.report(Wind(AUTOPILOT, 21.0, 0.0), 0.0)
    assert wind.wind_mps(20.0, 1.0) is None
    assert wind.wind_mps(22.0, 1.0) == (21.0, 0.0)


def test_without_airspeed_or_heading_or_with_a_wrong_airspeed_there_is_no_estimate() -> None:
    wind = WindEstimator()
    wind.observe(flying(25.0, 0.0), None, 0.0)
    wind.observe(flying(25.0, 0.0), 0.5, 0.0)
    wind.observe(flying(25.0, 0.0, None), 20.0, 0.0)
    assert wind.wind_mps(20.0, 0.0) is None
    wind.observe(flying(25.0, 0.0), 5.0, 0.0)
    assert wind.wind_mps(5.0, 0.0) is None


def test_the_estimate_is_smoothed() -> None:
    wind = WindEstimator()
    wind.observe(flying(20.0, 0.0), 20.0, 0.0)
    wind.observe(flying(30.0, 0.0), 20.0, 10.0)
    north_mps, _ = wind.wind_mps(20.0, 10.0) or (math.nan, 0.0)
    assert north_mps == pytest.approx(10.0 * (1.0 - math.exp(-1.0)))


# --- terrain

HERE = GeoPoint(47.0, 8.0, 700.0)


def report(lat_deg: float = 47.0, terrain_m: float = 600.0, height_m: float = 100.0) -> TerrainReport:
    return TerrainReport(AUTOPILOT, lat_deg, 8.0, terrain_m, height_m)


def test_terrain_is_known_for_ten_seconds_and_only_near_the_aircraft() -> None:
    terrain = Terrain()
    terrain.observe(report(47.1, 900.0), HERE, 0.0)
    terrain.observe(report(), None, 0.0)
    assert terrain.altitude_m(0.0) is None
    terrain.observe(report(47.001), HERE, 0.0)
    assert terrain.altitude_m(5.0) == 600.0
    assert terrain.altitude_m(11.0) is None


def test_the_higher_terrain_of_map_and_height_above_terrain_counts() -> None:
    terrain = Terrain()
    terrain.observe(report(height_m=80.0), HERE, 0.0)
    assert terrain.altitude_m(0.0) == 620.0
    terrain.observe(report(height_m=130.0), HERE, 0.0)
    assert terrain.altitude_m(0.0) == 600.0


# --- heights


@pytest.mark.parametrize(
    ("limits", "terrain_m", "envelope", "floor_m", "ceiling_m"),
    [
        (HeightLimits(30.0), None, Envelope(), 530.0, None),
        (HeightLimits(30.0, 120.0), None, Envelope(), 530.0, 620.0),
        (HeightLimits(30.0), 600.0, Envelope(), 630.0, None),
        (HeightLimits(30.0), 400.0, Envelope(), 530.0, None),
        (HeightLimits(30.0, 120.0, 50.0, 100.0), None, Envelope(), 550.0, 600.0),
        (HeightLimits(30.0, 120.0, 10.0, 150.0), None, Envelope(), 530.0, 620.0),
        (HeightLimits(30.0), None, Envelope(min_altitude_m=540.0, max_altitude_m=800.0), 540.0, 800.0),
        (HeightLimits(30.0, 120.0), 650.0, Envelope(), 680.0, 680.0),  # the floor counts
    ],
)
def test_the_tightest_floor_and_ceiling_count(
    limits: HeightLimits, terrain_m: float | None, envelope: Envelope, floor_m: float, ceiling_m: float | None
) -> None:
    limited = limit_heights(envelope, limits, 500.0, terrain_m)
    assert (limited.min_altitude_m, limited.max_altitude_m) == (floor_m, ceiling_m)
    assert limited.max_bank_rad == envelope.max_bank_rad
