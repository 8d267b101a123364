"""Message rates: requested once, then measured, and requested again when they drop."""

import math

from companion.autopilots import Adapter
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    OWN_ICAO_PARAMETER,
    AirData,
    AirspeedSensor,
    Fact,
    GeoidSeparation,
    Heartbeat,
    LandedState,
    MissionProgress,
    NavigationTarget,
    OwnPosition,
    Parameter,
    PressureAltitude,
)

_MEASURED: dict[type, int] = {
    Heartbeat: mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    OwnPosition: mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    AirData: mavlink.MAVLINK_MSG_ID_VFR_HUD,
    AirspeedSensor: mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    LandedState: mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    PressureAltitude: mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,
    GeoidSeparation: mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    NavigationTarget: mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    MissionProgress: mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
}
_WINDOW_S = 5.0
# The interval between requests for a message that does not come doubles up to this.
_LONGEST_WAIT_S = 60.0
_OWN_ICAO_TRIES = 4
# Heartbeats come once a second at least. On a bad link several in a row are lost.
_HEARTBEAT_OVERDUE_S, _HEARTBEAT_AGAIN_S = 1.2, 0.3
_QUIET_TRAFFIC_S = 10.0


class MessageRates:
    """Requests the messages that the adapter names, at their intervals.

    The rate of traffic cannot be measured, because there may be none. It is requested again from time to time
    while none is received.
    """

    def __init__(self) -> None:
        self._counts: dict[int, int] = {}
        self._waits_s: dict[int, float] = {}
        self._next_s: dict[int, float] = {}
        self._window_ends_s = math.inf
        self._requested = False
        self.traffic_s = -math.inf  # when it last passed a report of traffic on
        self._own_icao_tries = 0
        self._asked_for_heartbeat_s = -math.inf
        self.measured_hz: dict[int, float] = {}  # by message id, over the last full window

    def observe(self, fact: Fact) -> None:
        """Count a fact of our autopilot."""
        message_id = _MEASURED.get(type(fact))
        if message_id is not None:
            self._counts[message_id] = self._counts.get(message_id, 0) + 1
        elif isinstance(fact, Parameter) and fact.name == OWN_ICAO_PARAMETER:
            self._own_icao_tries = _OWN_ICAO_TRIES

    def heartbeat(self, adapter: Adapter, heard_s: float, now_s: float) -> list[Message]:
        """A request for the heartbeat, which was heard at `heard_s`, while the aircraft is ours.

        It is made at the adapter's interval, or when the heartbeat is overdue: without one, nothing may be
        commanded.
        """
        interval_s, overdue_s = adapter.heartbeat_interval_s, heard_s + _HEARTBEAT_OVERDUE_S
        if interval_s is None:
            due_s = max(overdue_s, self._asked_for_heartbeat_s + _HEARTBEAT_AGAIN_S)
        else:
            due_s = self._asked_for_heartbeat_s + interval_s - 1e-3
        if heard_s <= now_s < due_s:
            return []
        self._asked_for_heartbeat_s = now_s
        return [adapter.request_message(mavlink.MAVLINK_MSG_ID_HEARTBEAT)]

    def restart(self) -> None:
        """Request everything again, because the autopilot restarted or was out of contact."""
        self._requested = False

    def tick(self, adapter: Adapter, now_s: float) -> list[Message]:
        """The requests to send now."""
        if not self._requested:
            self._requested = True
            self.traffic_s = now_s
            self._waits_s.clear()
            self._begin_window(now_s)
            self._own_icao_tries = 1
            return [
                *(adapter.request_interval(*wanted) for wanted in adapter.intervals_s.items()),
                adapter.request_parameter(OWN_ICAO_PARAMETER),
                adapter.request_message(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
                # The aircraft is not taken over before this has shown that it is not landing.
                adapter.request_message(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE),
            ]
        if now_s < self._window_ends_s:
            return []
        slow = [
            (message_id, interval_s)
            for message_id, interval_s in adapter.intervals_s.items()
            if message_id in _MEASURED.values()
            and self._counts.get(message_id, 0) < 0.5 * _WINDOW_S / interval_s
        ]
        self.measured_hz = {
            message_id: self._counts.get(message_id, 0) / _WINDOW_S for message_id in _MEASURED.values()
        }
        self._begin_window(now_s)
        requests = [
            adapter.request_interval(message_id, interval_s)
            for message_id, interval_s in slow
            if self._may_request(message_id, now_s)
        ]
        if now_s - self.traffic_s >= _QUIET_TRAFFIC_S:
            # The request may have been lost, which looks like no traffic.
            self.traffic_s = now_s
            traffic = mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE
            requests.append(adapter.request_interval(traffic, adapter.intervals_s[traffic]))
        if self._own_icao_tries < _OWN_ICAO_TRIES:
            self._own_icao_tries += 1
            requests.append(adapter.request_parameter(OWN_ICAO_PARAMETER))
        return requests

    def _begin_window(self, now_s: float) -> None:
        self._counts.clear()
        self._window_ends_s = now_s + _WINDOW_S

    def _may_request(self, message_id: int, now_s: float) -> bool:
        if now_s < self._next_s.get(message_id, -math.inf):
            return False
        wait_s = self._waits_s.get(message_id, _WINDOW_S)
        self._next_s[message_id] = now_s + wait_s - 1e-3
        self._waits_s[message_id] = min(2.0 * wait_s, _LONGEST_WAIT_S)
        return True
