"""What we say: STATUSTEXT in words, once per event, COLLISION for every threat, our own HEARTBEAT."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Sender
from companion.model import Decision, Layer, Ownship, Role, TextUnits, Threat, Track
from companion.output.effects import Effect, Say, Transmit
from companion.units import FOOT_M, KNOT_MPS, wrap_two_pi

_TEXT_BYTES = 50
# The same news again only after so long: a warning repeated is a warning not read.
_REPEAT_S = 30.0
_COLLISION_INTERVAL_S = 1.0
_MAX_COLLISIONS = 4
# Nearer to our height than this is at our height.
_LEVEL_M = 10


class TrafficSituation(NamedTuple):
    """What there is to tell about: the decision, and what it was made from."""

    decision: Decision
    own: Ownship | None
    tracks: Sequence[Track]

    def name(self, threat: Threat) -> str:
        """What a threat calls itself, or else what we call it."""
        track = next((track for track in self.tracks if track.track_id == threat.track_id), None)
        return threat.track_id if track is None else track.callsign or threat.track_id


class StatusText:
    """Speaks with our address, which `sender` gives, in these units, and remembers what was said."""

    def __init__(
        self, sender: Callable[[], Sender], units: Callable[[], TextUnits] = lambda: "metric"
    ) -> None:
        self._sender = sender
        self._units = units
        self._told_s: dict[str, float] = {}
        self._told_once: set[str] = set()
        self._chunk_id = 0
        self._collisions_s = -math.inf
        self.last_text = ""

    def transmit(self, messages: Sequence[Message]) -> list[Effect]:
        """These messages, from us."""
        if not messages:
            return []  # as at most times
        us = self._sender()
        return [Transmit(us, message) for message in messages]

    def tell(
        self, severity: int, text: str, now_s: float, topic: str | None = None, *, once: bool = False
    ) -> list[Effect]:
        """STATUSTEXT; nothing when its topic was told a moment ago.

        The topic is the text itself unless given: distances change, the news does not. With `once`, a state
        of affairs is told a single time.
        """
        if not self._is_news(topic or text, now_s, once=once):
            return []
        self.last_text = text
        return [Say(severity, text), *self.transmit(self._chunks(severity, text))]

    def conflict(self, outlook: TrafficSituation, now_s: float, *, flying: bool) -> list[Effect]:
        """Once for each traffic and layer: where it is, and what we do, or would do."""
        own, decision = outlook.own, outlook.decision
        if own is None or not decision.threats:
            return []
        threat, units = decision.threats[0], self._units()
        inner = decision.layer is Layer.INNER
        where = describe_threat(threat, own, outlook.name(threat), units)
        what = describe_guidance(decision, own, units, doing=flying)
        return self.tell(
            mavlink.MAV_SEVERITY_CRITICAL if inner else mavlink.MAV_SEVERITY_WARNING,
            f"{'Traffic!' if inner else 'Traffic'} {where}: {what}",
            now_s,
            topic=f"{decision.layer} {threat.track_id}",
        )

    def resuming(self, outlook: TrafficSituation, mode: str, now_s: float) -> list[Effect]:
        """The mission is resumed because the operator says so: who is not avoided now."""
        threats = outlook.decision.threats
        inner = outlook.decision.layer is Layer.INNER
        words = f"Told to resume {mode}"
        if threats:
            others = f" + {len(threats) - 1}" if len(threats) > 1 else ""
            words += f": {outlook.name(threats[0])}{others} {'near, ' if inner else ''}not avoided"
        return self.tell(
            mavlink.MAV_SEVERITY_CRITICAL if inner else mavlink.MAV_SEVERITY_WARNING, words, now_s
        )

    def collisions(self, decision: Decision, *, flying: bool, now_s: float) -> list[Effect]:
        """COLLISION for the threats, once a second."""
        if not decision.threats or 0.0 <= now_s - self._collisions_s < _COLLISION_INTERVAL_S - 1e-3:
            return []
        self._collisions_s = now_s
        return self.transmit([_collision(t, flying=flying) for t in decision.threats[:_MAX_COLLISIONS]])

    def heartbeat(self, role: Role, *, healthy: bool) -> list[Effect]:
        """Our own HEARTBEAT; its custom mode is our role."""
        message = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
            mavlink.MAV_AUTOPILOT_INVALID,
            mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            int(role),
            mavlink.MAV_STATE_ACTIVE if healthy else mavlink.MAV_STATE_CRITICAL,
            3,
        )
        return self.transmit([message])

    def _is_news(self, topic: str, now_s: float, *, once: bool) -> bool:
        if once:
            if topic in self._told_once:
                return False
            self._told_once.add(topic)
        told_s = self._told_s.get(topic)
        if told_s is not None and 0.0 <= now_s - told_s < _REPEAT_S:
            return False
        self._told_s = {t: s for t, s in self._told_s.items() if now_s - s < _REPEAT_S}
        self._told_s[topic] = now_s
        return True

    def _chunks(self, severity: int, text: str) -> list[Message]:
        """The text in as many messages as it takes."""
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


def describe_threat(threat: Threat, own: Ownship, name: str, units: TextUnits) -> str:
    """Where a threat is, as pilots say it: "N123 2 o'clock 1.8 km 60 m below"."""
    clock = round(math.degrees(wrap_two_pi(threat.bearing_rad - own.heading_rad)) / 30.0) % 12 or 12
    height_m = threat.relative_altitude_m
    level = "level"
    if round(abs(height_m)) >= _LEVEL_M:
        level = f"{_height(abs(height_m), units)} {'above' if height_m > 0 else 'below'}"
    return f"{name} {clock} o'clock {threat.distance_m / 1000.0:.1f} km {level}"


def describe_guidance(decision: Decision, own: Ownship, units: TextUnits, *, doing: bool) -> str:
    """What is flown: "turning right 040, climbing 80 m"; as advice: "turn right 040, climb 80 m"."""
    guidance = decision.guidance
    if guidance is None:
        return "mission"
    words = []
    course_rad = math.atan2(own.velocity_mps[1], own.velocity_mps[0])
    turn_rad = (guidance.course_rad - course_rad + math.pi) % (2.0 * math.pi) - math.pi
    if abs(turn_rad) > math.radians(3.0):
        course = round(math.degrees(wrap_two_pi(guidance.course_rad))) % 360
        words.append(f"{_verb('turn', doing)} {'right' if turn_rad > 0 else 'left'} {course:03d}")
    climb_m = guidance.altitude_m + own.position_m[2]
    if abs(climb_m) > 5.0:
        words.append(f"{_verb('climb' if climb_m > 0 else 'descend', doing)} {_height(abs(climb_m), units)}")
    speed_mps = guidance.airspeed_mps - own.airspeed_mps
    if abs(speed_mps) > 2.0:
        faster = _verb("speed", doing) + " up" if speed_mps > 0 else _verb("slow", doing)
        words.append(f"{faster} to {_speed(guidance.airspeed_mps, units)}")
    return ", ".join(words) if words else _verb("hold", doing)


def _verb(verb: str, doing: bool) -> str:
    return f"{verb}ing" if doing else verb


def _height(height_m: float, units: TextUnits) -> str:
    """In feet as pilots say it: in tens."""
    return f"{round(height_m / FOOT_M, -1):.0f} ft" if units == "aviation" else f"{height_m:.0f} m"


def _speed(speed_mps: float, units: TextUnits) -> str:
    return f"{speed_mps / KNOT_MPS:.0f} kt" if units == "aviation" else f"{speed_mps:.0f} m/s"
