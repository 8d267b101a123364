"""The picture of the traffic around us: a tracker, and the facts that it needs besides reports of traffic.

A traffic report goes to the tracker at once. Here are the facts of our own aircraft, which make altitudes
comparable, and those of other MAVLink systems, which become reports.
"""

import math

from companion.mavlink.facts import (
    OWN_ICAO_PARAMETER,
    Fact,
    GeoidSeparation,
    HomePosition,
    MemberIntent,
    OwnPosition,
    OwnTransponder,
    Parameter,
    PressureAltitude,
    ReceiverOwnship,
    Traffic,
)
from companion.model import AltitudeReference
from companion.traffic.altitudes import OwnshipAltitudes
from companion.traffic.mavlink_traffic import MavlinkTraffic
from companion.traffic.members import MemberParams, Members
from companion.traffic.own_aircraft import OwnshipFix
from companion.traffic.params import TrafficParams
from companion.traffic.tracker import Tracker
from companion.traffic.triage import Urgency

# A receiver on board is where we are, and reports it within this time. Its pressure altitude is used while
# our autopilot sends none.
_ON_BOARD_M, _ON_BOARD_S = 150.0, 3.0
_PRESSURE_MISSING_S = 10.0


class TrafficPicture:
    """Brings facts to the tracker. Times are those of the engine's clock."""

    def __init__(self, params: TrafficParams, members: MemberParams | None = None) -> None:
        self._members = Members(members) if members is not None and members.system_ids else None
        self._own_altitudes = OwnshipAltitudes(params.heights)
        mark = None if self._members is None else self._members.marked
        self.tracker = Tracker(params, self._own_altitudes.offsets, mark)
        if self._members is not None:
            self.tracker.own_identity.is_member = self._members.includes_key
        self._mavlink_traffic = MavlinkTraffic()
        self._pressure_s = -math.inf  # of our autopilot

    def observe_ownship(self, fact: Fact, now_s: float) -> None:
        """Process a fact of our own autopilot: position, altitude references and transponder address."""
        match fact:
            case OwnPosition():
                self._observe_position(fact, now_s)
            case PressureAltitude():
                self._pressure_s = now_s
                self._own_altitudes.observe_pressure_altitude(fact.altitude_m, now_s)
            case GeoidSeparation():
                self._own_altitudes.observe_geoid_separation(fact.separation_m)
            case HomePosition():
                around = self.tracker.surroundings
                self.tracker.surroundings = around._replace(home=(fact.lat_deg, fact.lon_deg))
            case Parameter() if fact.name == OWN_ICAO_PARAMETER and fact.value >= 1.0:
                self.tracker.add_own_address(int(fact.value))
            case OwnTransponder():
                self.tracker.add_own_address(fact.icao)
            case _:
                pass

    def observe_receiver(self, fact: ReceiverOwnship, now_s: float) -> None:
        """Process a receiver's report of the aircraft that carries it: ours only if it is where we are."""
        report = fact.report
        if report.lat_deg is None or report.lon_deg is None:
            return
        away_m = self.tracker.own_distance_m(report.time_s, (report.lat_deg, report.lon_deg))
        if away_m is None or away_m > _ON_BOARD_M or abs(now_s - report.time_s) > _ON_BOARD_S:
            return
        if report.icao is not None:
            self.tracker.add_own_address(report.icao)
        if now_s - self._pressure_s <= _PRESSURE_MISSING_S or report.altitude_m is None:
            return
        if report.altitude_reference is AltitudeReference.BAROMETRIC and math.isfinite(report.altitude_m):
            self._own_altitudes.observe_pressure_altitude(report.altitude_m, now_s)

    def urgency(self, fact: Fact, now_s: float) -> Urgency | None:
        """How soon a report is to be processed, while there are too many; `None` for other facts."""
        report = fact.report if isinstance(fact, Traffic) else None
        if isinstance(fact, OwnPosition):
            report = self._mavlink_traffic.observe(fact, now_s)
        if report is None:
            return None
        return self.tracker.urgency(report, now_s)

    def receive(self, fact: Fact, now_s: float) -> str | None:
        """Process a fact of another MAVLink system; returns the id of the track that it updates, if any."""
        if isinstance(fact, MemberIntent):
            if self._members is not None:
                self._members.observe_intent(fact, now_s)
            return None
        report = self._mavlink_traffic.observe(fact, now_s)
        if report is None:
            return None
        track_id = self.tracker.receive(report, now_s, fact.sender)
        if self._members is not None and track_id is not None and isinstance(fact, OwnPosition):
            self._members.note_track(fact.sender.system_id, track_id, now_s)
        return track_id

    def _observe_position(self, fact: OwnPosition, now_s: float) -> None:
        self._own_altitudes.observe_altitude(fact.altitude_m)
        around = self.tracker.surroundings
        home_m = fact.altitude_m - fact.height_above_home_m
        self.tracker.surroundings = around._replace(home_altitude_m=home_m)
        north_mps, east_mps, down_mps = fact.velocity_mps
        self.tracker.observe_ownship(
            OwnshipFix(now_s, fact.lat_deg, fact.lon_deg, fact.altitude_m, north_mps, east_mps, -down_mps)
        )
