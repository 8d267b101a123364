"""Errors, consistency and delays of the filter of a target, over flights with known truth."""

import cmath
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from companion.traffic.estimate_params import EstimateParams
from companion.traffic.motion_models import grown_sigmas
from companion.traffic.track_filter import HorizontalFilter, HorizontalFix, OutlierGate
from tests.support.tracking_flights import FRAME, Reporting, State, reports

AHEAD_S = 15.0
PARAMS = EstimateParams()
_SETTLED_REPORTS = 8
_AFTER_TURN_S = 8.0
_NEVER_S = math.inf


@dataclass(slots=True)
class Errors:
    """Errors at each report, once settled. The normalized squares are divided by their degrees of freedom."""

    position_m: list[float] = field(default_factory=list)
    velocity_mps: list[float] = field(default_factory=list)
    turn_radps: list[float] = field(default_factory=list)
    ahead_m: list[float] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    nis: list[float] = field(default_factory=list)
    false_radps: list[float] = field(default_factory=list)  # in straight flight
    begins_s: list[float] = field(default_factory=list)
    ends_s: list[float] = field(default_factory=list)
    rejected: int = 0


def measure(flights: Iterable[Sequence[State]], how: Reporting, seed: int = 3) -> Errors:
    """The errors over all flights; each has its own random numbers."""
    errors = Errors()
    for number, states in enumerate(flights):
        _follow(states, how, np.random.default_rng([seed, number]), errors)
    return errors


def _follow(states: Sequence[State], how: Reporting, rng: np.random.Generator, errors: Errors) -> None:
    gate: OutlierGate[HorizontalFilter, HorizontalFix] | None = None
    turn_s = _turn(states)
    began_s = ended_s = _NEVER_S
    taken = 0
    for truth, fix in reports(states, how, rng):
        if gate is None:
            gate = OutlierGate(HorizontalFilter(fix, PARAMS))
            continue
        innovation2 = _innovation2(gate.estimate, fix, how)
        if not gate.receive(fix):
            errors.rejected += 1
            continue
        here, taken = gate.estimate, taken + 1
        if turn_s is not None:
            true_radps, now_s = _state_at(states, turn_s[0]).turn_radps, truth.time_s
            if turn_s[0] < now_s < turn_s[1] and here.turn_radps / true_radps > 0.5:
                began_s = min(began_s, now_s - turn_s[0])
            if now_s > turn_s[1] and abs(here.turn_radps / true_radps) < 0.3:
                ended_s = min(ended_s, now_s - turn_s[1])
        if taken >= _SETTLED_REPORTS:
            _note(errors, here, truth, states)
            errors.nis.append(innovation2)
            if truth.turn_radps == 0.0 and (turn_s is None or truth.time_s > turn_s[1] + _AFTER_TURN_S):
                errors.false_radps.append(abs(here.turn_radps))
    if turn_s is not None:
        errors.begins_s.append(began_s)
        errors.ends_s.append(ended_s)


def _note(errors: Errors, here: HorizontalFilter, truth: State, states: Sequence[State]) -> None:
    position_m = complex(*FRAME.to_north_east_m(here.lat_deg, here.lon_deg))
    velocity_mps = complex(here.north_mps, here.east_mps)
    off_m, off_mps = position_m - truth.position_m, velocity_mps - truth.velocity_mps
    errors.position_m.append(abs(off_m))
    errors.velocity_mps.append(abs(off_mps))
    errors.turn_radps.append(here.turn_radps - truth.turn_radps)
    errors.nees.append(_nees(here, off_m, off_mps))
    if truth.time_s + AHEAD_S <= states[-1].time_s:
        ahead_m = position_m + _flown(velocity_mps, here.turn_radps, AHEAD_S)
        errors.ahead_m.append(abs(ahead_m - _state_at(states, truth.time_s + AHEAD_S).position_m))


def _nees(here: HorizontalFilter, off_m: complex, off_mps: complex) -> float:
    """The squared error of the state in units of its covariance, of four degrees of freedom."""
    pp, pv, vv = here.moments
    squares = vv * abs(off_m) ** 2 + pp * abs(off_mps) ** 2 - 2.0 * pv * (off_m * off_mps.conjugate()).real
    return squares / (pp * vv - pv * pv) / 4.0


def _innovation2(here: HorizontalFilter, fix: HorizontalFix, how: Reporting) -> float:
    """The squared innovation of the position in units of its variance, of two degrees of freedom."""
    elapsed_s = fix.time_s - here.time_s
    frame_m = complex(*FRAME.to_north_east_m(fix.lat_deg, fix.lon_deg))
    here_m = complex(*FRAME.to_north_east_m(here.lat_deg, here.lon_deg))
    flown_m = _flown(complex(here.north_mps, here.east_mps), here.turn_radps, elapsed_s)
    sigma_m, _ = grown_sigmas(here.moments, elapsed_s, PARAMS.manoeuvre_mps)
    noise_m = how.errors.position_sigma_m or PARAMS.position_sigma_m
    return float(abs(frame_m - here_m - flown_m) ** 2 / (sigma_m**2 + noise_m**2) / 2.0)


def _flown(velocity_mps: complex, turn_radps: float, seconds: float) -> complex:
    if turn_radps == 0.0:
        return velocity_mps * seconds
    return velocity_mps * (cmath.rect(1.0, turn_radps * seconds) - 1.0) / (1j * turn_radps)


def _turn(states: Sequence[State]) -> tuple[float, float] | None:
    """When the only turn begins and ends; `None` without one, or with several."""
    turning = [state.turn_radps != 0.0 for state in states]
    changes = [state.time_s for state, a, b in zip(states[1:], turning, turning[1:], strict=False) if a != b]
    return (changes[0], changes[1]) if len(changes) == 2 else None


def _state_at(states: Sequence[State], time_s: float) -> State:
    return states[min(round(time_s / states[1].time_s), len(states) - 1)]
