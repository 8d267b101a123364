"""Accuracy of reported positions and velocities, from what the sender states or from the kind of source."""

from typing import Final

from companion.model import TrafficReport, TrafficSource

# Standard deviations of each horizontal axis [m] if the sender states none. ADS-B, ADS-R: NACp 8, a 95 %
# radius of 93 m, which most installations keep (RTCA DO-260B, table 2-14). TIS-B: radar within 60 NM, a 95 %
# radius of 0.2 NM (RTCA DO-286B, 2.1.2); MLAT: 150 m RMS (EUROCAE ED-142). FLARM and Remote ID: satellite
# receivers, with the steps of a short-range message (ASTM F3411-22a, 95 % 10 to 30 m). UTM: a network of such
# receivers. Other autopilots send filtered positions.
TYPICAL_SIGMA_M: Final = {
    TrafficSource.ADSB: 30.0,
    TrafficSource.ADSR: 30.0,
    TrafficSource.TISB: 150.0,
    TrafficSource.MLAT: 100.0,
    TrafficSource.MODE_S: 1000.0,
    TrafficSource.FLARM: 10.0,
    TrafficSource.REMOTE_ID: 12.0,
    TrafficSource.UTM: 20.0,
    TrafficSource.SYSTEM: 5.0,
}
# The same of a velocity [m/s]: NACv 1 has a 95 % radius of 10 m/s, NACv 2 of 3 m/s (DO-260B, table 2-22).
_TYPICAL_SIGMA_MPS: Final = {
    TrafficSource.ADSB: 1.5,
    TrafficSource.ADSR: 1.5,
    TrafficSource.TISB: 5.0,
    TrafficSource.MLAT: 5.0,
    TrafficSource.MODE_S: 10.0,
    TrafficSource.FLARM: 1.0,
    TrafficSource.REMOTE_ID: 1.0,
    TrafficSource.UTM: 1.5,
    TrafficSource.SYSTEM: 0.5,
}
_TRANSPONDERS: Final = frozenset({TrafficSource.ADSB, TrafficSource.ADSR})
# A source with a lower rank identifies an aircraft in more places: the track takes its key.
RANK: Final = {source: number for number, source in enumerate(TYPICAL_SIGMA_M)} | {
    TrafficSource.ADSB: 0,
    TrafficSource.ADSR: 1,
    TrafficSource.MLAT: 2,
    TrafficSource.TISB: 3,
    TrafficSource.FLARM: 4,
    TrafficSource.REMOTE_ID: 5,
    TrafficSource.UTM: 6,
    TrafficSource.SYSTEM: 7,
    TrafficSource.MODE_S: 8,
}
# Stated errors beyond these mean the same: nothing is known.
_WORST_M, _WORST_MPS = 50_000.0, 1_000.0
# A normal error exceeds this many sigmas of an axis with the probability of SIL 1, 2, 3: sqrt(-2 ln P).
_CONTAINED_SIGMAS: Final = {1: 3.717, 2: 4.799, 3: 5.678}


def position_sigma_m(report: TrafficReport) -> float:
    """The standard deviation of each horizontal axis [m]: stated, contained, or typical of the source."""
    if report.position_sigma_m is not None and report.position_sigma_m > 0.0:
        return min(report.position_sigma_m, _WORST_M)
    sigmas = _CONTAINED_SIGMAS.get(report.sil or 0)
    if sigmas is not None and report.containment_m is not None and report.containment_m > 0.0:
        return min(report.containment_m / sigmas, _WORST_M)
    return TYPICAL_SIGMA_M[report.source]


def filter_sigma_m(report: TrafficReport) -> float | None:
    """The same for a filter; `None`: the usual one, of transponders, which are better than typical."""
    if report.position_sigma_m is None and report.source in _TRANSPONDERS:
        return None
    return position_sigma_m(report)


def velocity_sigma_mps(report: TrafficReport) -> float:
    """The standard deviation of each horizontal axis of a stated velocity [m/s]."""
    if report.velocity_sigma_mps is not None and report.velocity_sigma_mps > 0.0:
        return min(report.velocity_sigma_mps, _WORST_MPS)
    return _TYPICAL_SIGMA_MPS[report.source]
