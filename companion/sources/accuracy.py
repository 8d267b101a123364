"""Accuracy categories of ADS-B as standard deviations and radii.

Source: RTCA DO-260B (1090 MHz) and DO-282B (978 MHz), tables of NACp, NACv and NIC; both use the same codes.
A category bounds a 95 % error; a circular normal error has 95 % inside 2.448 sigma, one axis 1.960 sigma.
"""

from typing import Final

_NAUTICAL_MILE_M: Final = 1852.0
_RADIAL_95: Final = 2.448
_AXIS_95: Final = 1.960

# Estimated position uncertainty, horizontal radius [m].
_NACP_HORIZONTAL_M: Final = {
    1: 10.0 * _NAUTICAL_MILE_M,
    2: 4.0 * _NAUTICAL_MILE_M,
    3: 2.0 * _NAUTICAL_MILE_M,
    4: 1.0 * _NAUTICAL_MILE_M,
    5: 0.5 * _NAUTICAL_MILE_M,
    6: 0.3 * _NAUTICAL_MILE_M,
    7: 0.1 * _NAUTICAL_MILE_M,
    8: 0.05 * _NAUTICAL_MILE_M,
    9: 30.0,
    10: 10.0,
    11: 3.0,
}
# Geometric altitude, 95 % [m]; the categories below say nothing of it.
_NACP_VERTICAL_M: Final = {9: 45.0, 10: 15.0, 11: 4.0}
# Horizontal velocity, 95 % radius [m/s].
_NACV_MPS: Final = {1: 10.0, 2: 3.0, 3: 1.0, 4: 0.3}
# Containment radius [m]; the larger one where a supplement bit would tell two apart.
_NIC_M: Final = {
    1: 20.0 * _NAUTICAL_MILE_M,
    2: 8.0 * _NAUTICAL_MILE_M,
    3: 4.0 * _NAUTICAL_MILE_M,
    4: 2.0 * _NAUTICAL_MILE_M,
    5: 1.0 * _NAUTICAL_MILE_M,
    6: 0.6 * _NAUTICAL_MILE_M,
    7: 0.2 * _NAUTICAL_MILE_M,
    8: 0.1 * _NAUTICAL_MILE_M,
    9: 75.0,
    10: 25.0,
    11: 7.5,
}


def position_sigma_m(nacp: int | None) -> float | None:
    """The standard deviation of each horizontal axis [m]; `None` for an unknown accuracy."""
    radius_m = None if nacp is None else _NACP_HORIZONTAL_M.get(nacp)
    return None if radius_m is None else radius_m / _RADIAL_95


def altitude_sigma_m(nacp: int | None) -> float | None:
    """The standard deviation of a geometric altitude [m]; `None` for an unknown accuracy."""
    error_m = None if nacp is None else _NACP_VERTICAL_M.get(nacp)
    return None if error_m is None else error_m / _AXIS_95


def velocity_sigma_mps(nacv: int | None) -> float | None:
    """The standard deviation of each horizontal axis [m/s]; `None` for an unknown accuracy."""
    radius_mps = None if nacv is None else _NACV_MPS.get(nacv)
    return None if radius_mps is None else radius_mps / _RADIAL_95


def containment_m(nic: int | None) -> float | None:
    """The containment radius [m]; `None` for an unknown integrity."""
    return None if nic is None else _NIC_M.get(nic)
