"""The traffic around us: facts from every source in, tracks in the local frame out."""

from companion.geodesy import LocalFrame
from companion.mavlink.facts import (
    OWN_ICAO_PARAMETER,
    Fact,
    GeoidSeparation,
    OwnPosition,
    OwnTransponder,
    Parameter,
    PressureAltitude,
    Traffic,
)
from companion.model import Track
from companion.traffic.altitude_datums import OwnshipAltitudes
from companion.traffic.mavlink_traffic import MavlinkTraffic
from companion.traffic.ownship_echo import OwnshipFix
from companion.traffic.params import TrafficParams
from companion.traffic.tracker import Tracker


class TrafficPicture:
    """Turns facts into tracks. Times are those of the engine's clock."""

    def __init__(self, params: TrafficParams) -> None:
        self.tracker = Tracker(params)
        self._own_altitudes = OwnshipAltitudes(params.heights)
        self._mavlink_traffic = MavlinkTraffic()

    def observe_ownship(self, fact: Fact, now_s: float) -> None:
        """Process a fact of our own autopilot: position, altitude references and transponder address."""
        match fact:
            case OwnPosition():
                self._observe_position(fact, now_s)
            case PressureAltitude():
                self._own_altitudes.observe_pressure_altitude(fact.altitude_m, now_s)
            case GeoidSeparation():
                self._own_altitudes.observe_geoid_separation(fact.separation_m)
            case Parameter() if fact.name == OWN_ICAO_PARAMETER and fact.value >= 1.0:
                self.tracker.add_own_address(int(fact.value))
            case OwnTransponder():
                self.tracker.add_own_address(fact.icao)
            case _:
                pass

    def receive(self, fact: Fact, now_s: float) -> str | None:
        """Process a traffic report, or a fact of another MAVLink system.

        Returns the id of the track that it updates, `None` if there is none.
        """
        report = fact.report if isinstance(fact, Traffic) else self._mavlink_traffic.observe(fact, now_s)
        if report is None:
            return None
        return self.tracker.receive(report, now_s, self._own_altitudes.offsets(now_s))

    def tracks(self, now_s: float, frame: LocalFrame) -> tuple[Track, ...]:
        """All tracks in the local frame, extrapolated to `now_s`, ordered by `track_id`."""
        return self.tracker.tracks(now_s, frame, self._own_altitudes.offsets(now_s))

    def _observe_position(self, fact: OwnPosition, now_s: float) -> None:
        self._own_altitudes.observe_altitude(fact.altitude_m)
        north_mps, east_mps, down_mps = fact.velocity_mps
        self.tracker.observe_ownship(
            OwnshipFix(now_s, fact.lat_deg, fact.lon_deg, fact.altitude_m, north_mps, east_mps, -down_mps)
        )
