"""ArduPilot's avoidance of ADS-B traffic (the AVD_ parameters) with its perpendicular action."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.model import Decision, Goal, Layer, Ownship, Track, Vec2
from sim.peers.peer import PeerLimits, Relative, course_of, mission_of, position_at, relatives


@dataclass(frozen=True, slots=True)
class ArduPilotParams:
    """The published defaults for planes, with ArduPilot's parameter names.

    The warning's time and distances (AVD_W_*) only warn the operator and are left out.
    """

    time_horizon_s: float = 30.0  # AVD_F_TIME
    distance_horizontal_m: float = 300.0  # AVD_F_DIST_XY
    distance_vertical_m: float = 100.0  # AVD_F_DIST_Z
    recovery_s: float = 2.0  # time without threat before the mission is resumed (AVD_F_RCVRY: resume)
    oldest_s: float = 5.0  # older tracks are ignored
    # Every decision commands this much above or below the present height: full climb or descent.
    height_step_m: float = 10.0

    @staticmethod
    def well_clear() -> "ArduPilotParams":
        """The same rule with the distances of well clear for small UAS (ASTM F3442)."""
        return ArduPilotParams(distance_horizontal_m=609.6, distance_vertical_m=76.2)


class ArduPilot:
    """Extrapolate, pick the most imminent threat, fly perpendicular to its path.

    Source: ArduPilot's documentation of ADS-B avoidance and of the AVD_ parameters, and MAVLink's
    MAV_COLLISION_ACTION_MOVE_PERPENDICULAR ("perpendicular to the collision's velocity vector").

    - Both fly straight for the time horizon. An intruder is a threat if, within it, the horizontal and the
      vertical distance each fall below their limit, though not necessarily at the same time.
    - Only the threat with the earliest closest approach is avoided.
    - The escape direction points from the intruder's line of flight to us, perpendicular to the line in three
      dimensions; from an almost stationary intruder it points straight away. Its horizontal part is flown as
      a course, its vertical part as full climb or descent: climb above the line, otherwise descent.
    - The mission is resumed after some seconds without a threat.
    """

    def __init__(self, limits: PeerLimits, params: ArduPilotParams | None = None) -> None:
        self.limits = limits
        self.params = params or ArduPilotParams()
        self._last: Decision | None = None
        self._last_threat_s = -math.inf

    def reset(self) -> None:
        """Clear the present threat."""
        self._last = None
        self._last_threat_s = -math.inf

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:
        """The decision at `now_s`, north-east-down [m, m/s, rad]."""
        threats = sorted(
            (
                seen
                for seen in relatives(now_s, own, tracks)
                if now_s - seen.track.time_s + seen.track.age_s <= self.params.oldest_s
                and self._is_threat(seen)
            ),
            key=lambda seen: (_imminence_s(seen), seen.distance_m),
        )
        if not threats:
            if self._last is not None and now_s - self._last_threat_s < self.params.recovery_s:
                return self._last
            self.reset()
            return Decision(Layer.CLEAR, because="no threat")
        worst = threats[0]
        north, east, up = perpendicular(worst, own)
        altitude_m = -position_at(now_s, own)[2] + math.copysign(self.params.height_step_m, up)
        airspeed_mps = mission_of(now_s, own, goal).airspeed_mps
        guidance = self.limits.guidance(math.atan2(east, north), airspeed_mps, altitude_m)
        self._last_threat_s = now_s
        self._last = Decision(
            Layer.OUTER,
            guidance,
            tuple(seen.as_threat() for seen in threats),
            f"{worst.track.track_id}: perpendicular, {'up' if up > 0 else 'down'}",
        )
        return self._last

    def _is_threat(self, seen: Relative) -> bool:
        horizon_s = self.params.time_horizon_s
        north, east, _ = seen.after(min(max(seen.time_to_closest_s, 0.0), horizon_s))
        return (
            math.hypot(north, east) < self.params.distance_horizontal_m
            and seen.least_height_m(horizon_s) < self.params.distance_vertical_m
        )


def perpendicular(seen: Relative, own: Ownship) -> tuple[float, float, float]:
    """The perpendicular from the intruder's line of flight to us: north, east, up [m].

    Its horizontal part is never zero: on the line itself it is one metre to the right (in flight, noise would
    decide the side). Up is negative unless we are above the line.
    """
    away = tuple(-p for p in seen.position_m)
    velocity = seen.track.velocity_mps
    speed_squared = math.fsum(v * v for v in velocity)
    if speed_squared >= 1.0:  # below 1 m/s the direction is undefined
        along = math.fsum(a * v for a, v in zip(away, velocity, strict=True)) / speed_squared
        away = tuple(a - along * v for a, v in zip(away, velocity, strict=True))
    north, east, down = away
    up = -down if down < 0.0 else -max(down, 1e-6)
    if math.hypot(north, east) < 1e-3:
        north, east = _right_of_line(velocity[:2], course_of(own))
    return north, east, up


def _right_of_line(velocity_mps: Vec2, course_rad: float) -> Vec2:
    """The unit normal (north, east) of a horizontal velocity that points to the right of our course."""
    right = -math.sin(course_rad), math.cos(course_rad)
    speed_mps = math.hypot(*velocity_mps)
    if speed_mps < 1.0:
        return right
    normal = -velocity_mps[1] / speed_mps, velocity_mps[0] / speed_mps
    side = 1.0 if normal[0] * right[0] + normal[1] * right[1] >= 0.0 else -1.0
    return side * normal[0], side * normal[1]


def _imminence_s(seen: Relative) -> float:
    """Time to the closest approach in three dimensions [s]; 0 once past it."""
    squared = math.fsum(v * v for v in seen.velocity_mps)
    if squared < 1e-9:
        return 0.0
    closing = math.fsum(p * v for p, v in zip(seen.position_m, seen.velocity_mps, strict=True))
    return max(-closing / squared, 0.0)
