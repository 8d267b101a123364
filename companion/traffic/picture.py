"""The traffic around us: reports from every source as tracks in the local frame."""

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
from companion.traffic import OwnHeights, OwnMotion, Tracker, TrafficParams
from companion.traffic.mavlink_traffic import MavlinkTraffic


class TrafficPicture:
    """Facts in, tracks out. Its clock is the engine's."""

    def __init__(self, params: TrafficParams) -> None:
        self.tracker = Tracker(params)
        self._heights = OwnHeights(params.heights)
        self._neighbours = MavlinkTraffic()

    def observe_ownship(self, fact: Fact, now_s: float) -> None:
        """What our own autopilot says of itself, as far as it helps with others."""
        match fact:
            case OwnPosition():
                self._observe_position(fact, now_s)
            case PressureAltitude():
                self._heights.learn_pressure(fact.altitude_m, now_s)
            case GeoidSeparation():
                self._heights.learn_separation(fact.separation_m)
            case Parameter() if fact.name == OWN_ICAO_PARAMETER and fact.value >= 1.0:
                self.tracker.learn_own(int(fact.value))
            case OwnTransponder():
                self.tracker.learn_own(fact.icao)
            case _:
                pass

    def receive(self, fact: Fact, now_s: float) -> str | None:
        """What somebody reports, of others or of himself; the id of the track that is renewed by it."""
        report = fact.report if isinstance(fact, Traffic) else self._neighbours.observe(fact, now_s)
        if report is None:
            return None
        self.tracker.datums = self._heights.datums(now_s)
        return self.tracker.receive(report, now_s)

    def tracks(self, now_s: float, frame: LocalFrame) -> tuple[Track, ...]:
        """Everything to keep clear of, in the local frame, as of now."""
        self.tracker.datums = self._heights.datums(now_s)
        return self.tracker.tracks(now_s, frame)

    def _observe_position(self, fact: OwnPosition, now_s: float) -> None:
        self._heights.learn_altitude(fact.altitude_m)
        north_mps, east_mps, down_mps = fact.velocity_mps
        self.tracker.note_own(
            OwnMotion(now_s, fact.lat_deg, fact.lon_deg, fact.altitude_m, north_mps, east_mps, -down_mps)
        )
