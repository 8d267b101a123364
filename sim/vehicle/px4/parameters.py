"""PX4's parameters, and the limits that they set."""

from typing import get_args

from sim.vehicle.parameters import INT32, REAL32, Limits, Parameters, Row
from sim.vehicle.px4.modes import Firmware

_TABLE: tuple[Row, ...] = (
    ("COM_DISARM_LAND", 2, REAL32),
    ("COM_DL_LOSS_T", 10, INT32),
    ("COM_OBL_RC_ACT", 0, INT32),
    ("COM_OF_LOSS_T", 1, REAL32),
    ("COM_RC_IN_MODE", 0, INT32),
    ("COM_RC_OVERRIDE", 1, INT32),
    ("FW_AIRSPD_MAX", 20, REAL32),
    ("FW_AIRSPD_MIN", 10, REAL32),
    ("FW_AIRSPD_STALL", 7, REAL32),
    ("FW_AIRSPD_TRIM", 15, REAL32),
    ("FW_P_LIM_MAX", 30, REAL32),
    ("FW_P_LIM_MIN", -30, REAL32),
    ("FW_R_LIM", 50, REAL32),
    ("FW_THR_TRIM", 0.6, REAL32),
    ("FW_T_ALT_TC", 5, REAL32),
    ("FW_T_CLMB_MAX", 5, REAL32),
    ("FW_T_CLMB_R_SP", 3, REAL32),
    ("FW_T_SINK_MAX", 5, REAL32),
    ("FW_T_SINK_MIN", 2, REAL32),
    ("FW_T_SINK_R_SP", 2, REAL32),
    ("GF_ACTION", 2, INT32),
    ("GF_MAX_HOR_DIST", 0, REAL32),
    ("GF_MAX_VER_DIST", 0, REAL32),
    ("MAV_SYS_ID", 1, INT32),
    ("MIS_TAKEOFF_ALT", 30, REAL32),
    ("NAV_ACC_RAD", 10, REAL32),
    ("NAV_DLL_ACT", 0, INT32),
    ("NAV_FW_ALT_RAD", 10, REAL32),
    ("NAV_LOITER_RAD", 80, REAL32),
    ("NAV_RCL_ACT", 2, INT32),
    ("NAV_TRAFF_AVOID", 1, INT32),
    ("NAV_TRAFF_A_HOR", 500, REAL32),
    ("NAV_TRAFF_A_VER", 500, REAL32),
    ("NAV_TRAFF_COLL_T", 60, INT32),
    ("RTL_DESCEND_ALT", 30, REAL32),
    ("RTL_RETURN_ALT", 60, REAL32),
    ("SYS_AUTOSTART", 2100, INT32),
)
# What 1.18 has in addition, in the build with the conflict model after ASTM F3442.
_SINCE_1_18: tuple[Row, ...] = (
    ("COM_TRAFF_AVOID", 0, INT32),
    ("DAA_EN", 1, INT32),
    ("DAA_LVL_CRIT_ACT", 1, INT32),
    ("DAA_LVL_CRIT_HGT", 16, REAL32),
    ("DAA_LVL_CRIT_RAD", 77, REAL32),
    ("DAA_LVL_HIGH_ACT", 1, INT32),
    ("DAA_LVL_HIGH_HGT", 39, REAL32),
    ("DAA_LVL_HIGH_RAD", 305, REAL32),
    ("DAA_LVL_LOW_ACT", 1, INT32),
    ("DAA_LVL_LOW_TIME", 33, INT32),
    ("DAA_LVL_MED_ACT", 1, INT32),
    ("DAA_LVL_MED_TIME", 33, INT32),
)
_READ_ONLY = frozenset({"MAV_SYS_ID"})

# Distance before a square corner at which the path follower turns, independent of NAV_ACC_RAD.
_TURN_RADIUS_M = 60.0


def default_parameters(firmware: Firmware = "1.16") -> Parameters:
    """The defaults of a small fixed wing; ValueError for an unsupported version."""
    if firmware not in get_args(Firmware):
        raise ValueError(f"firmware {firmware!r} is none of {', '.join(get_args(Firmware))}")
    added = _SINCE_1_18 if firmware == "1.18" else ()
    return Parameters(sorted((*_TABLE, *added)), _READ_ONLY)


def limits_of(values: Parameters) -> Limits:
    """The flight limits. Climb and sink rates are FW_T_*_R_SP; FW_T_*_MAX only bound them."""
    return Limits(
        airspeed_min_mps=values["FW_AIRSPD_MIN"],
        airspeed_cruise_mps=values["FW_AIRSPD_TRIM"],
        airspeed_max_mps=values["FW_AIRSPD_MAX"],
        bank_deg=values["FW_R_LIM"],
        climb_mps=min(values["FW_T_CLMB_MAX"], values["FW_T_CLMB_R_SP"]),
        sink_mps=min(values["FW_T_SINK_MAX"], values["FW_T_SINK_R_SP"]),
        loiter_radius_m=values["NAV_LOITER_RAD"],
        turn_radius_m=max(values["NAV_ACC_RAD"], _TURN_RADIUS_M),
        rtl_height_m=values["RTL_RETURN_ALT"],
        takeoff_height_m=values["MIS_TAKEOFF_ALT"],
    )
