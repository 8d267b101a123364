"""Heights of each reference against ours, with numbers."""

import pytest

from companion.model import AltitudeReference
from companion.traffic.altitude_datums import (
    AS_REPORTED,
    DatumOffset,
    HeightParams,
    OwnshipAltitudes,
    ReportedAltitude,
    to_sea_level,
)

BAROMETRIC, GEOMETRIC, SEA_LEVEL = AltitudeReference


def flying_at(
    altitude_m: float, *, pressure_m: float | None = None, separation_m: float | None = None
) -> OwnshipAltitudes:
    heights = OwnshipAltitudes()
    heights.observe_altitude(altitude_m)
    if pressure_m is not None:
        heights.observe_pressure_altitude(pressure_m, 0.0)
    if separation_m is not None:
        heights.observe_geoid_separation(separation_m)
    return heights


def height(
    reference: AltitudeReference, altitude_m: float, at_s: float = 0.0, sigma_m: float = 0.0
) -> ReportedAltitude:
    return ReportedAltitude(reference, altitude_m, at_s, 0.0, at_s + 20.0, sigma_m)


@pytest.mark.parametrize(
    ("own", "reference", "offset_m", "uncertainty_m"),
    [
        # Sea-level pressure 1005.25 hPa: barometers read 67 m too high, ours as well as theirs.
        (flying_at(500.0, pressure_m=567.0), BAROMETRIC, -67.0, 0.0),
        (flying_at(500.0), BAROMETRIC, 0.0, 60.0),
        (flying_at(500.0, separation_m=47.6), GEOMETRIC, -47.6, 0.0),
        (flying_at(500.0, separation_m=-30.0), GEOMETRIC, 30.0, 0.0),
        (flying_at(500.0), GEOMETRIC, 0.0, 50.0),
        (flying_at(500.0), SEA_LEVEL, 0.0, 0.0),
        (OwnshipAltitudes(), BAROMETRIC, 0.0, 60.0),
    ],
)
def test_what_each_reference_is_worth(
    own: OwnshipAltitudes, reference: AltitudeReference, offset_m: float, uncertainty_m: float
) -> None:
    assert own.offsets(1.0)[reference] == DatumOffset(offset_m, uncertainty_m)


def test_a_pressure_without_a_height_beside_it_says_nothing() -> None:
    own = OwnshipAltitudes()
    own.observe_pressure_altitude(567.0, 0.0)
    own.observe_altitude(500.0)
    assert own.offsets(0.0)[BAROMETRIC] == DatumOffset(0.0, 60.0)


def test_an_old_pressure_is_worth_less_by_its_age_and_by_what_was_climbed_since() -> None:
    own = flying_at(500.0, pressure_m=567.0)
    assert own.offsets(5.0)[BAROMETRIC].uncertainty_m == 0.0
    assert own.offsets(25.0)[BAROMETRIC] == DatumOffset(-67.0, pytest.approx(10.0))
    own.observe_altitude(800.0)
    assert own.offsets(25.0)[BAROMETRIC] == DatumOffset(-67.0, pytest.approx(10.0 + 0.07 * 300.0))
    assert own.offsets(10_000.0)[BAROMETRIC] == DatumOffset(-67.0, 60.0), "no worse than not known at all"


def test_the_allowances_are_parameters() -> None:
    own = OwnshipAltitudes(HeightParams(pressure_unknown_m=100.0, geoid_unknown_m=0.0))
    assert own.offsets(0.0)[BAROMETRIC].uncertainty_m == 100.0
    assert own.offsets(0.0)[GEOMETRIC].uncertainty_m == 0.0


def test_a_barometric_height_is_right_at_our_height_although_our_offset_changes_as_we_climb() -> None:
    """Air 10 % thinner than standard: barometers read 10 % too little of every metre."""
    own, theirs = OwnshipAltitudes(), height(BAROMETRIC, 900.0)
    for altitude_m in (200.0, 600.0, 1000.0):
        own.observe_altitude(altitude_m)
        own.observe_pressure_altitude(0.9 * altitude_m, 0.0)
        seen = to_sea_level([theirs], own.offsets(0.0), 0.0)
        assert seen is not None
        # It is at 1000 m in truth; what is left is the stretch of what lies between us.
        assert seen.altitude_m - 1000.0 == pytest.approx(-0.1 * (1000.0 - altitude_m))


def test_what_a_sender_states_of_its_accuracy_counts() -> None:
    own = flying_at(500.0)
    seen = to_sea_level([height(GEOMETRIC, 600.0, sigma_m=120.0)], own.offsets(0.0), 0.0)
    assert seen == (600.0, 0.0, pytest.approx(130.0))
    own.observe_geoid_separation(48.0)
    assert to_sea_level([height(GEOMETRIC, 600.0, sigma_m=120.0)], own.offsets(0.0), 0.0) == (
        552.0,
        0.0,
        120.0,
    )


@pytest.mark.parametrize(
    ("own", "expected_m"),
    [
        (flying_at(500.0, pressure_m=567.0), 533.0),  # pressure known, geoid not
        (flying_at(500.0, separation_m=48.0), 532.0),  # geoid known, pressure not
        (flying_at(500.0), 580.0),  # neither: the geoid is off by less
        (flying_at(500.0, pressure_m=567.0, separation_m=48.0), 533.0),  # both: barometers
    ],
)
def test_of_two_references_the_one_that_compares_best_counts(
    own: OwnshipAltitudes, expected_m: float
) -> None:
    both = [height(GEOMETRIC, 580.0), height(BAROMETRIC, 600.0)]
    for heights in (both, both[::-1]):
        seen = to_sea_level(heights, own.offsets(1.0), 1.0)
        assert seen is not None
        assert seen.altitude_m == expected_m


def test_two_references_heard_in_turn_do_not_take_turns() -> None:
    own = flying_at(500.0, pressure_m=567.0, separation_m=48.0).offsets(0.0)
    for tick in range(40):
        now_s = tick / 10.0
        both = [
            height(GEOMETRIC, 580.0, at_s=now_s // 1.0),
            height(BAROMETRIC, 600.0, at_s=now_s // 1.0 - 0.5),
        ]
        seen = to_sea_level(both, own, now_s)
        assert seen is not None
        assert seen.altitude_m == 533.0


def test_a_reference_that_was_not_heard_for_long_gives_way() -> None:
    own = flying_at(500.0, pressure_m=567.0).offsets(16.0)
    seen = to_sea_level([height(GEOMETRIC, 580.0, at_s=16.0), height(BAROMETRIC, 600.0)], AS_REPORTED, 16.0)
    assert seen is not None
    assert seen.altitude_m == 580.0
    assert to_sea_level([height(BAROMETRIC, 600.0)], own, 20.1) is None
    assert to_sea_level([], own, 0.0) is None


def test_a_height_is_flown_on_with_its_climb() -> None:
    climbing = ReportedAltitude(SEA_LEVEL, 400.0, 10.0, 3.0, 30.0, 0.0)
    assert to_sea_level([climbing], AS_REPORTED, 14.0) == (412.0, 3.0, 0.0)
