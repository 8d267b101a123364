"""Texts about traffic and the avoidance of it, in the words of pilots."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from companion.mavlink.dialect import mavlink
from companion.model import Decision, Layer, Ownship, TextUnits, Threat, Track
from companion.output.notice import AnyNotice, ConflictNotice, Notice, ResumeNotice
from companion.units import FOOT_M, KNOT_MPS, wrap_two_pi

# Heights that differ by less than this are the same height.
_LEVEL_M = 10


class TrafficSituation(NamedTuple):
    """The decision and its inputs."""

    decision: Decision
    own: Ownship | None
    tracks: Sequence[Track]

    def name(self, threat: Threat) -> str:
        """The threat's callsign, or its track id."""
        track = next((track for track in self.tracks if track.track_id == threat.track_id), None)
        return threat.track_id if track is None else track.callsign or threat.track_id


def worded(notice: AnyNotice, situation: TrafficSituation, units: TextUnits) -> Notice | None:
    """The notice in words; `None` for a conflict notice without a threat or own position."""
    match notice:
        case ConflictNotice(flying):
            return _conflict(situation, units, flying=flying)
        case ResumeNotice(mode):
            return _resume(situation, mode)
        case Notice():
            return notice


def _conflict(situation: TrafficSituation, units: TextUnits, *, flying: bool) -> Notice | None:
    """The most urgent threat, and what is flown or advised; one topic for each threat and layer."""
    own, decision = situation.own, situation.decision
    if own is None or not decision.threats:
        return None
    threat = decision.threats[0]
    inner = decision.layer is Layer.INNER
    where = describe_threat(threat, own, situation.name(threat), units)
    what = describe_guidance(decision, own, units, doing=flying)
    return Notice(
        mavlink.MAV_SEVERITY_CRITICAL if inner else mavlink.MAV_SEVERITY_WARNING,
        f"{'Traffic!' if inner else 'Traffic'} {where}: {what}",
        topic=f"{decision.layer} {threat.track_id}",  # not repeated when only distances change
    )


def _resume(situation: TrafficSituation, mode: str) -> Notice:
    """The threats that are not avoided because the operator resumes the mission."""
    threats = situation.decision.threats
    inner = situation.decision.layer is Layer.INNER
    text = f"Resuming {mode}"
    if threats:
        others = f" + {len(threats) - 1}" if len(threats) > 1 else ""
        text += f": {situation.name(threats[0])}{others} {'near, ' if inner else ''}not avoided"
    return Notice(mavlink.MAV_SEVERITY_CRITICAL if inner else mavlink.MAV_SEVERITY_WARNING, text)


def describe_threat(threat: Threat, own: Ownship, name: str, units: TextUnits) -> str:
    """The position of a threat: "N123 2 o'clock 1.8 km 60 m below"."""
    clock = round(math.degrees(wrap_two_pi(threat.bearing_rad - own.heading_rad)) / 30.0) % 12 or 12
    height_m = threat.relative_altitude_m
    level = "level"
    if round(abs(height_m)) >= _LEVEL_M:
        level = f"{_height(abs(height_m), units)} {'above' if height_m > 0 else 'below'}"
    return f"{name} {clock} o'clock {threat.distance_m / 1000.0:.1f} km {level}"


def describe_guidance(decision: Decision, own: Ownship, units: TextUnits, *, doing: bool) -> str:
    """The manoeuvre flown: "turning right 040, climbing 80 m"; as advice: "turn right 040, climb 80 m"."""
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
    """A height in metres, or in feet rounded to tens."""
    return f"{round(height_m / FOOT_M, -1):.0f} ft" if units == "aviation" else f"{height_m:.0f} m"


def _speed(speed_mps: float, units: TextUnits) -> str:
    return f"{speed_mps / KNOT_MPS:.0f} kt" if units == "aviation" else f"{speed_mps:.0f} m/s"
