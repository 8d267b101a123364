"""The aircraft's limits: from parameter values to the envelope, with what is not believed on the way."""

import math

import pytest

from companion.autopilots.limits import ARDUPLANE, PX4
from companion.avoidance import Envelope
from companion.engine import AircraftLimits
from companion.ownship.performance_limits import effective
from companion.ownship.reported_limits import ReportedLimits, believe

NEW = {
    "AIRSPEED_MIN": 12.0,
    "AIRSPEED_MAX": 30.0,
    "AIRSPEED_CRUISE": 20.0,
    "ROLL_LIMIT_DEG": 45.0,
    "TECS_CLMB_MAX": 5.0,
    "TECS_SINK_MAX": 4.0,
    "WP_LOITER_RAD": -60.0,
}
OLD = {
    "ARSPD_FBW_MIN": 12.0,
    "ARSPD_FBW_MAX": 30.0,
    "TRIM_ARSPD_CM": 2000.0,
    "LIM_ROLL_CD": 4500.0,
    "TECS_CLMB_MAX": 5.0,
    "TECS_SINK_MAX": 4.0,
    "WP_LOITER_RAD": -60.0,
}
OF_PX4 = {
    "FW_AIRSPD_MIN": 12.0,
    "FW_AIRSPD_MAX": 30.0,
    "FW_AIRSPD_TRIM": 20.0,
    "FW_R_LIM": 45.0,
    "FW_T_CLMB_MAX": 5.0,
    "FW_T_SINK_MAX": 4.0,
    "NAV_LOITER_RAD": -60.0,
}
ASSUMED, NOTHING = Envelope(), AircraftLimits()


def sources(configured: AircraftLimits, belief: ReportedLimits) -> dict[str, str]:
    return {taken.quantity: taken.source for taken in effective(ASSUMED, configured, belief).taken}


@pytest.mark.parametrize(("values", "table"), [(NEW, ARDUPLANE), (OLD, ARDUPLANE), (OF_PX4, PX4)])
def test_all_names_and_units_mean_the_same_aircraft(values: dict[str, float], table: object) -> None:
    limits = believe(values, table).limits  # type: ignore[arg-type]
    assert (limits.min_airspeed_mps, limits.max_airspeed_mps, limits.cruise_airspeed_mps) == (
        12.0,
        30.0,
        20.0,
    )
    assert limits.max_bank_rad == pytest.approx(math.radians(45.0))
    assert (limits.max_climb_mps, limits.max_sink_mps, limits.loiter_radius_m) == (5.0, 4.0, -60.0)


def test_the_new_name_counts_where_both_are_told() -> None:
    belief = believe({"ROLL_LIMIT_DEG": 40.0, "LIM_ROLL_CD": 6500.0}, ARDUPLANE)
    assert belief.limits.max_bank_rad == pytest.approx(math.radians(40.0))
    assert belief.names == {"max_bank_rad": "ROLL_LIMIT_DEG"}


def test_of_two_parameters_for_one_limit_the_tighter_counts() -> None:
    belief = believe({**OF_PX4, "FW_T_CLMB_R_SP": 3.0, "FW_T_SINK_R_SP": 9.0}, PX4)
    assert (belief.limits.max_climb_mps, belief.limits.max_sink_mps) == (3.0, 4.0)
    assert belief.names["max_climb_mps"] == "FW_T_CLMB_R_SP"


@pytest.mark.parametrize(
    ("name", "value", "field"),
    [
        ("ROLL_LIMIT_DEG", 0.0, "max_bank_rad"),
        ("ROLL_LIMIT_DEG", 4500.0, "max_bank_rad"),
        ("ROLL_LIMIT_DEG", -45.0, "max_bank_rad"),
        ("AIRSPEED_MIN", 0.0, "min_airspeed_mps"),
        ("AIRSPEED_MAX", 3000.0, "max_airspeed_mps"),
        ("TECS_CLMB_MAX", 0.0, "max_climb_mps"),
        ("TECS_SINK_MAX", -5.0, "max_sink_mps"),
        ("WP_LOITER_RAD", 0.0, "loiter_radius_m"),
    ],
)
def test_an_absurd_value_is_not_believed_and_told(name: str, value: float, field: str) -> None:
    belief = believe({**NEW, name: value}, ARDUPLANE)
    assert getattr(belief.limits, field) is None
    assert field not in belief.names
    assert belief.doubts == (f"{name} {value:g} not believed",)


def test_speeds_that_contradict_each_other_are_not_believed() -> None:
    belief = believe({**NEW, "AIRSPEED_MIN": 30.0, "AIRSPEED_MAX": 12.0}, ARDUPLANE)
    assert (belief.limits.min_airspeed_mps, belief.limits.max_airspeed_mps) == (None, None)
    assert belief.limits.cruise_airspeed_mps == 20.0
    assert belief.doubts == ("AIRSPEED_MIN and AIRSPEED_MAX not believed: contradictory",)
    beyond = believe({**NEW, "AIRSPEED_CRUISE": 35.0}, ARDUPLANE)
    assert beyond.limits.cruise_airspeed_mps is None
    assert beyond.limits.max_airspeed_mps == 30.0


def test_without_answers_the_assumption_stands() -> None:
    taken = effective(ASSUMED, NOTHING, ReportedLimits())
    assert taken.envelope == ASSUMED
    assert set(sources(NOTHING, ReportedLimits()).values()) == {"assumed"}


def test_the_aircraft_replaces_the_assumption() -> None:
    envelope = effective(ASSUMED, NOTHING, believe(NEW, ARDUPLANE)).envelope
    assert envelope.max_airspeed_mps == 30.0
    assert envelope.max_bank_rad == pytest.approx(math.radians(45.0))
    assert envelope.max_climb_mps == pytest.approx(4.5), "what is reached of 5"
    assert envelope.max_sink_mps == pytest.approx(3.6)
    assert (envelope.response_s, envelope.max_turn_rate_radps) == (1.0, ASSUMED.max_turn_rate_radps)


def test_the_slowest_airspeed_carries_the_bank() -> None:
    """At 60 degrees the wing carries twice the weight, and stalls at the square root of two more."""
    belief = believe({"AIRSPEED_MIN": 10.0, "ROLL_LIMIT_DEG": 60.0}, ARDUPLANE)
    envelope = effective(ASSUMED, NOTHING, belief).envelope
    assert envelope.min_airspeed_mps == pytest.approx(10.0 * math.sqrt(2.0))


def test_no_more_bank_than_cruise_airspeed_carries() -> None:
    belief = believe({**NEW, "AIRSPEED_MIN": 18.0, "AIRSPEED_CRUISE": 20.0}, ARDUPLANE)
    envelope = effective(ASSUMED, NOTHING, belief).envelope
    assert math.cos(envelope.max_bank_rad) == pytest.approx((18.0 / 20.0) ** 2)
    assert envelope.min_airspeed_mps == pytest.approx(20.0)
    px4 = believe({**OF_PX4, "FW_AIRSPD_MIN": 18.0}, PX4)
    assert effective(ASSUMED, NOTHING, px4).envelope.max_bank_rad == pytest.approx(math.radians(45.0))


def test_configured_limits_replace_those_of_the_aircraft_and_what_is_assumed() -> None:
    configured = AircraftLimits(max_bank_rad=math.radians(20.0), max_climb_mps=2.0, loiter_radius_m=90.0)
    for belief in (ReportedLimits(), believe(NEW, ARDUPLANE)):
        taken = effective(ASSUMED, configured, belief)
        assert taken.envelope.max_bank_rad == math.radians(20.0)
        assert taken.envelope.max_climb_mps == 2.0
        assert taken.loiter_radius_m == 90.0
        assert sources(configured, belief)["max bank"].startswith("configured")
    both = sources(configured, believe(NEW, ARDUPLANE))
    assert both["max bank"] == "configured; ROLL_LIMIT_DEG 45", "both are told"
    assert effective(ASSUMED, AircraftLimits(max_bank_rad=1.0), ReportedLimits()).envelope.max_bank_rad == 1.0


def test_configured_limits_beyond_those_of_the_aircraft_count_and_are_warned_of() -> None:
    configured = AircraftLimits(
        min_airspeed_mps=5.0, max_airspeed_mps=50.0, max_bank_rad=math.radians(70.0), max_sink_mps=9.0
    )
    taken = effective(ASSUMED, configured, believe(NEW, ARDUPLANE))
    envelope = taken.envelope
    assert (envelope.min_airspeed_mps, envelope.max_airspeed_mps, envelope.max_sink_mps) == (5.0, 50.0, 9.0)
    assert envelope.max_bank_rad == math.radians(70.0)
    assert sources(configured, believe(NEW, ARDUPLANE))["max bank"] == "configured; ROLL_LIMIT_DEG 45"
    assert taken.doubts == (
        "min airspeed 5 configured, AIRSPEED_MIN allows 12",
        "max airspeed 50 configured, AIRSPEED_MAX allows 30",
        "max bank 70 configured, ROLL_LIMIT_DEG allows 45",
        "max sink 9 configured, 0.9 TECS_SINK_MAX allows 3.6",
    )
    assert not effective(ASSUMED, configured, ReportedLimits()).doubts, "nobody says otherwise"


@pytest.mark.parametrize(
    ("values", "configured", "expected"),
    [
        ({"AIRSPEED_MIN": 40.0}, {}, (40.0, 40.0)),  # faster than the assumed fastest
        ({"AIRSPEED_MAX": 12.0}, {}, (12.0, 12.0)),
        ({}, {"max_airspeed_mps": 10.0}, (10.0, 10.0)),
        ({"AIRSPEED_MAX": 20.0}, {"min_airspeed_mps": 25.0}, (16.0, 20.0)),  # configured in vain
    ],
)
def test_airspeeds_from_different_sources_never_cross(
    values: dict[str, float], configured: dict[str, float], expected: tuple[float, float]
) -> None:
    """On 1e-6 rad of bank, so that nothing is added for it."""
    limits = AircraftLimits(max_bank_rad=1e-6, **configured)
    taken = effective(ASSUMED, limits, believe(values, ARDUPLANE))
    envelope = taken.envelope
    assert (envelope.min_airspeed_mps, envelope.max_airspeed_mps) == pytest.approx(expected)
    assert bool(taken.doubts) == ("min_airspeed_mps" in configured)


def test_each_limit_in_words() -> None:
    configured = AircraftLimits(max_climb_mps=2.5)
    words = [str(taken) for taken in effective(ASSUMED, configured, believe(NEW, ARDUPLANE)).taken]
    assert words == [
        "min airspeed 14.27 m/s (AIRSPEED_MIN, banked)",
        "max airspeed 30 m/s (AIRSPEED_MAX)",
        "max bank 45 deg (ROLL_LIMIT_DEG)",
        "max climb 2.5 m/s (configured; 0.9 TECS_CLMB_MAX 4.5)",
        "max sink 3.6 m/s (0.9 TECS_SINK_MAX)",
        "loiter radius -60 m (WP_LOITER_RAD)",
    ]
