"""The limits in effect: as configured, otherwise as reported, otherwise as assumed."""

import math

import pytest

from companion.autopilots import ArduPlane, Px4FixedWing
from companion.autopilots.parameters import ReportedLimits, reported_limits
from companion.avoidance import Envelope
from companion.engine import AircraftLimits
from companion.ownship.performance_limits import PerformanceLimits, limits_in_effect

NEW = {
    "AIRSPEED_MIN": 12.0,
    "AIRSPEED_MAX": 30.0,
    "AIRSPEED_CRUISE": 20.0,
    "ROLL_LIMIT_DEG": 45.0,
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
ASSUMED, NOT_CONFIGURED, NOT_REPORTED = Envelope(), AircraftLimits(), ReportedLimits()


def ardupilot(values: dict[str, float]) -> ReportedLimits:
    return reported_limits(values, ArduPlane.parameters)


def px4(values: dict[str, float]) -> ReportedLimits:
    return reported_limits(values, Px4FixedWing.parameters)


def in_effect(reported: ReportedLimits, configured: AircraftLimits = NOT_CONFIGURED) -> PerformanceLimits:
    return limits_in_effect(ASSUMED, configured, reported)


def sources(limits: PerformanceLimits) -> dict[str, str]:
    return {limit.quantity: limit.source for limit in limits.sourced}


def test_without_reported_limits_the_assumed_ones_apply() -> None:
    limits = in_effect(NOT_REPORTED)
    assert limits.envelope == ASSUMED
    assert set(sources(limits).values()) == {"assumed"}


def test_reported_limits_replace_assumed_ones() -> None:
    envelope = in_effect(ardupilot(NEW)).envelope
    assert envelope.max_airspeed_mps == 30.0
    assert envelope.max_bank_rad == pytest.approx(math.radians(45.0))
    assert envelope.max_climb_mps == pytest.approx(4.5), "the part of 5 m/s that is reached"
    assert envelope.max_sink_mps == pytest.approx(3.6)
    assert (envelope.response_s, envelope.max_turn_rate_radps) == (1.0, ASSUMED.max_turn_rate_radps)


def test_the_minimum_airspeed_is_that_of_a_turn_at_the_bank_limit() -> None:
    """At 60 degrees of bank the load factor is 2, and the stall speed grows by its square root."""
    envelope = in_effect(ardupilot({"AIRSPEED_MIN": 10.0, "ROLL_LIMIT_DEG": 60.0})).envelope
    assert envelope.min_airspeed_mps == pytest.approx(10.0 * math.sqrt(2.0))


def test_stall_prevention_limits_the_bank_at_cruise_airspeed() -> None:
    envelope = in_effect(ardupilot({**NEW, "AIRSPEED_MIN": 18.0, "AIRSPEED_CRUISE": 20.0})).envelope
    assert math.cos(envelope.max_bank_rad) == pytest.approx((18.0 / 20.0) ** 2)
    assert envelope.min_airspeed_mps == pytest.approx(20.0)
    without = in_effect(px4({**OF_PX4, "FW_AIRSPD_MIN": 18.0})).envelope
    assert without.max_bank_rad == pytest.approx(math.radians(45.0))


def test_configured_limits_replace_reported_and_assumed_ones() -> None:
    configured = AircraftLimits(max_bank_rad=math.radians(20.0), max_climb_mps=2.0, loiter_radius_m=90.0)
    for reported in (NOT_REPORTED, ardupilot(NEW)):
        limits = in_effect(reported, configured)
        assert limits.envelope.max_bank_rad == math.radians(20.0)
        assert limits.envelope.max_climb_mps == 2.0
        assert limits.loiter_radius_m == 90.0
        assert sources(limits)["max bank"].startswith("configured")
    assert sources(limits)["max bank"] == "configured; ROLL_LIMIT_DEG 45", "names both"
    assert in_effect(NOT_REPORTED, AircraftLimits(max_bank_rad=1.0)).envelope.max_bank_rad == 1.0


def test_configured_limits_beyond_reported_ones_apply_with_a_warning() -> None:
    configured = AircraftLimits(
        min_airspeed_mps=5.0, max_airspeed_mps=50.0, max_bank_rad=math.radians(70.0), max_sink_mps=9.0
    )
    limits = in_effect(ardupilot(NEW), configured)
    envelope = limits.envelope
    assert (envelope.min_airspeed_mps, envelope.max_airspeed_mps, envelope.max_sink_mps) == (5.0, 50.0, 9.0)
    assert envelope.max_bank_rad == math.radians(70.0)
    assert sources(limits)["max bank"] == "configured; ROLL_LIMIT_DEG 45"
    assert limits.warnings == (
        "min airspeed 5 configured, AIRSPEED_MIN allows 12",
        "max airspeed 50 configured, AIRSPEED_MAX allows 30",
        "max bank 70 configured, ROLL_LIMIT_DEG allows 45",
        "max sink 9 configured, 0.9 TECS_SINK_MAX allows 3.6",
    )
    assert not in_effect(NOT_REPORTED, configured).warnings


@pytest.mark.parametrize(
    ("values", "configured", "expected"),
    [
        ({"AIRSPEED_MIN": 40.0}, {}, (40.0, 40.0)),  # faster than the assumed maximum
        ({"AIRSPEED_MAX": 12.0}, {}, (12.0, 12.0)),
        ({}, {"max_airspeed_mps": 10.0}, (10.0, 10.0)),
        ({"AIRSPEED_MAX": 20.0}, {"min_airspeed_mps": 25.0}, (16.0, 20.0)),  # the configured one is not used
    ],
)
def test_airspeeds_from_different_sources_never_cross(
    values: dict[str, float], configured: dict[str, float], expected: tuple[float, float]
) -> None:
    """A bank limit of 1e-6 rad leaves the minimum airspeed as reported."""
    limits = in_effect(ardupilot(values), AircraftLimits(max_bank_rad=1e-6, **configured))
    envelope = limits.envelope
    assert (envelope.min_airspeed_mps, envelope.max_airspeed_mps) == pytest.approx(expected)
    assert bool(limits.warnings) == ("min_airspeed_mps" in configured)


def test_each_limit_is_listed_in_words_with_its_source() -> None:
    limits = in_effect(ardupilot(NEW), AircraftLimits(max_climb_mps=2.5))
    assert [str(limit) for limit in limits.sourced] == [
        "min airspeed 14.27 m/s (AIRSPEED_MIN, banked)",
        "max airspeed 30 m/s (AIRSPEED_MAX)",
        "max bank 45 deg (ROLL_LIMIT_DEG)",
        "max climb 2.5 m/s (configured; 0.9 TECS_CLMB_MAX 4.5)",
        "max sink 3.6 m/s (0.9 TECS_SINK_MAX)",
        "loiter radius -60 m (WP_LOITER_RAD)",
    ]
