"""The studies of `companion-sim paper`: experiments, local minima, transition domain, random fields.

Flights are independent of each other, so they are spread over the machine's cores; the same seeds give the
same results on any number of them.
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
from sim.paper.fields import random_field, way_exists
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
    """Nobody watches."""


@dataclass(frozen=True, slots=True)
class TransitionPoint:
    """One width of the transition domain over all fields: value, and the 95 % interval around it.

    Means are over the flights that arrived; `arrived_share` is of those that did so without collision.
    """

    method: str
    delta_beta_deg: float
    safety_value: Triple
    arrived_share: Triple
    min_clearance: Triple
    path_ratio: Triple


@dataclass(frozen=True, slots=True)
class FieldShare:
    """How one strategy did over the random fields through which a way exists."""

    method: Method
    fields: int
    without_collision: Triple  # share that arrived without collision, with its 95 % interval
    safety_value: float
    heading_effort: float
    path_ratio: float
    jitter: float
    failed_seeds: tuple[int, ...]


def fly_experiments(on_progress: Progress = _silent) -> dict[str, list[Flight]]:
    """Both experiments with every strategy, by name of the experiment."""
    jobs = [
        (name, load_scene(name), method)
        for name in EXPERIMENTS
        for method in (*methods.REPORTED, *methods.MORE[name])
    ]
    flights = _spread(_fly, [(scene, method) for _, scene, method in jobs], on_progress)
    return {
        wanted: [flight for (name, *_), flight in zip(jobs, flights, strict=True) if name == wanted]
        for wanted in EXPERIMENTS
    }


def fly_minima(on_progress: Progress = _silent) -> dict[str, list[Flight]]:
    """The scenes of local minima with the plain field and with ours, by name of the scene."""
    scenes = minima_scenes()
    jobs = [(scene, method) for scene in scenes.values() for method in MINIMA_METHODS]
    flights = iter(_spread(_fly, jobs, on_progress))
    return {name: [next(flights) for _ in MINIMA_METHODS] for name in scenes}


def study_transition(fields: int | None = None, on_progress: Progress = _silent) -> list[TransitionPoint]:
    """Every width of the transition domain over the study's random fields."""
    scene, drawn = _random_scene()
    seeds = range(drawn.study_seed, drawn.study_seed + (fields or drawn.fields))
    chosen = [
        (method, delta_deg, replace(method, delta_beta_rad=math.radians(delta_deg)))
        for method in TRANSITION_METHODS
        for delta_deg in DELTA_BETAS_DEG
    ]
    jobs = [(scene, seed, method) for _, _, method in chosen for seed in seeds]
    measured = _spread(_measure_field, jobs, on_progress)
    rows = [measured[i : i + len(seeds)] for i in range(0, len(measured), len(seeds))]
    return [
        _point(method.label, delta_deg, row) for (method, delta_deg, _), row in zip(chosen, rows, strict=True)
    ]


def best_delta_beta_deg(points: Sequence[TransitionPoint], method: str = methods.OUTER.label) -> float:
    """The width with the largest safety value, among those that arrive as surely as the surest one.

    As surely: the interval of its share reaches the best share. The paper asks for the safety value alone,
    which would also praise those that never arrive.
    """
    own = [point for point in points if point.method == method and math.isfinite(point.safety_value[0])]
    if not own:
        return math.nan
    surest = max(point.arrived_share[0] for point in own)
    sure = [point for point in own if point.arrived_share[2] >= surest]
    return max(sure, key=lambda point: point.safety_value[0]).delta_beta_deg


def study_fields(fields: int | None = None, on_progress: Progress = _silent) -> tuple[list[FieldShare], int]:
    """Every strategy over the reported random fields, and through how many of them no way exists."""
    scene, drawn = _random_scene()
    seeds = range(drawn.seed, drawn.seed + (fields or drawn.fields))
    total = len(seeds) * (len(FIELD_METHODS) + 1)
    open_ = _spread(_way_exists, [(scene, seed) for seed in seeds], lambda done, _: on_progress(done, total))
    passable = [seed for seed, is_open in zip(seeds, open_, strict=True) if is_open]
    jobs = [(scene, seed, method) for method in FIELD_METHODS for seed in passable]
    measured = _spread(_measure_field, jobs, lambda done, _: on_progress(len(seeds) + done, total))
    rows = [measured[i : i + len(passable)] for i in range(0, len(measured), len(passable))]
    shares = [_share(method, passable, row) for method, row in zip(FIELD_METHODS, rows, strict=True)]
    return shares, len(seeds) - len(passable)


def share_with_interval(successes: int, of: int) -> Triple:
    """A share and its 95 % interval by Wilson's score, which stays within 0 and 1."""
    if of == 0:
        return 0.0, 0.0, 1.0
    p, z2 = successes / of, _Z**2 / of
    middle = (p + z2 / 2.0) / (1.0 + z2)
    half = _Z * math.sqrt(p * (1.0 - p) / of + z2 / (4.0 * of)) / (1.0 + z2)
    # Rounding must not leave the share itself outside.
    return p, min(max(middle - half, 0.0), p), max(min(middle + half, 1.0), p)


def mean_with_interval(values: Sequence[float]) -> Triple:
    """A mean and its 95 % interval, by the normal distribution of means; not a number of nothing."""
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


def _way_exists(job: tuple[Scene, int]) -> bool:
    scene, seed = job
    return way_exists(random_field(scene, seed), 3 * scene.straight_steps)


def _spread(work: Callable[[_Job], _Result], jobs: Sequence[_Job], on_progress: Progress) -> list[_Result]:
    """The results of all jobs, in their order, from as many processes as there are cores."""
    results: dict[int, _Result] = {}
    # Fresh processes: this one may have threads, as that of a progress bar, which a fork would leave stuck.
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=fresh) as pool:
        places = {pool.submit(work, job): place for place, job in enumerate(jobs)}
        try:
            for done, future in enumerate(as_completed(places), start=1):
                results[places[future]] = future.result()
                on_progress(done, len(jobs))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [results[place] for place in range(len(jobs))]
