"""Surveillance quality: errors, latency and loss of the reports, repeatable by seed."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from companion.model import Vec3
from sim.encounters.encounter import Encounter, State

# Number of reports computed at once: those of an encounter and part of the way back.
_LOOKED_UP = 128


@dataclass(frozen=True, slots=True)
class Surveillance:
    """Errors of reports: standard deviations per axis, drawn for each report unless noted.

    `latency_s` is the age of a report on arrival; the receiver reports it if `age_reported`.
    `height_bias_sigma_m` is drawn once per intruder. Losses come in bursts: the long-run probability is
    `loss`, the mean length `burst_reports`. `first_heard_m` is the reception range. `accuracy_stated`: the
    reports state the accuracy of their positions.
    """

    period_s: float = 1.0
    latency_s: float = 0.0
    age_reported: bool = True
    position_sigma_m: float = 0.0
    height_sigma_m: float = 0.0
    velocity_sigma_mps: float = 0.0
    climb_sigma_mps: float = 0.0
    height_bias_sigma_m: float = 0.0
    loss: float = 0.0
    burst_reports: float = 1.0
    first_heard_m: float = math.inf
    accuracy_stated: bool = False

    @property
    def stated_sigma_m(self) -> float | None:
        """The standard deviation of positions that reports state; `None` if they state none."""
        return self.position_sigma_m if self.accuracy_stated else None

    @property
    def exact(self) -> bool:
        """True without errors and losses."""
        return not any(
            (
                self.position_sigma_m,
                self.height_sigma_m,
                self.velocity_sigma_mps,
                self.climb_sigma_mps,
                self.height_bias_sigma_m,
                self.loss,
            )
        )


# Index of the intruder, time of the state, reported position and velocity (north-east-down), reported age.
Heard = tuple[int, float, Vec3, Vec3, float]


class Reception:
    """Errors and losses of the reports of `transmitters` aircraft."""

    def __init__(self, surveillance: Surveillance, transmitters: int, seed: int = 0) -> None:
        self._how, self._exact = surveillance, surveillance.exact
        self._lost = [False] * transmitters
        self._rng = np.random.default_rng([seed, 77])
        bias_m = self._rng.normal(0.0, 1.0, transmitters) * surveillance.height_bias_sigma_m
        self._bias_m: list[float] = bias_m.tolist()

    def report(self, index: int, sent_s: float, state: State, away_m: float) -> Heard | None:
        """The report of a state at `sent_s`, `away_m` from the receiver; `None` if it is not received."""
        how, reported = self._how, state
        if not self._exact:
            reported = self._with_errors(index, state)
            if self._is_lost(index):
                return None
        if away_m > how.first_heard_m:
            return None
        position_m, velocity_mps = reported
        return index, sent_s, position_m, velocity_mps, how.latency_s if how.age_reported else 0.0

    def _with_errors(self, index: int, state: State) -> State:
        how = self._how
        north_off, east_off, down_off, *off = self._rng.normal(0.0, 1.0, 6).tolist()
        (north_m, east_m, down_m), (north_mps, east_mps, down_mps) = state
        position_m = (
            north_m + how.position_sigma_m * north_off,
            east_m + how.position_sigma_m * east_off,
            down_m + how.height_sigma_m * down_off + self._bias_m[index],
        )
        velocity_mps = (
            north_mps + how.velocity_sigma_mps * off[0],
            east_mps + how.velocity_sigma_mps * off[1],
            down_mps + how.climb_sigma_mps * off[2],
        )
        return position_m, velocity_mps

    def _is_lost(self, index: int) -> bool:
        """True if the report is lost, by Gilbert's two-state model of bursts."""
        how, chance = self._how, self._rng.random()
        if how.loss <= 0.0:
            return False
        ends = 1.0 / how.burst_reports
        begins = ends * how.loss / (1.0 - how.loss)
        self._lost[index] = chance >= ends if self._lost[index] else chance < begins
        return self._lost[index]


class Observer:
    """The received reports of an encounter's intruders; query times must not decrease."""

    def __init__(self, encounter: Encounter, surveillance: Surveillance, seed: int = 0) -> None:
        self._how, self._reception = surveillance, Reception(surveillance, len(encounter.intruders), seed)
        self._intruders = encounter.intruders
        self._own_m, self._own_mps = encounter.own_position_m, encounter.own_velocity_mps
        self._arrivals = self._all_arrivals()
        self._next = next(self._arrivals)
        self.stated_sigma_m = surveillance.stated_sigma_m

    def reports(self, now_s: float) -> list[Heard]:
        """The reports that arrived since the last call."""
        heard: list[Heard] = []
        while self._next[0] <= now_s + 1e-9:
            arrives_s, states = self._next
            for index, state in enumerate(states):
                report = self._report(index, arrives_s - self._how.latency_s, state)
                if report is not None:
                    heard.append(report)
            self._next = next(self._arrivals)
        return heard

    def _all_arrivals(self) -> Iterator[tuple[float, list[State]]]:
        """Endless arrival times, and the intruders' states at the time of transmission."""
        arrives_s = 0.0
        while True:
            arrivals_s = []
            for _ in range(_LOOKED_UP):
                arrivals_s.append(arrives_s)
                arrives_s += self._how.period_s
            sent_s = np.array(arrivals_s) - self._how.latency_s
            paths = [path.states_at(sent_s) for path in self._intruders]
            for place, at_s in enumerate(arrivals_s):
                yield at_s, [states[place] for states in paths]

    def _report(self, index: int, sent_s: float, state: State) -> Heard | None:
        (north_m, east_m, _), own_m, own_mps = state[0], self._own_m, self._own_mps
        away_m = math.hypot(north_m - own_m[0] - own_mps[0] * sent_s, east_m - own_m[1] - own_mps[1] * sent_s)
        return self._reception.report(index, sent_s, state, away_m)
