"""A stranger that avoids like TCAS II without coordination: vertical advisories alone."""

import math
from collections.abc import Sequence

from companion.model import Decision, Goal, Layer, Ownship, Track
from sim.peers import PeerLimits
from sim.peers.peer import Relative, mission_of, position_at, relatives

# Sensitivity level 4 of the FAA's Introduction to TCAS II, Version 7.1, table 2.
_TAU_S, _DMOD_M, _ZTHR_M, _ALIM_M = 20.0, 648.0, 183.0, 91.0
_CLIMB_MPS, _PILOT_S = 7.6, 5.0
_STEP_M = 100.0


class VerticalAdvisories:
    """Climbs or descends, whichever separates more at the closest approach; of equals it climbs.

    A sense is reversed when the intruder has crossed to the side that it leads to.
    """

    def __init__(self, limits: PeerLimits) -> None:
        self.limits = limits
        self._sense: dict[str, int] = {}

    def reset(self) -> None:
        """Forget the advisories."""
        self._sense = {}

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:
        """The decision at `now_s`, north-east-down [m, m/s, rad]."""
        threats = [seen for seen in relatives(now_s, own, tracks) if self._is_threat(seen)]
        self._sense = {seen.track.track_id: self._sense_against(seen, own) for seen in threats}
        if not threats:
            return Decision(Layer.CLEAR, because="no threat")
        mission = mission_of(now_s, own, goal)
        sense = self._sense[min(threats, key=_tau_s).track.track_id]
        height_m = -position_at(now_s, own)[2] + sense * _STEP_M
        guidance = self.limits.guidance(mission.course_rad, mission.airspeed_mps, height_m)
        found = tuple(seen.as_threat() for seen in threats)
        return Decision(Layer.OUTER, guidance, found, "climb" if sense > 0 else "descend")

    def _is_threat(self, seen: Relative) -> bool:
        above_m, rate_mps = seen.position_m[2], seen.velocity_mps[2]
        if seen.track.track_id in self._sense:
            return seen.time_to_closest_s > 0.0
        apart_m = abs(above_m + rate_mps * min(max(seen.time_to_closest_s, 0.0), _TAU_S))
        return _tau_s(seen) < _TAU_S and min(abs(above_m), apart_m) < _ZTHR_M

    def _sense_against(self, seen: Relative, own: Ownship) -> int:
        above_m = seen.position_m[2]
        before = self._sense.get(seen.track.track_id)
        if before is not None:
            return before if before * above_m > -_ALIM_M / 3.0 else -before
        time_s = max(seen.time_to_closest_s, 0.0)
        level_m = above_m + seen.velocity_mps[2] * time_s
        moved_m = _CLIMB_MPS * max(time_s - _PILOT_S, 0.0) + own.velocity_mps[2] * time_s
        sinking_m = _CLIMB_MPS * max(time_s - _PILOT_S, 0.0) - own.velocity_mps[2] * time_s
        return 1 if abs(level_m + moved_m) >= abs(level_m - sinking_m) else -1


def _tau_s(seen: Relative) -> float:
    """Modified tau: the time to come within DMOD at the present closing speed."""
    distance_m = seen.distance_m
    if distance_m < _DMOD_M:
        return 0.0
    (north, east, _), (north_mps, east_mps, _) = seen.position_m, seen.velocity_mps
    closing_mps = -(north * north_mps + east * east_mps) / distance_m
    return (distance_m**2 - _DMOD_M**2) / (distance_m * closing_mps) if closing_mps > 0.1 else math.inf
