"""Flies a campaign on all cores of this machine; on how many does not change the results."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from itertools import islice, product

from companion.errors import CompanionError
from sim.campaign.flight import Flown, fly, undisturbed
from sim.campaign.plan import NONE, Plan
from sim.campaign.results import Result, Results, result_of
from sim.encounters import SURVEILLANCE_PRESETS, Encounter

Task = tuple[Plan, str, str, tuple[int, ...]]  # by whom, how well known, which

# So many at a time: seconds of work, so that passing them around costs nothing and little is lost with one.
_TASK_SIZE = 20
WAITING_PER_WORKER = 3


def tasks_of(plan: Plan, results: Results) -> Iterator[Task]:
    """What is still to be flown, in portions."""
    for avoider, known in product(plan.avoiders, plan.surveillance):
        left = _left(avoider, known, plan, results)
        while portion := tuple(islice(left, _TASK_SIZE)):
            yield plan, avoider, known, portion


def _left(avoider: str, known: str, plan: Plan, results: Results) -> Iterator[int]:
    return (number for number in plan.numbers() if (avoider, known, number) not in results.done)


def fly_task(task: Task, source: Callable[[int], Encounter] | None = None) -> list[Result]:
    """Fly a portion, in whatever process this is; the encounters are read here unless there is a `source`."""
    plan, avoider, known, numbers = task
    surveillance = SURVEILLANCE_PRESETS[known]
    source, make_engine = source or _source(plan), plan.engine_for(avoider)
    flown: list[Result] = []
    for number in numbers:
        encounter = source(number)
        nominal = undisturbed(encounter)
        if avoider == NONE:
            one = Flown(nominal, back_s=encounter.duration_s)
        else:
            one = fly(encounter, make_engine, surveillance, plan.limits, seed=plan.seed + number)
        flown.append(result_of((avoider, known, number), encounter, nominal, one))
    return flown


@lru_cache(maxsize=1)
def _source(plan: Plan) -> Callable[[int], Encounter]:
    return plan.source()


def run_here(
    plan: Plan, results: Results, *, workers: int | None = None, tell: Callable[[int], None] = lambda _: None
) -> None:
    """Fly what is left of a campaign in processes of this machine; `tell` hears how many more are flown.

    `CompanionError` when a process died, as of too little memory; what was flown until then is kept.
    """
    workers = workers or len(os.sched_getaffinity(0))
    tasks = tasks_of(plan, results)
    if workers == 1:
        for task in tasks:
            keep(results, fly_task(task), tell)
        return
    _source(plan)  # read once: processes are forked from this one and have it too
    with ProcessPoolExecutor(workers) as pool:
        flying: set[Future[list[Result]]] = set()
        try:
            for task in tasks:
                flying.add(pool.submit(fly_task, task))
                if len(flying) >= workers * WAITING_PER_WORKER:
                    flying = _take_done(flying, results, tell)
            while flying:
                flying = _take_done(flying, results, tell)
        except BrokenProcessPool as error:
            raise CompanionError(
                f"campaign: a worker process died; {len(results.done)} results are kept, start again to go on"
            ) from error
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _take_done(
    flying: set[Future[list[Result]]], results: Results, tell: Callable[[int], None]
) -> set[Future[list[Result]]]:
    done, left = wait(flying, return_when=FIRST_COMPLETED)
    for future in done:
        keep(results, future.result(), tell)
    return left


def keep(results: Results, flown: list[Result], tell: Callable[[int], None]) -> None:
    """Add what came, and tell how many."""
    results.add(flown)
    tell(len(flown))
