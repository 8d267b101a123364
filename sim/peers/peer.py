"""The common part of the peers: their interface, limits and geometry; and the null method."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from companion.geodesy import wrap_two_pi
from companion.model import (
    Decision,
    Goal,
    Guidance,
    Layer,
    Ownship,
    Threat,
    Track,
    TrafficKind,
    Vec2,
    Vec3,
)

# Below this ground speed the heading replaces the course.
_SLOWEST_WITH_COURSE_MPS = 1.0


class Peer(Protocol):
    """A method that decides for one aircraft during one flight; our avoider is one too."""

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:
        """The decision at `now_s`, all in one north-east-down frame [m, m/s, rad]."""

    def reset(self) -> None:
        """Clear the present conflict."""


@dataclass(frozen=True, slots=True)
class PeerLimits:
    """The aircraft's limits, the same for all peers; heights are above the zero of the local frame.

    The published methods do not use `max_bank_rad`; it limits the aircraft that flies the guidance.
    """

    min_airspeed_mps: float
    max_airspeed_mps: float
    max_bank_rad: float
    max_climb_mps: float
    max_sink_mps: float
    floor_m: float | None = None
    ceiling_m: float | None = None

    def guidance(self, course_rad: float, airspeed_mps: float, altitude_m: float) -> Guidance:
        """The guidance clamped to the limits; course in [0, 2 pi)."""
        airspeed_mps = min(max(airspeed_mps, self.min_airspeed_mps), self.max_airspeed_mps)
        if self.ceiling_m is not None:
            altitude_m = min(altitude_m, self.ceiling_m)
        if self.floor_m is not None:
            altitude_m = max(altitude_m, self.floor_m)
        return Guidance(wrap_two_pi(course_rad), airspeed_mps, altitude_m)

    def clamp_climb_mps(self, climb_mps: float) -> float:
        """The climb rate clamped to the limits, positive up."""
        return min(max(climb_mps, -self.max_sink_mps), self.max_climb_mps)


@dataclass(frozen=True, slots=True)
class Relative:
    """A track relative to us at one moment: other minus own, north-east-down."""

    track: Track
    position_m: Vec3
    velocity_mps: Vec3

    @property
    def distance_m(self) -> float:
        """Horizontal distance [m]."""
        return math.hypot(self.position_m[0], self.position_m[1])

    @property
    def time_to_closest_s(self) -> float:
        """Horizontal time to closest approach [s]; negative once past, 0 if nothing moves."""
        north, east, _ = self.position_m
        v_north, v_east, _ = self.velocity_mps
        squared = v_north * v_north + v_east * v_east
        return -(north * v_north + east * v_east) / squared if squared > 1e-9 else 0.0

    def after(self, seconds: float) -> Vec3:
        """Relative position after `seconds` if both fly straight."""
        north, east, down = (p + v * seconds for p, v in zip(self.position_m, self.velocity_mps, strict=True))
        return north, east, down

    def least_height_m(self, within_s: float) -> float:
        """The smallest height difference [m] until `within_s` if both fly straight."""
        first, last = self.position_m[2], self.after(within_s)[2]
        return 0.0 if first * last <= 0.0 else min(abs(first), abs(last))

    def as_threat(self) -> Threat:
        """The track as a threat of a decision; the miss distances are those of straight flight."""
        time_s = self.time_to_closest_s
        north, east, down = self.after(max(time_s, 0.0))
        p, v, distance_m = self.position_m, self.velocity_mps, self.distance_m
        return Threat(
            track_id=self.track.track_id,
            icao=self.track.icao,
            distance_m=distance_m,
            relative_altitude_m=-p[2],
            bearing_rad=math.atan2(p[1], p[0]),
            closing_mps=-(p[0] * v[0] + p[1] * v[1]) / max(distance_m, 1e-3),
            time_to_closest_s=time_s,
            miss_horizontal_m=math.hypot(north, east),
            miss_vertical_m=abs(down),
            layer=Layer.OUTER,
        )


class Unmitigated:
    """Never avoids: the reference of every risk ratio."""

    def __init__(self, limits: PeerLimits) -> None:
        self.limits = limits

    def decide(
        self,
        now_s: float,  # noqa: ARG002
        own: Ownship,  # noqa: ARG002
        tracks: Sequence[Track],  # noqa: ARG002
        goal: Goal,  # noqa: ARG002
    ) -> Decision:
        """Always the mission."""
        return Decision(Layer.CLEAR, because="no avoidance")

    def reset(self) -> None:
        """Do nothing: there is no memory."""


def position_at(now_s: float, what: Ownship | Track) -> Vec3:
    """Position at `now_s` [m], extrapolated straight from its own time."""
    since_s = now_s - what.time_s
    north, east, down = (p + v * since_s for p, v in zip(what.position_m, what.velocity_mps, strict=True))
    return north, east, down


def relatives(now_s: float, own: Ownship, tracks: Sequence[Track]) -> list[Relative]:
    """All flying tracks relative to us at `now_s`; tracks that are not finite are left out."""
    ours = position_at(now_s, own)
    seen = []
    for track in tracks:
        theirs = position_at(now_s, track)
        if track.kind is TrafficKind.SURFACE_VEHICLE or not all(
            map(math.isfinite, (*theirs, *track.velocity_mps))
        ):
            continue
        north, east, down = (b - a for a, b in zip(ours, theirs, strict=True))
        v_north, v_east, v_down = (b - a for a, b in zip(own.velocity_mps, track.velocity_mps, strict=True))
        seen.append(Relative(track, (north, east, down), (v_north, v_east, v_down)))
    return seen


def course_of(own: Ownship) -> float:
    """The course over ground [rad]; the heading at very low speed."""
    north_mps, east_mps, _ = own.velocity_mps
    if math.hypot(north_mps, east_mps) < _SLOWEST_WITH_COURSE_MPS:
        return own.heading_rad
    return math.atan2(east_mps, north_mps)


def wind_of(own: Ownship) -> Vec2:
    """The measured wind (north, east) [m/s]; zero without a measurement."""
    return (0.0, 0.0) if own.wind_mps is None else own.wind_mps


def mission_of(now_s: float, own: Ownship, goal: Goal) -> Guidance:
    """The mission's guidance from here, not clamped; a goal position gives course, and height if unset."""
    airspeed_mps = own.airspeed_mps if goal.airspeed_mps is None else goal.airspeed_mps
    north_m, east_m, down_m = position_at(now_s, own)
    course_rad = course_of(own) if goal.course_rad is None else goal.course_rad
    altitude_m = -down_m if goal.altitude_m is None else goal.altitude_m
    if goal.position_m is not None:
        to_north_m, to_east_m = goal.position_m[0] - north_m, goal.position_m[1] - east_m
        if math.hypot(to_north_m, to_east_m) > 1.0:  # at the goal its bearing is undefined
            course_rad = math.atan2(to_east_m, to_north_m)
        if goal.altitude_m is None:
            altitude_m = -goal.position_m[2]
    return Guidance(course_rad, airspeed_mps, altitude_m)
