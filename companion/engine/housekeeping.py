"""The end of a tick: what is repeated, requested, answered, forwarded, kept for the next run and recorded."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

from companion.autopilots import Adapter
from companion.control.handover import Handover
from companion.control.readiness import Readiness
from companion.engine.deciding import Deciding
from companion.gcs.broadcasts import Broadcasts
from companion.gcs.concern_values import concern_values
from companion.gcs.conditions import Conditions
from companion.gcs.forwarding import Forwarding
from companion.gcs.notices import OperatorNotices
from companion.gcs.requests import GcsRequests
from companion.gcs.traffic_conditions import traffic_conditions
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Sender
from companion.output.decision_record import Circumstances
from companion.output.effects import Effect, Keep, Record, Transmit
from companion.output.notice import AnyNotice, Condition
from companion.output.persisted_state import PersistedState
from companion.ownship.aircraft import Aircraft
from companion.ownship.autopilot_queries import AutopilotQueries
from companion.ownship.message_rates import MessageRates
from companion.traffic import Concern, Tracker

_KEEP_INTERVAL_S = 1.0
_MOST_COUNTED = 4096  # tracks

Outgoing = list[Message | AnyNotice]


class Rooms(NamedTuple):
    """The parts of a flight that have something to do, or to say, at the end of each tick."""

    aircraft: Aircraft
    queries: AutopilotQueries
    rates: MessageRates
    tracker: Tracker
    operator: GcsRequests
    notices: OperatorNotices
    readiness: Readiness
    handover: Handover
    deciding: Deciding
    forwarding: Forwarding


class Housekeeping:
    """Nothing here decides or flies: call it when the setpoints of the tick are made.

    `us` returns our address.
    """

    def __init__(self, rooms: Rooms, us: Callable[[], Sender]) -> None:
        self._rooms, self._us = rooms, us
        self._broadcasts = Broadcasts()
        self.conditions = Conditions()
        self.concerns: tuple[Concern, ...] = ()  # of the last tick: traffic that is not avoided or is odd
        self.reports: Counter[str] = Counter()  # how many updated each track
        self.left: PersistedState | None = None  # state of a former run, until its parameters are restored
        self._kept_s: float | None = None

    def outgoing(
        self, answers: Sequence[Message], shell_conditions: Sequence[Condition], now_s: float
    ) -> Outgoing:
        """Notices, requests, rates, `answers`, COLLISION, our own heartbeat, in the order of sending."""
        rooms, adapter = self._rooms, self._rooms.aircraft.adapter
        rooms.deciding.note_threats(now_s)
        outgoing: Outgoing = [*rooms.notices.tick()]
        outgoing += self.conditions.tick(self._present_conditions(shell_conditions, now_s), now_s)
        if adapter is not None:
            outgoing += self._to_autopilot(adapter, now_s)
        outgoing += [*answers, *rooms.operator.listed(now_s)]
        supervisor = rooms.handover.supervisor
        outgoing += self._broadcasts.collisions(rooms.deciding.decision, now_s, flying=supervisor.flying)
        if adapter is not None:
            if supervisor.holds:
                outgoing += rooms.rates.heartbeat(adapter, rooms.aircraft.contact.heartbeat_s, now_s)
            # An autopilot that leaves the guided mode without our setpoints: do they arrive?
            often = supervisor.holds and adapter.leaves_guided_by_itself
            outgoing += self._broadcasts.time_sync(self._us().component_id, now_s, often=often)
        announce = partial(rooms.deciding.announcement, self._us(), now_s)
        outgoing += self._broadcasts.intent(announce, now_s)
        healthy = rooms.aircraft.contact.heard(now_s) and not rooms.aircraft.kinematics.position_lost(now_s)
        outgoing += self._broadcasts.heartbeat(rooms.operator.role, now_s, healthy=healthy)
        return outgoing

    def _to_autopilot(self, adapter: Adapter, now_s: float) -> Outgoing:
        """Repeated commands, message rates and requests; what was answered meanwhile is passed on."""
        rooms, outgoing = self._rooms, Outgoing()
        if self.left is not None:
            # The state may be that of another aircraft.
            if self.left.system_id == adapter.target.system_id:
                adapter.restore_parameters(self.left.borrowed)
            self.left = None
        commanding = rooms.handover.commanding
        if (commanding.may_fly or not rooms.handover.supervisor.flying) and commanding.in_contact(now_s):
            outgoing += adapter.tick(now_s)
        if rooms.aircraft.contact.heard(now_s):
            outgoing += rooms.rates.tick(adapter, now_s)
            requests, notices = rooms.queries.tick(adapter, now_s)
            outgoing += [*requests, *notices]
            rooms.aircraft.note_mission(rooms.queries.mission, now_s, arrives=rooms.queries.mission_arrives)
            rooms.aircraft.kinematics.airspeed.cruise_mps = rooms.queries.limits.cruise_airspeed_mps
        return outgoing

    def _present_conditions(self, of_shell: Sequence[Condition], now_s: float) -> list[Condition]:
        """The conditions that hold now, of every room that reports any."""
        rooms = self._rooms
        threatened = bool(rooms.deciding.decision.threats)
        alarms = rooms.handover.conditions(now_s)
        own = rooms.notices.conditions(rooms.readiness, now_s, threatened=threatened)
        self.concerns = rooms.tracker.concerns(now_s)
        traffic = traffic_conditions(self.concerns, rooms.deciding.own)
        return [*alarms, *own, *traffic, *rooms.queries.conditions(), *of_shell]

    def effects(self, now_s: float) -> list[Effect]:
        """Traffic that others hear, and the state for the next run."""
        return [*self._forward(now_s), *self._keep(now_s)]

    def _forward(self, now_s: float) -> list[Effect]:
        """Traffic that others hear, from the ADS-B component of our system."""
        rooms, deciding = self._rooms, self._rooms.deciding
        place = rooms.forwarding.to
        rooms.forwarding.note_received()
        if place is None or not rooms.aircraft.contact.heard(now_s):
            return []
        sender = Sender(self._us().system_id, mavlink.MAV_COMP_ID_ADSB)
        messages = rooms.forwarding.messages(deciding.tracks, deciding.own, deciding.frame, now_s)
        return [Transmit(sender, message, place) for message in messages]

    def _keep(self, now_s: float) -> list[Effect]:
        """Save the state for the next run once a second; remove it when there is none any more."""
        state = self._rooms.handover.persisted(now_s, self._rooms.operator.changed_to)
        if state is None:
            changed, self._kept_s = self._kept_s is not None, None
            return [Keep(None)] if changed else []
        if self._kept_s is not None and now_s - self._kept_s < _KEEP_INTERVAL_S - 1e-3:
            return []
        self._kept_s = now_s
        return [Keep(state)]

    def record(self, now_s: float) -> list[Effect]:
        """The decision of this tick, with all that it was made from."""
        deciding, aircraft = self._rooms.deciding, self._rooms.aircraft
        if deciding.own is None:
            return []
        supervisor = self._rooms.handover.supervisor
        around = Circumstances(
            supervisor.state,
            supervisor.flying,
            aircraft.mode,
            deciding.frame,
            aircraft.kinematics.home_altitude_m(),
            [concern_values(concern) for concern in self.concerns],
            self._counted_reports(),
        )
        return [Record(now_s, deciding.decision, deciding.own, deciding.tracks, around)]

    def _counted_reports(self) -> dict[str, int]:
        """The number of reports by track; of a flood, only of the present tracks."""
        if len(self.reports) > _MOST_COUNTED:
            tracks = {track.track_id for track in self._rooms.deciding.tracks}
            self.reports = Counter({name: count for name, count in self.reports.items() if name in tracks})
        return dict(self.reports)
