"""What the operator is told: STATUSTEXT in words, once per event, and COLLISION for every threat."""

import math
from collections.abc import Iterable

from companion.mavlink.dialect import Message, mavlink
from companion.model import Decision, Layer, Ownship, Threat
from companion.units import wrap_two_pi

_TEXT_BYTES = 50
# The same news again only after so long: a warning repeated is a warning not read.
_REPEAT_S = 30.0
_COLLISION_INTERVAL_S = 1.0
_MAX_COLLISIONS = 4


class Announcer:
    """Makes the messages and remembers what was said."""

    def __init__(self) -> None:
        self._told_s: dict[str, float] = {}
        self._told_once: set[str] = set()
        self._chunk_id = 0
        self._collisions_s = -math.inf
        self.last_text = ""

    def text(
        self, severity: int, text: str, now_s: float, topic: str | None = None, *, once: bool = False
    ) -> list[Message]:
        """STATUSTEXT, in chunks when it is long; nothing when its topic was told a moment ago.

        The topic is the text itself unless given: distances change, the news does not. With `once`, a state
        of affairs is told a single time.
        """
        topic = topic or text
        if once:
            if topic in self._told_once:
                return []
            self._told_once.add(topic)
        told_s = self._told_s.get(topic)
        if told_s is not None and 0.0 <= now_s - told_s < _REPEAT_S:
            return []
        self._told_s = {t: s for t, s in self._told_s.items() if now_s - s < _REPEAT_S}
        self._told_s[topic] = now_s
        self.last_text = text
        raw = text.encode("ascii", "replace")
        if len(raw) <= _TEXT_BYTES:
            return [mavlink.MAVLink_statustext_message(severity, raw, 0, 0)]
        self._chunk_id = self._chunk_id % 65535 + 1
        chunks = [raw[i : i + _TEXT_BYTES] for i in range(0, len(raw), _TEXT_BYTES)]
        if len(chunks[-1]) == _TEXT_BYTES:
            chunks.append(b"")  # a full last chunk does not end the text; an empty one does
        return [
            mavlink.MAVLink_statustext_message(severity, chunk, self._chunk_id, i)
            for i, chunk in enumerate(chunks)
        ]

    def collisions(self, decision: Decision, *, flying: bool, now_s: float) -> list[Message]:
        """COLLISION for the threats, once a second."""
        if not decision.threats or 0.0 <= now_s - self._collisions_s < _COLLISION_INTERVAL_S:
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


def describe_threat(threat: Threat, own: Ownship, names: Iterable[tuple[str, str | None]]) -> str:
    """Where a threat is, as pilots say it: "N123 2 o'clock 1.8 km 60 m below"."""
    callsign = dict(names).get(threat.track_id) or threat.track_id
    clock = round(math.degrees(wrap_two_pi(threat.bearing_rad - own.heading_rad)) / 30.0) % 12 or 12
    height_m = round(threat.relative_altitude_m)
    level = "level" if abs(height_m) < 10 else f"{abs(height_m)} m {'above' if height_m > 0 else 'below'}"
    return f"{callsign} {clock} o'clock {threat.distance_m / 1000.0:.1f} km {level}"


def describe_guidance(decision: Decision, own: Ownship) -> str:
    """What is flown: "right to 040, climb 80 m"."""
    guidance = decision.guidance
    if guidance is None:
        return "mission"
    words = []
    course_rad = math.atan2(own.velocity_mps[1], own.velocity_mps[0])
    turn_rad = (guidance.course_rad - course_rad + math.pi) % (2.0 * math.pi) - math.pi
    if abs(turn_rad) > math.radians(3.0):
        course = round(math.degrees(wrap_two_pi(guidance.course_rad))) % 360
        words.append(f"{'right' if turn_rad > 0 else 'left'} to {course:03d}")
    climb_m = guidance.altitude_m + own.position_m[2]
    if abs(climb_m) > 5.0:
        words.append(f"{'climb' if climb_m > 0 else 'descend'} {abs(climb_m):.0f} m")
    speed_mps = guidance.airspeed_mps - own.airspeed_mps
    if abs(speed_mps) > 2.0:
        words.append(f"{'faster' if speed_mps > 0 else 'slower'}, {guidance.airspeed_mps:.0f} m/s")
    return ", ".join(words) if words else "hold"
