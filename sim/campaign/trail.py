"""The states of an aircraft that flies at the same time, and the reports of it that another receives."""

import math

import numpy as np

from sim.campaign.plane import Plane
from sim.encounters import Heard, Path, Reception, Surveillance
from sim.encounters.encounter import State


class Trail:
    """The states of a flown aircraft, noted at rising times."""

    def __init__(self) -> None:
        self._times_s: list[float] = []
        self._states: list[State] = []

    def note(self, time_s: float, plane: Plane) -> None:
        """Note the present state."""
        self._times_s.append(time_s)
        self._states.append((plane.position_m, plane.velocity_mps))

    def state_at(self, time_s: float) -> State:
        """Position and velocity: those noted, straight on from the latest before, or back from the first."""
        place = max(int(np.searchsorted(self._times_s, time_s + 1e-9)) - 1, 0)
        (north, east, down), (north_mps, east_mps, down_mps) = self._states[place]
        since_s = time_s - self._times_s[place]
        moved = north + since_s * north_mps, east + since_s * east_mps, down + since_s * down_mps
        return moved, (north_mps, east_mps, down_mps)

    def path(self) -> Path:
        """All that was noted."""
        positions, velocities = (np.array(column) for column in zip(*self._states, strict=True))
        return Path(np.array(self._times_s), positions, velocities)


class LiveReceiver:
    """The received reports of an aircraft that flies at the same time; query times must not decrease."""

    def __init__(self, other: Trail | Path, own: Trail, index: int, how: Surveillance, seed: int) -> None:
        self._other, self._own, self._index, self._how = other, own, index, how
        self._reception = Reception(how, 2, seed)
        self._arrives_s = 0.0
        self.stated_sigma_m = how.stated_sigma_m

    def reports(self, now_s: float) -> list[Heard]:
        """The reports that arrived since the last call."""
        heard = []
        while self._arrives_s <= now_s + 1e-9:
            sent_s = self._arrives_s - self._how.latency_s
            state, own = self._other.state_at(sent_s), self._own.state_at(sent_s)
            away_m = math.dist(state[0][:2], own[0][:2])
            heard.append(self._reception.report(self._index, sent_s, state, away_m))
            self._arrives_s += self._how.period_s
        return [one for one in heard if one is not None]
