"""Our own addresses: claims of several messages, which an aircraft elsewhere refutes."""

import math
from typing import Final

from companion.geodesy import LocalFrame
from companion.model import TrafficReport, TrafficSource, adsb_key, uas_key
from companion.traffic.altitude_datums import SeaLevelAltitude
from companion.traffic.own_trail import OwnTrail
from companion.traffic.ownship_echo import Identity
from companion.traffic.params import TrafficParams
from companion.traffic.target import Target

# We are reported late and displaced, but no further from where we are than this, and as far as we fly in this
# time.
_ELSEWHERE_M, _ELSEWHERE_S, _OTHER_HEIGHT_M = 500.0, 10.0, 150.0
_ELSEWHERE_REPORTS: Final = 2
# Messages may call so many addresses ours; then the oldest claim is forgotten.
_MOST_CLAIMS: Final = 8
# Of traffic that is not known by an address of its own, but by a number that a ground station gave it.
_NAMELESS: Final = frozenset({TrafficSource.TISB, TrafficSource.ADSR})


class OwnIdentity:
    """The addresses that are ours as far as is known, and those that are not, whoever says so."""

    def __init__(self, params: TrafficParams, trail: OwnTrail) -> None:
        self._trail = trail
        self._icao = dict.fromkeys(sorted(params.own_icao))
        self._configured = len(self._icao)
        self._uas_key = None if params.own_uas_id is None else uas_key(params.own_uas_id)
        self._elsewhere: dict[str, int] = {}
        self.refuted: dict[str, float] = {}  # by key, with the time

    def claim(self, icao: int) -> str | None:
        """Note that a message calls an address ours; returns its key, `None` if it is not believed."""
        key = adsb_key(icao)
        if icao <= 0 or key in self.refuted:
            return None
        self._icao[icao] = None
        if len(self._icao) > self._configured + _MOST_CLAIMS:
            del self._icao[list(self._icao)[self._configured]]
        return key

    def is_claimed(self, report: TrafficReport) -> bool:
        """Whether the report has one of our identifiers."""
        if report.key in self.refuted:
            return False
        return report.icao in self._icao or report.key == self._uas_key

    def identify(self, target: Target, altitude: SeaLevelAltitude | None) -> Identity:
        """Whose a target is by its identifier, and by where it flies."""
        if target.icao in self._icao or target.key == self._uas_key:
            if target.key not in self.refuted and not self._refute(target, altitude):
                return Identity.OURS
            return Identity.UNKNOWN
        if target.anonymous or target.source in _NAMELESS:
            return Identity.UNKNOWN
        if target.source is TrafficSource.SYSTEM:
            return Identity.NEIGHBOUR
        known_ours = bool(self._icao) if target.icao is not None else self._uas_key is not None
        return Identity.ANOTHERS if known_ours else Identity.UNKNOWN

    def _refute(self, target: Target, altitude: SeaLevelAltitude | None) -> bool:
        """Count reports of one of our identifiers elsewhere; True after several: it is another's."""
        newest = target.last
        own = self._trail.at(newest.time_s)
        if own is None:
            return False
        north_m, east_m = LocalFrame(own.lat_deg, own.lon_deg).to_north_east_m(newest.lat_deg, newest.lon_deg)
        reach_m = _ELSEWHERE_M + _ELSEWHERE_S * math.hypot(own.north_mps, own.east_mps)
        elsewhere = math.hypot(north_m, east_m) > reach_m
        if altitude is not None:
            elsewhere |= abs(altitude.altitude_m - own.altitude_m) > _OTHER_HEIGHT_M + altitude.uncertainty_m
        count = self._elsewhere.get(target.track_id, 0) + 1 if elsewhere else 0
        self._elsewhere[target.track_id] = count
        if count < _ELSEWHERE_REPORTS:
            return False
        self.refuted[target.key] = newest.received_s
        return True
