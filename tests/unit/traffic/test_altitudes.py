"""Offsets of altitude references, and which altitude of a target is used."""

import pytest

from companion.model import AltitudeReference
from companion.traffic.altitudes import (
    AS_REPORTED,
    DatumOffset,
    OwnshipAltitudes,
    ReportedAltitude,
    to_sea_level,
)
from companion.traffic.params import HeightParams

BAROMETRIC, GEOMETRIC, SEA_LEVEL = AltitudeReference


def ownship_at(
    altitude_m: float, *, pressure_m: float | None = None, separation_m: float | None = None
) -> OwnshipAltitudes:
    own = OwnshipAltitudes()
    own.observe_altitude(altitude_m)
    if pressure_m is not None:
        own.observe_pressure_altitude(pressure_m, 0.0)
    if separation_m is not None:
        own.observe_geoid_separation(separation_m)
    return own


def altitude(
    reference: AltitudeReference, altitude_m: float, time_s: float = 0.0, sigma_m: float = 0.0
) -> ReportedAltitude:
    return ReportedAltitude(reference, altitude_m, time_s, 0.0, time_s + 20.0, sigma_m)


@pytest.mark.parametrize(
    ("own", "reference", "offset_m", "uncertainty_m"),
    [
        # Sea-level pressure 1005.25 hPa: all barometers read 67 m too high.
        (ownship_at(500.0, pressure_m=567.0), BAROMETRIC, -67.0, 0.0),
        (ownship_at(500.0), BAROMETRIC, 0.0, 60.0),
        (ownship_at(500.0, separation_m=47.6), GEOMETRIC, -47.6, 0.0),
        (ownship_at(500.0, separation_m=-30.0), GEOMETRIC, 30.0, 0.0),
        (ownship_at(500.0), GEOMETRIC, 0.0, 50.0),
        (ownship_at(500.0), SEA_LEVEL, 0.0, 0.0),
        (OwnshipAltitudes(), BAROMETRIC, 0.0, 60.0),
    ],
)
def test_offset_and_uncertainty_of_each_reference(
    own: OwnshipAltitudes, reference: AltitudeReference, offset_m: float, uncertainty_m: float
) -> None:
    assert own.offsets(1.0)[reference] == DatumOffset(offset_m, uncertainty_m)


def test_a_pressure_altitude_is_ignored_while_our_altitude_is_unknown() -> None:
    own = OwnshipAltitudes()
    own.observe_pressure_altitude(567.0, 0.0)
    own.observe_altitude(500.0)
    assert own.offsets(0.0)[BAROMETRIC] == DatumOffset(0.0, 60.0)


def test_the_error_of_an_old_pressure_altitude_grows_with_time_and_with_climb() -> None:
    own = ownship_at(500.0, pressure_m=567.0)
    assert own.offsets(5.0)[BAROMETRIC].uncertainty_m == 0.0
    assert own.offsets(25.0)[BAROMETRIC] == DatumOffset(-67.0, pytest.approx(10.0))
    own.observe_altitude(800.0)
    assert own.offsets(25.0)[BAROMETRIC] == DatumOffset(-67.0, pytest.approx(10.0 + 0.07 * 300.0))
    assert own.offsets(10_000.0)[BAROMETRIC] == DatumOffset(-67.0, 60.0), "at most that of an unknown offset"


def test_the_errors_of_unknown_offsets_are_parameters() -> None:
    own = OwnshipAltitudes(HeightParams(pressure_unknown_m=100.0, geoid_unknown_m=0.0))
    assert own.offsets(0.0)[BAROMETRIC].uncertainty_m == 100.0
    assert own.offsets(0.0)[GEOMETRIC].uncertainty_m == 0.0


def test_a_barometric_altitude_is_exact_at_our_altitude_although_our_offset_changes_as_we_climb() -> None:
    """In air 10 % thinner than standard, barometers read 0.9 m for each metre."""
    own, theirs = OwnshipAltitudes(), altitude(BAROMETRIC, 900.0)
    for altitude_m in (200.0, 600.0, 1000.0):
        own.observe_altitude(altitude_m)
        own.observe_pressure_altitude(0.9 * altitude_m, 0.0)
        found = to_sea_level([theirs], own.offsets(0.0), 0.0)
        assert found is not None
        # The true altitude is 1000 m; the remaining error is the stretch of the difference to ours.
        assert found.altitude_m - 1000.0 == pytest.approx(-0.1 * (1000.0 - altitude_m))


def test_the_accuracy_stated_by_the_sender_is_added() -> None:
    own = ownship_at(500.0)
    found = to_sea_level([altitude(GEOMETRIC, 600.0, sigma_m=120.0)], own.offsets(0.0), 0.0)
    assert found == (600.0, 0.0, pytest.approx(130.0))
    own.observe_geoid_separation(48.0)
    assert to_sea_level([altitude(GEOMETRIC, 600.0, sigma_m=120.0)], own.offsets(0.0), 0.0) == (
        552.0,
        0.0,
        120.0,
    )


@pytest.mark.parametrize(
    ("own", "expected_m"),
    [
        (ownship_at(500.0, pressure_m=567.0), 533.0),  # pressure known, geoid not
        (ownship_at(500.0, separation_m=48.0), 532.0),  # geoid known, pressure not
        (ownship_at(500.0), 580.0),  # neither: the error of the geoid is smaller
        (ownship_at(500.0, pressure_m=567.0, separation_m=48.0), 533.0),  # both: barometers
    ],
)
def test_the_more_certain_of_two_references_is_used(own: OwnshipAltitudes, expected_m: float) -> None:
    both = [altitude(GEOMETRIC, 580.0), altitude(BAROMETRIC, 600.0)]
    for altitudes in (both, both[::-1]):
        found = to_sea_level(altitudes, own.offsets(1.0), 1.0)
        assert found is not None
        assert found.altitude_m == expected_m


def test_the_reference_does_not_alternate_when_two_are_received_in_turn() -> None:
    own = ownship_at(500.0, pressure_m=567.0, separation_m=48.0).offsets(0.0)
    for tick in range(40):
        now_s = tick / 10.0
        both = [
            altitude(GEOMETRIC, 580.0, time_s=now_s // 1.0),
            altitude(BAROMETRIC, 600.0, time_s=now_s // 1.0 - 0.5),
        ]
        found = to_sea_level(both, own, now_s)
        assert found is not None
        assert found.altitude_m == 533.0


def test_an_old_altitude_is_replaced_by_one_of_another_reference() -> None:
    own = ownship_at(500.0, pressure_m=567.0).offsets(16.0)
    found = to_sea_level(
        [altitude(GEOMETRIC, 580.0, time_s=16.0), altitude(BAROMETRIC, 600.0)], AS_REPORTED, 16.0
    )
    assert found is not None
    assert found.altitude_m == 580.0
    assert to_sea_level([altitude(BAROMETRIC, 600.0)], own, 20.1) is None
    assert to_sea_level([], own, 0.0) is None


def test_an_altitude_is_extrapolated_with_its_climb() -> None:
    climbing = ReportedAltitude(SEA_LEVEL, 400.0, 10.0, 3.0, 30.0, 0.0)
    assert to_sea_level([climbing], AS_REPORTED, 14.0) == (412.0, 3.0, 0.0)
