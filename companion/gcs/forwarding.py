"""Traffic that others than the autopilot hear, sent on as ADSB_VEHICLE: which aircraft, and when.

Sent are the places of the tracks: the best of all sources, above mean sea level, as of `tslc` ago. Only news
is sent. A track that is coasted has none, and who reads our messages forgets it by itself. Members of our
formation are not sent: the autopilot's own avoidance would avoid them.
"""

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass
from heapq import nsmallest
from typing import Final, NamedTuple

from companion.gcs.made_up_addresses import MadeUpAddresses
from companion.gcs.sent_reports import SentReports
from companion.geodesy import LocalFrame, wrap_two_pi
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import RECEIVER, Fact, Sender, Traffic
from companion.mavlink.translate.adsb import vehicle_message
from companion.model import AltitudeReference, Ownship, Track, TrackState, TrafficReport, TrafficSource, Vec3
from companion.output.effects import Place
from companion.traffic.params import Forward

# At most five a second, 50 bytes each: 4 % of a radio with 57600 baud.
_SPACING_S: Final = 0.2
# Each aircraft at most once a second; those that may be here soon come first, the others by turns.
_INTERVAL_S, _NEAR_S = 1.0, 60.0
# The nearest are chosen once a second, as many as ArduPilot's list has room for.
_NEAREST, _CHOSEN_AGAIN_S = 25, 1.0
# Among so many of the nearest: some of them are heard there, too.
_SORTED: Final = 250
# What approaches slower, or flies away, counts as approaching like this: it may turn.
_LEAST_CLOSING_MPS: Final = 5.0
# An aircraft that is heard there, too, is not sent there for this time. A height counts as barometric for as
# long after a barometric report.
_THERE_S: Final = 10.0
# It is not sent for this time after the last report of others: the track is that of other sources.
_HEARD_S: Final = 30.0
# A report of a MAVLink system is no news for this time after the system itself was heard.
_SYSTEM_HEARD_S: Final = 5.0
# Heartbeats go on for this time after the last report: PX4 may return home (COM_TRAFF_AVOID) when they end.
_FEEDING_S: Final = 10.0
_HEARTBEAT_INTERVAL_S: Final = 1.0
# A rate that is not stated is known after so many reports of the place that it follows from.
_LEAST_REPORTS: Final = 4
_LEAST_COURSE_MPS: Final = 1.0
_LATEST_S, _EARLY_S = 0.5, 1e-3


@dataclass(slots=True)
class _Heard:
    """What is known of a track besides its motion; `measured_s` is of the place that was sent last."""

    heard_s: float = -math.inf
    there_s: float = -math.inf
    squawk: int | None = None
    simulated: bool = False
    barometric_s: float = -math.inf
    velocity_stated: bool = False
    climb_stated: bool = False
    reports: int = 0
    sent_s: float = -math.inf
    measured_s: float = -math.inf

    def observe(self, report: TrafficReport | None, now_s: float) -> None:
        """Note a report of a source that is not heard there; `None`: the position of another autopilot."""
        self.heard_s = now_s
        self.reports += 1
        if report is None:
            self.velocity_stated = self.climb_stated = True
            return
        self.squawk = self.squawk if report.squawk is None else report.squawk
        self.simulated = report.simulated
        self.velocity_stated = report.ground_speed_mps is not None and report.course_rad is not None
        self.climb_stated = report.climb_mps is not None
        if report.altitude_m is not None and report.altitude_reference is AltitudeReference.BAROMETRIC:
            self.barometric_s = now_s


class Received(NamedTuple):
    """A report, or a position of another system, and the track that it updated; `None`: it was not used."""

    fact: Fact
    track_id: str | None
    autopilot: Sender | None  # the address of ours at that time
    at_s: float


class Forwarding:
    """Chooses what is sent, and recognizes it when it comes back.

    What was `received` waits until the setpoints of the tick are made. `elsewhere` are the MAVLink senders
    that are not heard on the links we send to. `sent` counts reports.
    """

    def __init__(self, forward: Forward) -> None:
        self.to: Place | None = None if forward == "off" else forward
        self.elsewhere: Set[tuple[int, int]] = frozenset()
        self.receiver_works = False
        self.received: list[Received] = []
        self.sent = 0
        self._heard: dict[str, _Heard] = {}
        self._addresses = MadeUpAddresses()
        self.systems_s: dict[int, float] = {}  # when each system was heard, by its made-up address
        self._reports = SentReports()
        self._nearest: dict[str, float] = {}  # how soon each may be here, the soonest first
        self._chosen_s = self._sent_s = self._heartbeat_s = self._fed_s = -math.inf

    # --- what is heard

    def is_echo(self, fact: Fact, now_s: float) -> bool:
        """Whether a report is one of ours that comes back; none is while `sent` and `systems_s` are empty.

        One with the address that we make up for a MAVLink system is, too, while we hear the system itself: a
        replay does not know on which link it was heard, and sends nothing on.
        """
        if not isinstance(fact, Traffic):
            return False
        system_s = self.systems_s.get(fact.report.icao or 0, -math.inf)
        return now_s - system_s <= _SYSTEM_HEARD_S or self._reports.has(fact.report, now_s)

    def note_sources(self, *, receiver_works: bool, elsewhere: Set[tuple[int, int]]) -> None:
        """Note, for what comes from now on, whether a receiver works and who is heard elsewhere."""
        self.note_received()
        self.receiver_works, self.elsewhere = receiver_works, elsewhere

    def note_received(self) -> None:
        """Note who reported which tracks since the last call, and what the reports say of them."""
        received, self.received = self.received, []
        for one in received:
            self._observe(*one)

    def _observe(self, fact: Fact, track_id: str | None, autopilot: Sender | None, now_s: float) -> None:
        sender, report = fact.sender, fact.report if isinstance(fact, Traffic) else None
        if report is None and track_id is not None:
            self.systems_s[self._addresses.made_up(track_id)] = now_s
        if sender == autopilot or (sender != RECEIVER and sender not in self.elsewhere):
            track_id = track_id or (None if report is None else report.key)
            if track_id and self._is_fed(now_s):
                self._heard.setdefault(track_id, _Heard()).there_s = now_s
        elif track_id is not None:
            self._fed_s = now_s
            self._heard.setdefault(track_id, _Heard()).observe(report, now_s)

    # --- what is sent

    def messages(
        self, tracks: Sequence[Track], own: Ownship | None, frame: LocalFrame | None, now_s: float
    ) -> list[Message]:
        """The report that is due, and our heartbeat as an ADS-B receiver; call `note_received` before."""
        if self.to is None or not self._is_fed(now_s):
            self._heard.clear()
            return []
        messages = self._heartbeat(now_s)
        fresh = bool(tracks) and now_s - max(track.time_s for track in tracks) <= _LATEST_S
        if own is None or frame is None or not fresh:
            return messages
        self._choose(tracks, own, now_s)
        if self._nearest and now_s - self._sent_s >= _SPACING_S - _EARLY_S:
            messages += self._next(tracks, frame, now_s)
        return messages

    def _is_fed(self, now_s: float) -> bool:
        """Whether there is a source of traffic that is not heard where we send to."""
        return self.receiver_works or now_s - self._fed_s <= _FEEDING_S

    def _heartbeat(self, now_s: float) -> list[Message]:
        if 0.0 <= now_s - self._heartbeat_s < _HEARTBEAT_INTERVAL_S - _EARLY_S:
            return []
        self._heartbeat_s = now_s
        return [
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_ADSB, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
        ]

    def _choose(self, tracks: Sequence[Track], own: Ownship, now_s: float) -> None:
        """Choose the nearest in time; forget who is not heard any more."""
        if 0.0 <= now_s - self._chosen_s < _CHOSEN_AGAIN_S - _EARLY_S:
            return
        self._chosen_s = now_s
        self._reports.forget_old(now_s)
        if len(self._heard) > 2 * len(tracks) + _NEAREST:
            present = {track.track_id for track in tracks}
            self._heard = {track_id: heard for track_id, heard in self._heard.items() if track_id in present}
        heard = self._heard
        known = [track for track in tracks if track.track_id in heard]
        near = zip(_reaches_s(known, own), range(len(known)), strict=True)
        chosen: dict[str, float] = {}
        for reach_s, index in nsmallest(_SORTED, near):
            if self._is_wanted(known[index], now_s):
                chosen[known[index].track_id] = reach_s
                if len(chosen) == _NEAREST:
                    break
        self._nearest = chosen

    def _is_wanted(self, track: Track, now_s: float) -> bool:
        heard = self._heard.get(track.track_id)
        return (
            heard is not None
            and not track.is_member
            and track.state is TrackState.CONFIRMED
            and now_s - heard.there_s > _THERE_S
            and now_s - heard.heard_s <= _HEARD_S
        )

    def _next(self, tracks: Sequence[Track], frame: LocalFrame, now_s: float) -> list[Message]:
        """The most urgent one of those that are due and have news."""
        best: tuple[float, Track, _Heard] | None = None
        for track in tracks:
            reach_s, heard = self._nearest.get(track.track_id), self._heard.get(track.track_id)
            if reach_s is None or heard is None or not self._is_due(track, heard, now_s):
                continue
            # The near ones by how soon they may be here, then the others by turns.
            urgency = reach_s if reach_s < _NEAR_S else _NEAR_S + max(heard.sent_s, 0.0) + 1e-3 * reach_s
            if best is None or urgency < best[0]:
                best = urgency, track, heard
        return [] if best is None else [self._message(*best[1:], frame, now_s)]

    def _is_due(self, track: Track, heard: _Heard, now_s: float) -> bool:
        if now_s - heard.sent_s < _INTERVAL_S - _EARLY_S or not self._is_wanted(track, now_s):
            return False
        return track.time_s - track.age_s > heard.measured_s + _EARLY_S

    def _message(self, track: Track, heard: _Heard, frame: LocalFrame, now_s: float) -> Message:
        heard.sent_s = self._sent_s = now_s
        heard.measured_s = track.time_s - track.age_s
        age_s = max(now_s - heard.measured_s, 0.0)
        tslc_s = math.floor(age_s + _EARLY_S)
        place = frame.to_geo(*_position_m(track, now_s - tslc_s))
        north_mps, east_mps, down_mps = track.velocity_mps
        speed_mps = math.hypot(north_mps, east_mps)
        velocity_known = heard.velocity_stated or heard.reports >= _LEAST_REPORTS
        climb_known = heard.climb_stated or heard.reports >= _LEAST_REPORTS
        course_known = velocity_known and speed_mps >= _LEAST_COURSE_MPS
        barometric = now_s - heard.barometric_s <= _THERE_S
        report = TrafficReport(
            TrafficSource.ADSB,
            track.track_id,
            now_s - age_s,
            place.lat_deg,
            place.lon_deg,
            place.altitude_m,
            AltitudeReference.BAROMETRIC if barometric else AltitudeReference.GEOMETRIC,
            course_rad=wrap_two_pi(math.atan2(east_mps, north_mps)) if course_known else None,
            ground_speed_mps=speed_mps if velocity_known else None,
            climb_mps=-down_mps if climb_known else None,
            callsign=track.callsign,
            squawk=heard.squawk,
            kind=track.kind,
            simulated=heard.simulated,
            icao=self._addresses.of(track),
        )
        self._reports.note(report, now_s)
        self.sent += 1
        return vehicle_message(report, tslc_s)


def _position_m(track: Track, time_s: float) -> Vec3:
    """The place of a track at a time."""
    later_s = time_s - track.time_s
    north_m, east_m, down_m = track.position_m
    north_mps, east_mps, down_mps = track.velocity_mps
    return north_m + later_s * north_mps, east_m + later_s * east_mps, down_m + later_s * down_mps


def _reaches_s(tracks: Sequence[Track], own: Ownship) -> list[float]:
    """How soon each aircraft may be here: its distance by its closing speed [s]."""
    own_north_m, own_east_m, own_down_m = own.position_m
    own_north_mps, own_east_mps, own_down_mps = own.velocity_mps
    reaches_s = []
    for track in tracks:  # by components: there may be thousands
        north_m, east_m, down_m = track.position_m
        north_mps, east_mps, down_mps = track.velocity_mps
        north_m, east_m, down_m = north_m - own_north_m, east_m - own_east_m, down_m - own_down_m
        distance_m = math.sqrt(north_m * north_m + east_m * east_m + down_m * down_m)
        approach = (
            north_m * (own_north_mps - north_mps)
            + east_m * (own_east_mps - east_mps)
            + down_m * (own_down_mps - down_mps)
        )
        reaches_s.append(distance_m / max(approach / max(distance_m, 1.0), _LEAST_CLOSING_MPS))
    return reaches_s
