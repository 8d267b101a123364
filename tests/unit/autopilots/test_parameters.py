"""The limits that parameters report, without implausible and contradictory ones."""

import math
from collections.abc import Callable

import pytest

from companion.autopilots import ArduPlane, Px4FixedWing
from companion.autopilots.parameters import ReportedLimits, reported_limits

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


def ardupilot(values: dict[str, float]) -> ReportedLimits:
    return reported_limits(values, ArduPlane.parameters)


def px4(values: dict[str, float]) -> ReportedLimits:
    return reported_limits(values, Px4FixedWing.parameters)


@pytest.mark.parametrize(("values", "autopilot"), [(NEW, ardupilot), (OLD, ardupilot), (OF_PX4, px4)])
def test_all_names_and_units_give_the_same_limits(
    values: dict[str, float], autopilot: Callable[[dict[str, float]], ReportedLimits]
) -> None:
    limits = autopilot(values).limits
    assert (limits.min_airspeed_mps, limits.max_airspeed_mps, limits.cruise_airspeed_mps) == (
        12.0,
        30.0,
        20.0,
    )
    assert limits.max_bank_rad == pytest.approx(math.radians(45.0))
    assert (limits.max_climb_mps, limits.max_sink_mps, limits.loiter_radius_m) == (5.0, 4.0, -60.0)


def test_the_new_name_takes_precedence_over_the_old_one() -> None:
    reported = ardupilot({"ROLL_LIMIT_DEG": 40.0, "LIM_ROLL_CD": 6500.0})
    assert reported.limits.max_bank_rad == pytest.approx(math.radians(40.0))
    assert reported.parameters == {"max_bank_rad": "ROLL_LIMIT_DEG"}


def test_the_tighter_of_two_parameters_for_one_limit_counts() -> None:
    reported = px4({**OF_PX4, "FW_T_CLMB_R_SP": 3.0, "FW_T_SINK_R_SP": 9.0})
    assert (reported.limits.max_climb_mps, reported.limits.max_sink_mps) == (3.0, 4.0)
    assert reported.parameters["max_climb_mps"] == "FW_T_CLMB_R_SP"


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
def test_an_implausible_value_is_not_used_and_warned_of(name: str, value: float, field: str) -> None:
    reported = ardupilot({**NEW, name: value})
    assert getattr(reported.limits, field) is None
    assert field not in reported.parameters
    assert reported.warnings == (f"{name} {value:g} implausible, not used",)


def test_contradictory_airspeeds_are_not_used() -> None:
    reported = ardupilot({**NEW, "AIRSPEED_MIN": 30.0, "AIRSPEED_MAX": 12.0})
    assert (reported.limits.min_airspeed_mps, reported.limits.max_airspeed_mps) == (None, None)
    assert reported.limits.cruise_airspeed_mps == 20.0
    assert reported.warnings == ("AIRSPEED_MIN and AIRSPEED_MAX contradictory, not used",)
    beyond = ardupilot({**NEW, "AIRSPEED_CRUISE": 35.0})
    assert beyond.limits.cruise_airspeed_mps is None
    assert beyond.limits.max_airspeed_mps == 30.0
