"""What the autopilots' parameters say of the aircraft: names of new and old versions, and their units."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from companion.airspace.autopilot_fences import FenceSettings, ardupilot_fence, px4_fence

_DEG = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class Limits:
    """The aircraft's limits; `None` is unknown. A `loiter_radius_m` below 0 turns left."""

    min_airspeed_mps: float | None = None
    max_airspeed_mps: float | None = None
    cruise_airspeed_mps: float | None = None
    max_bank_rad: float | None = None
    max_climb_mps: float | None = None
    max_sink_mps: float | None = None
    loiter_radius_m: float | None = None


@dataclass(frozen=True, slots=True)
class Named:
    """A parameter, and what one of its units is in ours."""

    name: str
    scale: float = 1.0


@dataclass(frozen=True, slots=True)
class LimitSource:
    """Where a field of `Limits` is found: under one of these names, the newest first."""

    field: str
    names: tuple[Named, ...]


@dataclass(frozen=True, slots=True)
class ParameterTable:
    """All parameters of one autopilot that are of interest.

    Of several `limits` for one field the tightest counts. `fence` turns the values into what its fence is.
    `mission_total` and `fence_total` count the items of a list, where there are such parameters.
    `stall_prevention`: at low airspeed the autopilot gives less bank than its limit, rather than more speed.
    """

    limits: tuple[LimitSource, ...]
    # Asked before all others: whether to fly at all, and what becomes of the aircraft if we die.
    first: tuple[str, ...]
    others: tuple[str, ...]
    fence: Callable[[Mapping[str, float]], FenceSettings]
    mission_total: str | None = None
    fence_total: str | None = None
    stall_prevention: bool = False

    def questions(self) -> tuple[tuple[str, ...], ...]:
        """What to ask for: the alternative names of each parameter."""
        totals = tuple((name,) for name in (self.mission_total, self.fence_total) if name is not None)
        limits = tuple(tuple(named.name for named in limit.names) for limit in self.limits)
        return (*((name,) for name in self.first), *limits, *((name,) for name in self.others), *totals)


# Before ArduPlane 4.5 some were called otherwise, and had other units.
ARDUPLANE = ParameterTable(
    limits=(
        LimitSource("min_airspeed_mps", (Named("AIRSPEED_MIN"), Named("ARSPD_FBW_MIN"))),
        LimitSource("max_airspeed_mps", (Named("AIRSPEED_MAX"), Named("ARSPD_FBW_MAX"))),
        LimitSource("cruise_airspeed_mps", (Named("AIRSPEED_CRUISE"), Named("TRIM_ARSPD_CM", 0.01))),
        LimitSource("max_bank_rad", (Named("ROLL_LIMIT_DEG", _DEG), Named("LIM_ROLL_CD", 0.01 * _DEG))),
        LimitSource("max_climb_mps", (Named("TECS_CLMB_MAX"),)),
        LimitSource("max_sink_mps", (Named("TECS_SINK_MAX"),)),
        LimitSource("loiter_radius_m", (Named("WP_LOITER_RAD"),)),
    ),
    first=("AVD_ENABLE", "AVD_F_ACTION"),
    others=(
        "FENCE_ENABLE",
        "FENCE_ACTION",
        "FENCE_AUTOENABLE",
        "FENCE_TYPE",
        "FENCE_OPTIONS",
        "FENCE_RADIUS",
        "FENCE_ALT_MIN",
        "FENCE_ALT_MAX",
        "FENCE_MARGIN",
    ),
    fence=ardupilot_fence,
    mission_total="MIS_TOTAL",
    fence_total="FENCE_TOTAL",
    stall_prevention=True,
)

PX4 = ParameterTable(
    limits=(
        LimitSource("min_airspeed_mps", (Named("FW_AIRSPD_MIN"),)),
        LimitSource("max_airspeed_mps", (Named("FW_AIRSPD_MAX"),)),
        LimitSource("cruise_airspeed_mps", (Named("FW_AIRSPD_TRIM"),)),
        LimitSource("max_bank_rad", (Named("FW_R_LIM", _DEG),)),
        LimitSource("max_climb_mps", (Named("FW_T_CLMB_MAX"),)),
        LimitSource("max_sink_mps", (Named("FW_T_SINK_MAX"),)),
        # To a new height it climbs and sinks at these rates, well below what it could.
        LimitSource("max_climb_mps", (Named("FW_T_CLMB_R_SP"),)),
        LimitSource("max_sink_mps", (Named("FW_T_SINK_R_SP"),)),
        LimitSource("loiter_radius_m", (Named("NAV_LOITER_RAD"),)),
    ),
    first=("COM_OBL_RC_ACT", "NAV_TRAFF_AVOID"),
    others=(
        "GF_ACTION",
        "GF_MAX_HOR_DIST",
        "GF_MAX_VER_DIST",
        "COM_OF_LOSS_T",
    ),
    fence=px4_fence,
)
