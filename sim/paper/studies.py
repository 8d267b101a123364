"""The studies of `companion-sim paper`: experiments, local minima, transition domain, random fields.

Flights are independent, so they are distributed over the machine's cores; the same seeds give the same
results on any number of cores.
"""

import math
import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from companion.errors import ConfigError
from sim.paper import methods
from sim.paper.fields import path_exists, random_field
from sim.paper.flight import Flight, fly
from sim.paper.measures import Measures, measure
from sim.paper.methods import Method
from sim.paper.scene import RandomFields, Scene, load_scene, minima_scenes

EXPERIMENTS = ("single", "group")
DELTA_BETAS_DEG = (0.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0, 105.0, 120.0)
MINIMA_METHODS = (methods.FIELD, methods.OUTER, methods.TWO_LAYER)
TRANSITION_METHODS = (methods.OUTER, methods.TWO_LAYER)
FIELD_METHODS = (
    methods.NONE,
    methods.FIELD,
    methods.CONE,
    methods.OUTER,
    methods.INNER,
    methods.TWO_LAYER,
    methods.TWO_LAYER_PLAIN,
    methods.AS_FLOWN,
)
# Two-sided 95 % of the normal distribution.
_Z = 1.959964

Progress = Callable[[int, int], None]
Triple = tuple[float, float, float]
_Job = TypeVar("_Job")
_Result = TypeVar("_Result")


def _silent(done: int, total: int) -> None:
    """Ignore the progress."""


@dataclass(frozen=True, slots=True)
class TransitionPoint:
    """One width of the transition domain over all fields: values with their 95 % intervals.

    Means are over the flights that arrived; `arrived_share` counts arrivals without collision.
    """

    method: str
    delta_beta_deg: float
    safety_value: Triple
    arrived_share: Triple
    min_clearance: Triple
    path_ratio: Triple


@dataclass(frozen=True, slots=True)
class FieldShare:
    """The results of one strategy over the passable random fields."""

    method: Method
    fields: int
    without_collision: Triple  # share that arrived without collision, with its 95 % interval
    safety_value: float
    heading_effort: float
    path_ratio: float
    jitter: float
    failed_seeds: tuple[int, ...]


def fly_experiments(on_progress: Progress = _silent) -> dict[str, list[Flight]]:
    """The flights of both experiments with every strategy, by experiment."""
    jobs = [
        (name, load_scene(name), method)
        for name in EXPERIMENTS
        for method in (*methods.REPORTED, *methods.MORE[name])
    ]
    flights = _run_all(_fly, [(scene, method) for _, scene, method in jobs], on_progress)
    return {
        wanted: [flight for (name, *_), flight in zip(jobs, flights, strict=True) if name == wanted]
        for wanted in EXPERIMENTS
    }


def fly_minima(on_progress: Progress = _silent) -> dict[str, list[Flight]]:
    """The flights of the local-minimum scenes with the plain field and with ours, by scene."""
    scenes = minima_scenes()
    jobs = [(scene, method) for scene in scenes.values() for method in MINIMA_METHODS]
    flights = iter(_run_all(_fly, jobs, on_progress))
    return {name: [next(flights) for _ in MINIMA_METHODS] for name in scenes}


def study_transition(fields: int | None = None, on_progress: Progress = _silent) -> list[TransitionPoint]:
    """The results of every width of the transition domain over the study's random fields."""
    scene, drawn = _random_scene()
    seeds = range(drawn.study_seed, drawn.study_seed + (fields or drawn.fields))
    chosen = [
        (method, delta_deg, replace(method, delta_beta_rad=math.radians(delta_deg)))
        for method in TRANSITION_METHODS
        for delta_deg in DELTA_BETAS_DEG
    ]
    jobs = [(scene, seed, method) for _, _, method in chosen for seed in seeds]
    measured = _run_all(_measure_field, jobs, on_progress)
    rows = [measured[i : i + len(seeds)] for i in range(0, len(measured), len(seeds))]
    return [
        _point(method.label, delta_deg, row) for (method, delta_deg, _), row in zip(chosen, rows, strict=True)
    ]


def best_delta_beta_deg(points: Sequence[TransitionPoint], method: str = methods.OUTER.label) -> float:
    """The width with the largest safety value among those that arrive most reliably.

    Reliable: the interval of its share reaches the best share. The paper uses the safety value alone, which
    would also favour widths with which no flight arrives.
    """
    candidates = [
        point for point in points if point.method == method and math.isfinite(point.safety_value[0])
    ]
    if not candidates:
        return math.nan
    surest = max(point.arrived_share[0] for point in candidates)
    reliable = [point for point in candidates if point.arrived_share[2] >= surest]
    return max(reliable, key=lambda point: point.safety_value[0]).delta_beta_deg


def study_fields(fields: int | None = None, on_progress: Progress = _silent) -> tuple[list[FieldShare], int]:
    """Every strategy over the reported random fields, and the number of impassable fields."""
    scene, drawn = _random_scene()
    seeds = range(drawn.seed, drawn.seed + (fields or drawn.fields))
    total = len(seeds) * (len(FIELD_METHODS) + 1)
    open_ = _run_all(
        _path_exists, [(scene, seed) for seed in seeds], lambda done, _: on_progress(done, total)
    )
    passable = [seed for seed, is_open in zip(seeds, open_, strict=True) if is_open]
    jobs = [(scene, seed, method) for method in FIELD_METHODS for seed in passable]
    measured = _run_all(_measure_field, jobs, lambda done, _: on_progress(len(seeds) + done, total))
    rows = [measured[i : i + len(passable)] for i in range(0, len(measured), len(passable))]
    shares = [_share(method, passable, row) for method, row in zip(FIELD_METHODS, rows, strict=True)]
    return shares, len(seeds) - len(passable)


def share_with_interval(successes: int, of: int) -> Triple:
    """A share and its 95 % interval by Wilson's score, within 0 and 1."""
    if of == 0:
        return 0.0, 0.0, 1.0
    p, z2 = successes / of, _Z**2 / of
    middle = (p + z2 / 2.0) / (1.0 + z2)
    half = _Z * math.sqrt(p * (1.0 - p) / of + z2 / (4.0 * of)) / (1.0 + z2)
    # Rounding must not put the share itself outside its interval.
    return p, min(max(middle - half, 0.0), p), max(min(middle + half, 1.0), p)


def mean_with_interval(values: Sequence[float]) -> Triple:
    """A mean and its 95 % interval by the normal distribution; NaN without values."""
    if not values:
        return math.nan, math.nan, math.nan
    mean = float(np.mean(values))
    half = _Z * float(np.std(values, ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else 0.0
    return mean, mean - half, mean + half


def _point(label: str, delta_deg: float, measured: Sequence[Measures]) -> TransitionPoint:
    arrived = [one for one in measured if one.arrived]
    return TransitionPoint(
        label,
        delta_deg,
        mean_with_interval([one.safety_value for one in arrived if one.safety_value is not None]),
        share_with_interval(sum(_succeeded(one) for one in measured), len(measured)),
        mean_with_interval([one.min_clearance for one in arrived if one.min_clearance is not None]),
        mean_with_interval([one.path_ratio for one in arrived]),
    )


def _share(method: Method, seeds: Sequence[int], measured: Sequence[Measures]) -> FieldShare:
    arrived = [one for one in measured if one.arrived]
    failed = tuple(seed for seed, one in zip(seeds, measured, strict=True) if not _succeeded(one))
    return FieldShare(
        method,
        len(seeds),
        share_with_interval(len(seeds) - len(failed), len(seeds)),
        mean_with_interval([one.safety_value for one in arrived if one.safety_value is not None])[0],
        mean_with_interval([one.heading_effort for one in arrived])[0],
        mean_with_interval([one.path_ratio for one in arrived])[0],
        mean_with_interval([float(one.jitter) for one in arrived])[0],
        failed,
    )


def _succeeded(one: Measures) -> bool:
    return one.arrived and not one.collisions


def _random_scene() -> tuple[Scene, RandomFields]:
    scene = load_scene("fields")
    if scene.random is None:
        raise ConfigError("the scene fields has no section `random`")
    return scene, scene.random


def _fly(job: tuple[Scene, Method]) -> Flight:
    return fly(*job)


def _measure_field(job: tuple[Scene, int, Method]) -> Measures:
    scene, seed, method = job
    return measure(fly(random_field(scene, seed), method))


def _path_exists(job: tuple[Scene, int]) -> bool:
    scene, seed = job
    return path_exists(random_field(scene, seed), 3 * scene.straight_steps)


def _run_all(work: Callable[[_Job], _Result], jobs: Sequence[_Job], on_progress: Progress) -> list[_Result]:
    """The results of all jobs in order, from one process per core."""
    results: dict[int, _Result] = {}
    # Spawned, not forked: this process may have threads, such as that of a progress bar.
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=spawn) as pool:
        places = {pool.submit(work, job): place for place, job in enumerate(jobs)}
        try:
            for done, future in enumerate(as_completed(places), start=1):
                results[places[future]] = future.result()
                on_progress(done, len(jobs))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [results[place] for place in range(len(jobs))]
