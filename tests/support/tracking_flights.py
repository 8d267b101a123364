"""Flights of other aircraft with known truth, and their reports with errors, for measuring the filters."""

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from companion.geodesy import LocalFrame
from companion.traffic.track_filter import HorizontalFix
from sim.encounters import EncounterModel, Surveillance

FRAME = LocalFrame(47.4, 8.5)
_FINE = 20  # steps of integration in a second


class State(NamedTuple):
    """The truth at one moment: position [m] and velocity [m/s] as north + i east, rate of turn [rad/s]."""

    time_s: float
    position_m: complex
    velocity_mps: complex
    turn_radps: float


class Segment(NamedTuple):
    """A part of a flight: its length, rate of turn and acceleration along the path."""

    seconds: float
    turn_dps: float = 0.0
    gain_mps2: float = 0.0


@dataclass(frozen=True, slots=True)
class Reporting:
    """How an aircraft reports. `states_sigmas`: it states the accuracies that its reports have."""

    errors: Surveillance
    with_velocity: bool = True
    states_sigmas: bool = False
    whole_seconds: bool = False  # of age, as in ADSB_VEHICLE.tslc: the time of validity is wrong by up to 1 s


def flight(speed_mps: float, course_rad: float, segments: Sequence[Segment]) -> list[State]:
    """The truth twenty times a second."""
    position_m, time_s, states = 0j, 0.0, []
    for seconds, turn_dps, gain_mps2 in segments:
        turn_radps = math.radians(turn_dps)
        for _ in range(round(seconds * _FINE)):
            velocity_mps = cmath.rect(speed_mps, course_rad)
            states.append(State(time_s, position_m, velocity_mps, turn_radps))
            time_s += 1.0 / _FINE
            speed_mps = max(speed_mps + gain_mps2 / _FINE, 0.0)
            course_rad += turn_radps / _FINE
            position_m += 0.5 * (velocity_mps + cmath.rect(speed_mps, course_rad)) / _FINE
    return states


def model_flight(model: EncounterModel, rng: np.random.Generator, seconds: int) -> list[State]:
    """A flight of an encounter model: its rate of turn is that of the second that begins."""
    path = model.draw(rng, seconds)
    course_rad = np.unwrap(np.arctan2(path.velocity_mps[:, 1], path.velocity_mps[:, 0]))
    speed_mps = np.hypot(path.velocity_mps[:, 0], path.velocity_mps[:, 1])
    segments = [
        Segment(1.0, math.degrees(turn_radps), gain_mps2)
        for turn_radps, gain_mps2 in zip(np.diff(course_rad), np.diff(speed_mps), strict=True)
    ]
    return flight(float(speed_mps[0]), float(course_rad[0]), segments)


def reports(
    states: Sequence[State], how: Reporting, rng: np.random.Generator
) -> Iterator[tuple[State, HorizontalFix]]:
    """The reports that arrive, with the truth at the time that they claim to be valid."""
    errors, lost = how.errors, False
    for place in range(_FINE if how.whole_seconds else 0, len(states), round(errors.period_s * _FINE)):
        late = int(rng.integers(_FINE)) if how.whole_seconds else 0
        sent, off = states[place - late], rng.normal(0.0, 1.0, 4).tolist()
        if errors.loss:
            ends = 1.0 / errors.burst_reports
            begins = ends * errors.loss / (1.0 - errors.loss)
            lost = rng.random() >= ends if lost else rng.random() < begins
            if lost:
                continue
        at_m = sent.position_m + errors.position_sigma_m * complex(off[0], off[1])
        mps = sent.velocity_mps + errors.velocity_sigma_mps * complex(off[2], off[3])
        where = FRAME.to_geo(at_m.real, at_m.imag, 0.0)
        sigmas = (max(errors.position_sigma_m, 0.1), max(errors.velocity_sigma_mps, 0.1))
        yield (
            states[place],
            HorizontalFix(
                states[place].time_s,
                where.lat_deg,
                where.lon_deg,
                (mps.real, mps.imag) if how.with_velocity else None,
                *(sigmas if how.states_sigmas else (None, None)),
            ),
        )
