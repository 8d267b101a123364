"""Texts about traffic and the avoidance of it, in the words of pilots: the manoeuvre first, then the traffic.

A text for the log has all details. The same text for STATUSTEXT is shortened step by step until it fits.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from companion.geodesy import wrap_pi, wrap_two_pi
from companion.mavlink.dialect import mavlink
from companion.model import (
    LEVEL_M,
    STEADY_CLIMB_M,
    STEADY_SPEED_MPS,
    STEADY_TURN_RAD,
    Decision,
    Guidance,
    Layer,
    Ownship,
    TextUnits,
    Threat,
)
from companion.output.notice import TEXT_BYTES, Notice
from companion.units import FOOT_M, KNOT_MPS

_HOLD = "HOLD"


class TrafficSituation(NamedTuple):
    """The decision and our aircraft; heights are stated above `home_m`, if that is known."""

    decision: Decision
    own: Ownship | None
    home_m: float | None = None


class Maneuver(NamedTuple):
    """A manoeuvre in words: height, turn and speed, each in a long and a short form; "" where unchanged."""

    height: tuple[str, str] = ("", "")
    turn: str = ""
    speed: tuple[str, str] = ("", "")

    @classmethod
    def of(
        cls, guidance: Guidance, own: Ownship, home_m: float | None, units: TextUnits = "metric"
    ) -> "Maneuver":
        """The manoeuvre from the present flight to the guidance."""
        return cls(
            _height_words(guidance.altitude_m, own, home_m, units),
            _turn_words(guidance.course_rad, own),
            _speed_words(guidance.airspeed_mps, own, units),
        )

    @property
    def text(self) -> str:
        """In full: "CLIMB to 397 m, RIGHT 045"."""
        return self._joined(self.height[0], self.turn, self.speed[0])

    def shortened(self) -> Iterator[str]:
        """In full, and then with fewer and fewer words."""
        yield self.text
        yield self._joined(self.height[0], self.turn, self.speed[1])
        yield self._joined(self.height[1], self.turn, self.speed[1])

    @staticmethod
    def _joined(*words: str) -> str:
        return ", ".join(word for word in words if word) or _HOLD


def conflict_notice(
    maneuver: Maneuver, situation: TrafficSituation, units: TextUnits, *, flying: bool, topic: str
) -> Notice | None:
    """The manoeuvre and the most urgent threat; `None` without a threat or own position."""
    own, decision = situation.own, situation.decision
    if own is None or not decision.threats:
        return None
    threat = decision.threats[0]
    inner = decision.layer is Layer.INNER
    advice = "" if flying else "Advise "
    mark = "! " if inner else ": "
    traffic = [*shortened_threat(threat, own, _name(threat), units)]
    return Notice(
        mavlink.MAV_SEVERITY_CRITICAL if inner else mavlink.MAV_SEVERITY_WARNING,
        f"{advice}{maneuver.text}{mark}{traffic[0]}",
        topic=topic,
        brief=_fitting(advice, maneuver, mark, traffic),
    )


def clear_notice(maneuver: Maneuver, why: str, *, topic: str) -> Notice:
    """The manoeuvre without a threat, and why it is flown."""
    text = f"{maneuver.text}: {why}"
    return Notice(mavlink.MAV_SEVERITY_NOTICE, text, topic=topic, brief=_fitting("", maneuver, ": ", [why]))


def _fitting(before: str, maneuver: Maneuver, mark: str, traffic: Sequence[str]) -> str | None:
    """The first combination that fits; the manoeuvre is shortened after the traffic."""
    maneuvers = [f"{before}{words}" for words in maneuver.shortened()]
    texts = [f"{words}{mark}{where}" for words in maneuvers for where in traffic]
    return next((text for text in (*texts, *maneuvers) if len(text.encode()) <= TEXT_BYTES), None)


def resume_notice(situation: TrafficSituation, mode: str) -> Notice:
    """The threats that are not avoided because the operator resumes the mission."""
    threats = situation.decision.threats
    inner = situation.decision.layer is Layer.INNER
    text = f"Resuming {mode}"
    if threats:
        others = f" + {len(threats) - 1}" if len(threats) > 1 else ""
        text += f": {_name(threats[0])}{others} {'near, ' if inner else ''}not avoided"
    return Notice(mavlink.MAV_SEVERITY_CRITICAL if inner else mavlink.MAV_SEVERITY_WARNING, text)


def describe_threat(threat: Threat, own: Ownship, name: str, units: TextUnits) -> str:
    """The position of a threat: "N123 2 o'clock 1.8 km 60 m below"."""
    height_m = threat.relative_altitude_m
    level = "level"
    if round(abs(height_m)) >= LEVEL_M:
        level = f"{_height(abs(height_m), units)} {'above' if height_m > 0 else 'below'}"
    return f"{name} {_clock(threat, own)} {_distance(threat)} {level}"


def shortened_threat(threat: Threat, own: Ownship, name: str, units: TextUnits) -> Iterator[str]:
    """The position of a threat in full, and then with fewer and fewer words."""
    clock, distance = _clock(threat, own), _distance(threat)
    yield describe_threat(threat, own, name, units)
    yield f"{name} {clock} {distance}"
    yield f"{name} {distance}"
    yield f"{clock} {distance}"
    yield name
    yield distance


def _name(threat: Threat) -> str:
    return threat.name or threat.track_id


def _clock(threat: Threat, own: Ownship) -> str:
    hour = round(math.degrees(wrap_two_pi(threat.bearing_rad - own.heading_rad)) / 30.0) % 12 or 12
    return f"{hour} o'clock"


def _distance(threat: Threat) -> str:
    return f"{threat.distance_m / 1000.0:.1f} km"


def _height_words(altitude_m: float, own: Ownship, home_m: float | None, units: TextUnits) -> tuple[str, str]:
    climb_m = altitude_m + own.position_m[2]
    if abs(climb_m) <= STEADY_CLIMB_M:
        return "", ""
    verb = "CLIMB" if climb_m > 0.0 else "DESCEND"
    if home_m is None:
        by = f"{verb} {_height(abs(climb_m), units)}"
        return by, by
    return f"{verb} to {_height(altitude_m - home_m, units)}", verb


def _turn_words(course_rad: float, own: Ownship) -> str:
    turn_rad = wrap_pi(course_rad - math.atan2(own.velocity_mps[1], own.velocity_mps[0]))
    if abs(turn_rad) <= STEADY_TURN_RAD:
        return ""
    course = round(math.degrees(wrap_two_pi(course_rad))) % 360
    return f"{'RIGHT' if turn_rad > 0.0 else 'LEFT'} {course:03d}"


def _speed_words(airspeed_mps: float, own: Ownship, units: TextUnits) -> tuple[str, str]:
    faster_mps = airspeed_mps - own.airspeed_mps
    if abs(faster_mps) <= STEADY_SPEED_MPS:
        return "", ""
    verb = "FASTER" if faster_mps > 0.0 else "SLOWER"
    return f"{verb} {_speed(airspeed_mps, units)}", verb


def _height(height_m: float, units: TextUnits) -> str:
    """A height in metres, or in feet rounded to tens."""
    return f"{round(height_m / FOOT_M, -1):.0f} ft" if units == "aviation" else f"{height_m:.0f} m"


def _speed(speed_mps: float, units: TextUnits) -> str:
    return f"{speed_mps / KNOT_MPS:.0f} kt" if units == "aviation" else f"{speed_mps:.0f} m/s"
