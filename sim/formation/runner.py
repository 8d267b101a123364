"""Flies a formation campaign; the number of processes does not change the results."""

from collections.abc import Callable, Iterator
from itertools import islice, product

from sim.campaign.results import ResultLine, Results, histogram
from sim.campaign.runner import run_tasks
from sim.formation.flight import FormationFlight, fly
from sim.formation.judgement import judge
from sim.formation.plan import FormationPlan

Task = tuple[FormationPlan, str, str, tuple[int, ...]]  # avoider, radio, numbers of the crossings

# Crossings per task: several seconds of work.
_TASK_SIZE = 2


def tasks_of(plan: FormationPlan, results: Results) -> Iterator[Task]:
    """The remaining flights, as tasks."""
    for radio, avoider in product(plan.radios, plan.avoiders):
        left = iter([n for n in plan.numbers() if (avoider, radio, n) not in results.done])
        while numbers := tuple(islice(left, _TASK_SIZE)):
            yield plan, avoider, radio, numbers


def fly_task(task: Task) -> list[ResultLine]:
    """Fly a task in this process."""
    plan, avoider, radio, numbers = task
    return [result_line(plan, avoider, radio, number) for number in numbers]


def fly_one(plan: FormationPlan, avoider: str, radio: str, number: int) -> FormationFlight:
    """Fly one crossing of a plan."""
    return fly(plan.crossing(number), avoider, plan.conditions(radio), plan.seed + number)


def result_line(plan: FormationPlan, avoider: str, radio: str, number: int) -> ResultLine:
    """Fly a crossing: one line of the results; everything except `timing` is the same on any machine."""
    flight = fly_one(plan, avoider, radio, number)
    return {
        "number": number,
        "avoider": avoider,
        "radio": radio,
        "members": plan.members,
        **judge(flight, plan.separation).line(),
        "arrived_s": [None if one is None else round(one, 1) for one in flight.arrived_s],
        "engagements": sum(flight.engagements),
        "intent_bytes_per_s": flight.intent_bytes_per_s,
        "timing": histogram(flight.decision_ms),
    }


def run_here(
    plan: FormationPlan,
    results: Results,
    *,
    workers: int | None = None,
    on_flown: Callable[[int], None] = lambda _: None,
) -> None:
    """Fly the remaining crossings in processes of this machine."""
    run_tasks(tasks_of(plan, results), fly_task, results, workers=workers, on_flown=on_flown)
