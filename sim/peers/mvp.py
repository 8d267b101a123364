"""The Modified Voltage Potential: push the predicted closest approach out of the protected zone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.model import Decision, Goal, Guidance, Layer, Ownship, Track, Vec3
from sim.peers.peer import PeerLimits, Relative, course_of, position_at, relatives, wind_of

# A smaller miss has no direction to speak of; a miss of this size is taken instead, as in BlueSky.
_LEAST_MISS_M = 10.0
# Sooner than the next decision nothing can be changed.
_SOONEST_S = 1.0


@dataclass(frozen=True, slots=True)
class MvpParams:
    """The protected zone and how far ahead it is looked for."""

    # Well clear for small UAS against crewed aircraft (ASTM F3442).
    radius_m: float = 609.6
    half_height_m: float = 76.2
    # A conflict is resolved for a zone larger by this, as BlueSky is configured: any lag cuts into the rim.
    resolution_factor: float = 1.05
    # BlueSky looks 300 s ahead among airliners, for a zone that takes one of them 37 s to cross from edge to
    # centre. Small aircraft meet traffic that turns more often; 60 s is what our own outer layer looks ahead.
    look_ahead_s: float = 60.0


class Mvp:
    """Change the velocity so that what is predicted to be too near is just clear.

    Source: Hoekstra, van Gent, Ruigrok, "Designing for safety: the 'free flight' air traffic management
    concept" (2002), and the way it is flown in the open simulator BlueSky: state-based detection, the change
    of velocity summed over all intruders, the result held until each of them is past its closest approach.
    The vertical change is the same displacement over time to closest approach, on the side where we are.
    """

    def __init__(self, limits: PeerLimits, params: MvpParams | None = None) -> None:
        self.limits = limits
        self.params = params or MvpParams()
        self._held: Guidance | None = None
        self._active: set[str] = set()

    def reset(self) -> None:
        """Forget the conflicts at hand."""
        self._held = None
        self._active.clear()

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:  # noqa: ARG002
        """The decision at `now_s`, north-east-down [m, m/s, rad]; the goal plays no part in this method."""
        seen = relatives(now_s, own, tracks)
        conflicts = [other for other in seen if self._in_conflict(other)]
        still = {
            other.track.track_id
            for other in seen
            if other.track.track_id in self._active and not self._is_past(other)
        }
        self._active = still | {other.track.track_id for other in conflicts}
        if conflicts:
            self._held = self._resolution(now_s, own, conflicts)
        elif not self._active:
            self._held = None
        if self._held is None:
            return Decision(Layer.CLEAR, because="no conflict")
        threats = tuple(other.as_threat() for other in seen if other.track.track_id in self._active)
        words = "displaced" if conflicts else "held until past"
        return Decision(Layer.OUTER, self._held, threats, f"{', '.join(sorted(self._active))}: {words}")

    def _resolution(self, now_s: float, own: Ownship, conflicts: Sequence[Relative]) -> Guidance:
        """All changes summed, as course, airspeed and the height of the first closest approach."""
        changes = [velocity_change_mps(other, self.params, course_of(own)) for other in conflicts]
        north_mps, east_mps, down_mps = (
            v + math.fsum(change[axis] for change in changes) for axis, v in enumerate(own.velocity_mps)
        )
        first_s = max(min(other.time_to_closest_s for other in conflicts), _SOONEST_S)
        climb_mps = self.limits.clamp_climb_mps(-down_mps)
        altitude_m = -position_at(now_s, own)[2] + climb_mps * first_s
        wind_north_mps, wind_east_mps = wind_of(own)
        airspeed_mps = math.hypot(north_mps - wind_north_mps, east_mps - wind_east_mps)
        return self.limits.guidance(math.atan2(east_mps, north_mps), airspeed_mps, altitude_m)

    def _in_conflict(self, other: Relative) -> bool:
        """Whether both fly straight on into each other's zone, sideways and in height at once, in time."""
        span = _within(other, self.params)
        return span is not None and span[0] < self.params.look_ahead_s

    def _is_past(self, other: Relative) -> bool:
        return other.time_to_closest_s <= 0.0 and other.distance_m > self.params.radius_m


def velocity_change_mps(other: Relative, params: MvpParams, course_rad: float) -> Vec3:
    """What one intruder adds to our velocity: north, east, down [m/s].

    With d the distance now, d_cpa the miss, R and H the zone's radius and half height times their factor:
    (R - d_cpa) / (t_cpa |cos(asin(R/d) - asin(d_cpa/d))|), away from where the intruder will be at closest
    approach. The cosine lengthens it so that the new relative track touches the zone instead of cutting it
    (an erratum to the method); it is left out once within the zone, where no track touches. Vertically
    (H - |h_cpa|) / t_cpa.
    A head-on miss is taken to be to the left of our course, so that we go right.
    """
    time_s = max(other.time_to_closest_s, _SOONEST_S)
    radius_m = params.radius_m * params.resolution_factor
    half_height_m = params.half_height_m * params.resolution_factor
    north, east, down = other.after(max(other.time_to_closest_s, 0.0))
    miss_m, distance_m = math.hypot(north, east), other.distance_m
    if miss_m < _LEAST_MISS_M:
        north, east = _LEAST_MISS_M * math.sin(course_rad), -_LEAST_MISS_M * math.cos(course_rad)
        miss_m = _LEAST_MISS_M
    push_mps = max(radius_m - miss_m, 0.0) / time_s
    if distance_m > radius_m and distance_m > miss_m:
        push_mps /= abs(math.cos(math.asin(radius_m / distance_m) - math.asin(miss_m / distance_m)))
    lift_mps = max(half_height_m - abs(down), 0.0) / time_s
    # Level with the intruder, one way is as good as the other.
    up = math.copysign(1.0, down) if down != 0.0 else -1.0
    return -push_mps * north / miss_m, -push_mps * east / miss_m, -up * lift_mps


def _within(other: Relative, params: MvpParams) -> tuple[float, float] | None:
    """From when to when [s] the intruder is in our zone if both fly straight on; `None`: never."""
    north, east, down = other.position_m
    v_north, v_east, v_down = other.velocity_mps
    a = v_north * v_north + v_east * v_east
    b = north * v_north + east * v_east
    c = north * north + east * east - params.radius_m**2
    first_s, last_s = 0.0, math.inf
    if a > 1e-9:
        discriminant = b * b - a * c
        if discriminant <= 0.0:
            return None
        root = math.sqrt(discriminant)
        first_s, last_s = max(first_s, (-b - root) / a), (-b + root) / a
    elif c >= 0.0:
        return None
    if abs(v_down) > 1e-9:
        edges = sorted((side * params.half_height_m - down) / v_down for side in (-1.0, 1.0))
        first_s, last_s = max(first_s, edges[0]), min(last_s, edges[1])
    elif abs(down) >= params.half_height_m:
        return None
    return (first_s, last_s) if first_s < last_s else None
