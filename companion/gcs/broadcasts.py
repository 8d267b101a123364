"""Messages at regular intervals: our own HEARTBEAT, TIMESYNC, our intent, and COLLISION for the threats."""

import math
from collections.abc import Callable

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import MemberIntent
from companion.mavlink.intake import time_sync_request
from companion.mavlink.translate.formation import intent_message
from companion.model import Decision, Layer, Role, Threat

_HEARTBEAT_INTERVAL_S = 1.0
_COLLISION_INTERVAL_S = 1.0
_TIME_SYNC_INTERVAL_S, _TIME_SYNC_OFTEN_S = 2.0, 0.1
# A formation of ten then sends 288 bytes a second each.
_INTENT_INTERVAL_S = 1.0 / 3.0
_MAX_COLLISIONS = 4


class Broadcasts:
    """Makes each message when it is due."""

    def __init__(self) -> None:
        self._heartbeat_s = -math.inf
        self._collisions_s = -math.inf
        self._time_sync_s = -math.inf
        self._intent_s = -math.inf

    def heartbeat(self, role: Role, now_s: float, *, healthy: bool) -> list[Message]:
        """Our own HEARTBEAT, once a second; its custom mode is our role."""
        if now_s - self._heartbeat_s < _HEARTBEAT_INTERVAL_S - 1e-3 and now_s >= self._heartbeat_s:
            return []
        self._heartbeat_s = now_s
        return [
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
                mavlink.MAV_AUTOPILOT_INVALID,
                mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
                int(role),
                mavlink.MAV_STATE_ACTIVE if healthy else mavlink.MAV_STATE_CRITICAL,
                3,
            )
        ]

    def time_sync(self, component_id: int, now_s: float, *, often: bool) -> list[Message]:
        """TIMESYNC, every two seconds: its answer shows the delay of the link. `often`: at every tick."""
        interval_s = _TIME_SYNC_OFTEN_S if often else _TIME_SYNC_INTERVAL_S
        if 0.0 <= now_s - self._time_sync_s < interval_s - 1e-3:
            return []
        self._time_sync_s = now_s
        return [time_sync_request(component_id, now_s)]

    def intent(self, announce: Callable[[], MemberIntent | None], now_s: float) -> list[Message]:
        """V2_EXTENSION with our intent for the other members of a formation, three times a second."""
        if 0.0 <= now_s - self._intent_s < _INTENT_INTERVAL_S - 1e-3:
            return []
        announcement = announce()
        if announcement is None:
            return []
        self._intent_s = now_s
        return [intent_message(announcement)]

    def collisions(self, decision: Decision, now_s: float, *, flying: bool) -> list[Message]:
        """COLLISION for at most four of the most urgent threats, once a second."""
        if not decision.threats or 0.0 <= now_s - self._collisions_s < _COLLISION_INTERVAL_S - 1e-3:
            return []
        self._collisions_s = now_s
        return [_collision(threat, flying=flying) for threat in decision.threats[:_MAX_COLLISIONS]]


def _collision(threat: Threat, *, flying: bool) -> Message:
    action = (
        mavlink.MAV_COLLISION_ACTION_MOVE_PERPENDICULAR if flying else mavlink.MAV_COLLISION_ACTION_REPORT
    )
    level = (
        mavlink.MAV_COLLISION_THREAT_LEVEL_HIGH
        if threat.layer is Layer.INNER
        else mavlink.MAV_COLLISION_THREAT_LEVEL_LOW
    )
    to_closest_s = threat.time_to_closest_s if math.isfinite(threat.time_to_closest_s) else 0.0
    return mavlink.MAVLink_collision_message(
        mavlink.MAV_COLLISION_SRC_ADSB,
        threat.icao or 0,
        action,
        level,
        max(to_closest_s, 0.0),
        threat.miss_vertical_m,
        threat.miss_horizontal_m,
    )
