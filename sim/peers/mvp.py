"""The Modified Voltage Potential: push the predicted closest approach out of the protected zone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.model import Decision, Goal, Guidance, Layer, Ownship, Track, Vec3
from sim.peers.peer import PeerLimits, Relative, course_of, position_at, relatives, wind_of

# The direction of a smaller miss is undefined; this miss replaces it, as in BlueSky.
_LEAST_MISS_M = 10.0
# Nothing can change before the next decision.
_SOONEST_S = 1.0


@dataclass(frozen=True, slots=True)
class MvpParams:
    """The protected zone and the look-ahead time."""

    # Well clear for small UAS against crewed aircraft (ASTM F3442).
    radius_m: float = 609.6
    half_height_m: float = 76.2
    # Conflicts are resolved for a zone larger by this factor, as in BlueSky, since lags cut into it.
    resolution_factor: float = 1.05
    # BlueSky looks 300 s ahead for airliners, whose zone takes 37 s to cross from edge to centre. Traffic of
    # small aircraft turns more often; 60 s is the horizon of our outer layer.
    look_ahead_s: float = 60.0


class Mvp:
    """Change the velocity so that each predicted closest approach is just outside the zone.

    Source: Hoekstra, van Gent, Ruigrok, "Designing for safety: the 'free flight' air traffic management
    concept" (2002), as implemented in the open simulator BlueSky: state-based detection, velocity changes
    summed over all intruders, the result held until each of them is past its closest approach. The vertical
    change is the same displacement over the time to closest approach, on our side of the intruder.
    """

    def __init__(self, limits: PeerLimits, params: MvpParams | None = None) -> None:
        self.limits = limits
        self.params = params or MvpParams()
        self._held: Guidance | None = None
        self._active: set[str] = set()

    def reset(self) -> None:
        """Clear the present conflicts."""
        self._held = None
        self._active.clear()

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:  # noqa: ARG002
        """The decision at `now_s`, north-east-down [m, m/s, rad]; this method does not use the goal."""
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
        """The sum of all changes as course, airspeed and the height at the first closest approach."""
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
        """True if straight flight enters the zone, in both dimensions at once, within the look-ahead."""
        span = _within(other, self.params)
        return span is not None and span[0] < self.params.look_ahead_s

    def _is_past(self, other: Relative) -> bool:
        return other.time_to_closest_s <= 0.0 and other.distance_m > self.params.radius_m


def velocity_change_mps(other: Relative, params: MvpParams, course_rad: float) -> Vec3:
    """The velocity change for one intruder: north, east, down [m/s].

    With d the distance now, d_cpa the miss, R and H the zone's radius and half height times their factor:
    (R - d_cpa) / (t_cpa |cos(asin(R/d) - asin(d_cpa/d))|), away from the intruder's position at closest
    approach. The cosine lengthens it so that the new relative track touches the zone instead of cutting it
    (an erratum to the method); it is left out inside the zone, where no track is tangent. The vertical
    change is (H - |h_cpa|) / t_cpa. A head-on miss counts as left of our course, so that we turn right.
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
    # Level with the intruder, either direction is right.
    up = math.copysign(1.0, down) if down != 0.0 else -1.0
    return -push_mps * north / miss_m, -push_mps * east / miss_m, -up * lift_mps


def _within(other: Relative, params: MvpParams) -> tuple[float, float] | None:
    """Start and end [s] of the intruder's time in our zone if both fly straight; `None`: never."""
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
