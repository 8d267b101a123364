"""Recordings of real autopilots to which the fakes are held; they are not part of the repository."""

from tests.support.paths import SHARED

_NAMES = (
    "flights/arduplane_48_flown_by_companion_basic.tlog",
    "flights/arduplane_48_flown_by_companion_hard.tlog",
    "flights/px4_118_flown_by_companion.tlog",
    "tlogs/arduplane_sitl_adsb_two_intruders.tlog",
    "tlogs/px4_sih_fixed_wing_adsb_two_intruders.tlog",
)
RECORDINGS = [SHARED / name for name in _NAMES if (SHARED / name).exists()]
