"""ArduPlane's parameters, by the names of 4.7 or of 4.3, and the limits that they set."""

from typing import Literal, get_args

from sim.vehicle.parameters import INT8, INT16, INT32, REAL32, Limits, Parameters, Row

Firmware = Literal["4.7", "4.3"]

# Measured: with TECS_CLMB_MAX 5, climbs and descents were flown at 4.8 m/s.
_CLIMB_EFFICIENCY = 0.96

_TABLE: tuple[Row, ...] = (
    ("ADSB_ICAO_ID", 0, INT32),
    ("ADSB_LIST_MAX", 25, INT16),
    ("ADSB_LIST_RADIUS", 10_000, INT16),
    ("ADSB_TYPE", 1, INT8),
    ("AIRSPEED_CRUISE", 22, REAL32),
    ("AIRSPEED_MAX", 30, INT16),
    ("AIRSPEED_MIN", 10, INT16),
    ("AVD_ENABLE", 0, INT8),
    ("AVD_F_ACTION", 1, INT8),
    ("AVD_F_DIST_XY", 300, REAL32),
    ("AVD_F_DIST_Z", 100, REAL32),
    ("AVD_F_RCVRY", 1, INT8),
    ("FENCE_ACTION", 1, INT8),
    ("FENCE_ALT_MAX", 100, REAL32),
    ("FENCE_ALT_MIN", -10, REAL32),
    ("FENCE_ENABLE", 0, REAL32),
    ("FENCE_TOTAL", 0, INT8),
    ("FENCE_TYPE", 4, INT8),
    ("FS_GCS_ENABL", 0, INT8),
    ("FS_LONG_ACTN", 0, INT8),
    ("FS_LONG_TIMEOUT", 5, REAL32),
    ("FS_SHORT_ACTN", 0, INT8),
    ("FS_SHORT_TIMEOUT", 1.5, REAL32),
    ("MIS_TOTAL", 0, INT16),
    ("ROLL_LIMIT_DEG", 45, REAL32),
    ("RTL_ALTITUDE", 100, REAL32),
    ("RTL_AUTOLAND", 0, INT8),
    ("SERIAL0_PROTOCOL", 2, INT8),
    ("SIM_SPEEDUP", 1, REAL32),  # shows that this is a simulation, as in ArduPilot's own
    ("STAT_RUNTIME", 0, INT32),
    ("SYSID_THISMAV", 1, INT16),
    ("TECS_CLMB_MAX", 5, REAL32),
    ("TECS_SINK_MAX", 5, REAL32),
    ("TKOFF_ALT", 50, REAL32),
    ("WP_LOITER_RAD", 60, INT16),
    ("WP_RADIUS", 90, INT16),
)
_READ_ONLY = frozenset({"FENCE_TOTAL", "MIS_TOTAL", "STAT_RUNTIME", "SYSID_THISMAV"})

# The name in 4.3, its type, and the factor from the unit of 4.7 to that of 4.3.
_OLD_NAMES: dict[str, tuple[str, int, float]] = {
    "AIRSPEED_CRUISE": ("TRIM_ARSPD_CM", INT32, 100.0),
    "AIRSPEED_MAX": ("ARSPD_FBW_MAX", INT16, 1.0),
    "AIRSPEED_MIN": ("ARSPD_FBW_MIN", INT16, 1.0),
    "ROLL_LIMIT_DEG": ("LIM_ROLL_CD", INT16, 100.0),
    "RTL_ALTITUDE": ("ALT_HOLD_RTL", INT32, 100.0),
}


def parameters_of(firmware: Firmware) -> Parameters:
    """The defaults under the names of that version; ValueError for an unsupported version."""
    if firmware not in get_args(Firmware):
        raise ValueError(f"firmware {firmware!r} is none of {', '.join(get_args(Firmware))}")
    rows = _TABLE if firmware == "4.7" else tuple(map(_as_of_4_3, _TABLE))
    return Parameters(sorted(rows), _READ_ONLY)


def _as_of_4_3(row: Row) -> Row:
    name, value, kind = row
    if name not in _OLD_NAMES:
        return row
    name, kind, factor = _OLD_NAMES[name]
    return name, value * factor, kind


def limits_of(values: Parameters) -> Limits:
    """The flight limits, by either version's names."""
    return Limits(
        airspeed_min_mps=_value(values, "AIRSPEED_MIN"),
        airspeed_cruise_mps=_value(values, "AIRSPEED_CRUISE"),
        airspeed_max_mps=_value(values, "AIRSPEED_MAX"),
        bank_deg=_value(values, "ROLL_LIMIT_DEG"),
        climb_mps=_CLIMB_EFFICIENCY * values["TECS_CLMB_MAX"],
        sink_mps=_CLIMB_EFFICIENCY * values["TECS_SINK_MAX"],
        loiter_radius_m=values["WP_LOITER_RAD"],
        turn_radius_m=values["WP_RADIUS"],
        rtl_height_m=_value(values, "RTL_ALTITUDE"),
        takeoff_height_m=values["TKOFF_ALT"],
    )


def _value(values: Parameters, name: str) -> float:
    if name in values:
        return values[name]
    old_name, _, factor = _OLD_NAMES[name]
    return values[old_name] / factor
