"""Flies a campaign on the cores of this machine; their number does not change the results."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from itertools import islice, product
from typing import TypeVar

from companion.errors import CompanionError
from sim.campaign.avoiders import NONE
from sim.campaign.flight import ClosestApproach, EncounterResult, fly, unmitigated
from sim.campaign.plan import BOTH, Plan
from sim.campaign.results import Key, ResultLine, Results, result_line
from sim.campaign.two_sided import fly_both, sides_of
from sim.encounters import Encounter, surveillance_of

Task = tuple[Plan, str, str, tuple[int, ...]]  # avoider, surveillance, numbers of the encounters

AnyTask = TypeVar("AnyTask")

# Encounters per task: some seconds of work, so that overhead is small and little is lost with a worker.
_TASK_SIZE = 20
WAITING_PER_WORKER = 3


def tasks_of(plan: Plan, results: Results) -> Iterator[Task]:
    """The remaining flights, as tasks."""
    for avoider, preset in product(plan.avoiders, plan.surveillance):
        left = _remaining(avoider, preset, plan, results)
        while numbers := tuple(islice(left, _TASK_SIZE)):
            yield plan, avoider, preset, numbers


def _remaining(avoider: str, preset: str, plan: Plan, results: Results) -> Iterator[int]:
    return (number for number in plan.numbers() if (avoider, preset, number) not in results.done)


def fly_task(task: Task, source: Callable[[int], Encounter] | None = None) -> list[ResultLine]:
    """Fly a task in this process; without a `source` the plan's models or files are read."""
    plan, avoider, preset, numbers = task
    source = source or _source(plan)
    flown: list[ResultLine] = []
    for number in numbers:
        key = avoider, preset, number
        encounter, nominal, one = fly_one(plan, key, source(number))
        flown.append(result_line(key, encounter, nominal, one))
    return flown


def fly_one(plan: Plan, key: Key, encounter: Encounter) -> tuple[Encounter, ClosestApproach, EncounterResult]:
    """The encounter as it was flown, its closest approach without avoidance, and the result."""
    avoider, preset, number = key
    route, seed = plan.route_of(encounter, number), plan.seed + number
    surveillance = surveillance_of(preset)
    if plan.two_sided:
        sides = sides_of(encounter, plan.limits, route)
        encounter, route = sides[0].encounter, sides[0].route
    nominal = unmitigated(encounter, route, plan.limits)
    if avoider == NONE:
        return encounter, nominal, EncounterResult(nominal, back_s=encounter.duration_s)
    if plan.two_sided and avoider.endswith(BOTH):
        both = fly_both(sides, lambda one, limits: plan.engine_for(avoider, limits)(one), surveillance, seed)
        return both[0], nominal, both[1]
    make_engine = plan.engine_for(avoider)
    return encounter, nominal, fly(encounter, make_engine, surveillance, plan.limits, seed=seed, route=route)


@lru_cache(maxsize=1)
def _source(plan: Plan) -> Callable[[int], Encounter]:
    return plan.source()


def run_here(
    plan: Plan,
    results: Results,
    *,
    workers: int | None = None,
    on_flown: Callable[[int], None] = lambda _: None,
) -> None:
    """Fly the remaining encounters in processes of this machine; `on_flown` gets the number newly flown.

    `CompanionError` if a process died, as for lack of memory; the results until then are kept.
    """
    _source(plan)  # read once: forked processes inherit it
    run_tasks(tasks_of(plan, results), fly_task, results, workers=workers, on_flown=on_flown)


def run_tasks(
    tasks: Iterable[AnyTask],
    fly_task: Callable[[AnyTask], list[ResultLine]],
    results: Results,
    *,
    workers: int | None = None,
    on_flown: Callable[[int], None] = lambda _: None,
) -> None:
    """Fly tasks in processes of this machine, as `run_here` does."""
    workers = workers or len(os.sched_getaffinity(0))
    if workers == 1:
        for task in tasks:
            store(results, fly_task(task), on_flown)
        return
    with ProcessPoolExecutor(workers) as pool:
        flying: set[Future[list[ResultLine]]] = set()
        try:
            for task in tasks:
                flying.add(pool.submit(fly_task, task))
                if len(flying) >= workers * WAITING_PER_WORKER:
                    flying = _store_done(flying, results, on_flown)
            while flying:
                flying = _store_done(flying, results, on_flown)
        except BrokenProcessPool as error:
            raise CompanionError(
                f"campaign: a worker died; {len(results.done)} results are kept, start again to continue"
            ) from error
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _store_done(
    flying: set[Future[list[ResultLine]]], results: Results, on_flown: Callable[[int], None]
) -> set[Future[list[ResultLine]]]:
    done, left = wait(flying, return_when=FIRST_COMPLETED)
    for future in done:
        store(results, future.result(), on_flown)
    return left


def store(results: Results, flown: list[ResultLine], on_flown: Callable[[int], None]) -> None:
    """Add results, and report their number."""
    results.add(flown)
    on_flown(len(flown))
