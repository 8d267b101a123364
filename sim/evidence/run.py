"""Flies the campaigns of the evidence; a second run flies only what is missing."""

from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from rich.console import Console

from companion.errors import CompanionError, ConfigError, require
from sim.campaign.avoiders import COMPANION
from sim.campaign.cluster import parse_scheduler_address, run_on
from sim.campaign.command import LOCAL, progress
from sim.campaign.environment import environment
from sim.campaign.plan import Plan
from sim.campaign.results import Key, ResultLine, Results
from sim.campaign.runner import run_here, run_tasks
from sim.encounters import Encounter
from sim.evidence.consistency import TRACKS, follow_task
from sim.evidence.plan import Campaign, EvidencePlan
from sim.evidence.versions import note_version

OnFlown = Callable[[int], None]
_FOLLOWED_AT_ONCE = 20


def fly_all(
    evidence: EvidencePlan, folder: Path, console: Console, *, workers: int | None, scheduler: str
) -> None:
    """Fly what the results files in a folder lack, with one progress bar over the whole."""
    if scheduler != LOCAL:
        if workers is not None:
            raise ConfigError("--workers: only for this machine; a scheduler's workers are started elsewhere")
        parse_scheduler_address(scheduler)
        require("distributed", "companion-sim evidence --scheduler", "sim")
    _check(evidence)
    done = sum(_done(campaign, folder) for campaign in evidence.campaigns.values()) + _followed(
        evidence, folder
    )
    if done < evidence.flights:
        note_version(folder, environment((COMPANION, *evidence.peers)))
    try:
        with progress(console, evidence.flights, done, "flights") as on_flown:
            for campaign in evidence.campaigns.values():
                _fly(campaign, folder, console, workers, scheduler, on_flown)
            _follow(evidence, folder, workers, on_flown)
    except KeyboardInterrupt:
        raise CompanionError(
            f"evidence: interrupted; the results are kept in {folder}, start again to continue"
        ) from None


def results_file(folder: Path, name: str) -> Path:
    """The results file of a campaign."""
    return folder / f"{name}.ndjson"


def _check(evidence: EvidencePlan) -> None:
    """`ConfigError` if a model or an avoider's library is missing; all campaigns share them."""
    for name in ("perfect", "two-sided", "peers"):
        if name in evidence.campaigns:
            evidence.campaigns[name].plan.check()
    for campaign in evidence.campaigns.values():
        campaign.plan.engine_for(campaign.plan.avoiders[0])


def _fly(
    campaign: Campaign, folder: Path, console: Console, workers: int | None, scheduler: str, on_flown: OnFlown
) -> None:
    plan = campaign.plan
    results = Results.open(results_file(folder, campaign.name), plan.identity())
    try:
        if not set(_keys(plan)) - results.done:
            return
        if scheduler == LOCAL:
            run_here(plan, results, workers=workers, on_flown=on_flown)
        else:
            on_notice = partial(console.print, markup=False, soft_wrap=True)
            run_on(scheduler, plan, results, on_flown=on_flown, on_notice=on_notice)
    finally:
        results.close()


def _follow(evidence: EvidencePlan, folder: Path, workers: int | None, on_flown: OnFlown) -> None:
    """Compare the tracks of each preset with the truth; on this machine, as it takes seconds."""
    plan = evidence.base(1.0)
    results = Results.open(results_file(folder, TRACKS), {TRACKS: plan.identity()})
    try:
        left = [key for key in _followed_keys(evidence) if key not in results.done]
        if left:
            _source(plan)  # read once: forked processes inherit it
            run_tasks(_tasks(plan, left), _follow_task, results, workers=workers, on_flown=on_flown)
    finally:
        results.close()


def _tasks(plan: Plan, keys: list[Key]) -> Iterator[tuple[Plan, str, tuple[int, ...]]]:
    for preset in dict.fromkeys(preset for _, preset, _ in keys):
        numbers = [number for _, one, number in keys if one == preset]
        for begin in range(0, len(numbers), _FOLLOWED_AT_ONCE):
            yield plan, preset, tuple(numbers[begin : begin + _FOLLOWED_AT_ONCE])


def _follow_task(task: tuple[Plan, str, tuple[int, ...]]) -> list[ResultLine]:
    return follow_task(task, _source(task[0]))


@lru_cache(maxsize=1)
def _source(plan: Plan) -> Callable[[int], Encounter]:
    return plan.source()


def _keys(plan: Plan) -> Iterator[Key]:
    return ((who, how, n) for who in plan.avoiders for how in plan.surveillance for n in plan.numbers())


def _followed_keys(evidence: EvidencePlan) -> Iterator[Key]:
    numbers = evidence.part.numbers(evidence.tracks)
    return ((TRACKS, preset, number) for preset in evidence.presets for number in numbers)


def _done(campaign: Campaign, folder: Path) -> int:
    """The flights of a campaign that its file has already; `ConfigError` for a file of another one."""
    return _present(results_file(folder, campaign.name), campaign.plan.identity(), set(_keys(campaign.plan)))


def _followed(evidence: EvidencePlan, folder: Path) -> int:
    identity = {TRACKS: evidence.base(1.0).identity()}
    return _present(results_file(folder, TRACKS), identity, set(_followed_keys(evidence)))


def _present(path: Path, identity: dict[str, Any], wanted: set[Key]) -> int:
    if not path.exists():
        return 0
    results = Results.open(path, identity)
    results.close()
    return len(results.done & wanted)
