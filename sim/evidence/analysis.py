"""The analysis of the flown campaigns: everything that page, document and JSON show, as plain numbers."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from companion.avoidance import AvoidanceParams
from companion.traffic import TrafficParams
from sim.campaign.avoiders import COMPANION
from sim.campaign.environment import environment, machine
from sim.campaign.plan import BOTH
from sim.campaign.plane import Limits
from sim.campaign.results import ResultLine, read_results
from sim.campaign.summary import Figures
from sim.encounters import surveillance_of
from sim.evidence.consistency import TRACKS, consistency_of
from sim.evidence.measures import (
    chosen_columns,
    convergence_of,
    groups_of,
    measured,
    row_of,
    sets_of,
)
from sim.evidence.pass_lines import PASS_LINES, verdicts
from sim.evidence.plan import PERFECT, Campaign, EvidencePlan, campaign_of, trade_off_campaign
from sim.evidence.run import results_file
from sim.evidence.sweeps import BASE
from sim.evidence.versions import versions_of

# The product on the peers' encounters, which are fewer.
SAME = f"{COMPANION}, the peers' encounters"
# Presets whose figures are shown by group.
GROUPED = (PERFECT, BASE)


class Analysis:
    """The results of an evidence plan in a folder."""

    def __init__(self, evidence: EvidencePlan, folder: Path) -> None:
        self._evidence, self._folder = evidence, folder
        # The campaign that was read last, as its figures are asked for one after the other.
        self._read: tuple[str, dict[tuple[str, str], Figures]] = ("", {})
        self._main = {
            preset: self.figures(self._main_campaign(preset), preset) for preset in evidence.presets
        }

    def report(self) -> dict[str, Any]:
        """All figures."""
        return {
            "configuration": self._configuration(),
            "encounter_sets": sets_of(self._main[PERFECT]),
            "presets": {name: asdict(surveillance_of(name)) for name in self._evidence.presets},
            "results": {preset: self._table(preset) for preset in self._evidence.presets},
            "pass_lines": [asdict(line) for line in PASS_LINES],
            "height_locked": measured(self.figures("height-locked", PERFECT)),
            "two_sided": self._two_sided(),
            "convergence": {preset: self._convergence(preset) for preset in self._evidence.presets},
            "groups": {preset: self._groups(preset) for preset in GROUPED if preset in self._main},
            "sweeps": [self._sweep(place) for place in range(len(self._evidence.sweeps))],
            "trade_off": self._trade_off(),
            "tracks": self._tracks(),
        }

    def figures(self, name: str, preset: str, avoider: str = COMPANION) -> Figures:
        """The results of one avoider with one surveillance in a campaign."""
        if self._read[0] != name:
            found: dict[tuple[str, str], Figures] = {}
            for line in self._lines(name):
                found.setdefault((line["avoider"], line["surveillance"]), Figures()).add(line)
            self._read = name, found
        return self._read[1].get((avoider, preset), Figures())

    def main_lines(self, preset: str) -> tuple[Campaign, Iterator[ResultLine]]:
        """The product's results with a preset, and their campaign."""
        name = self._main_campaign(preset)
        return self._campaign(name), (line for line in self._lines(name) if line["surveillance"] == preset)

    def _lines(self, name: str) -> Iterator[ResultLine]:
        plan = self._campaign(name).plan
        return (line for line in read_results(results_file(self._folder, name)) if plan.wants(line))

    def _campaign(self, name: str) -> Campaign:
        return self._evidence.campaigns[name]

    def _main_campaign(self, preset: str) -> str:
        return PERFECT if preset == PERFECT else "presets"

    def _configuration(self) -> dict[str, Any]:
        evidence = self._evidence
        return {
            "versions": environment((COMPANION, *evidence.peers)),
            "flown_by": versions_of(self._folder),
            "machine": machine(),
            "seed": evidence.seed,
            "part": str(evidence.part),
            "encounters": evidence.encounters,
            "flights": {name: one.plan.flights for name, one in evidence.campaigns.items()},
            "models": [Path(name).name for name in evidence.models],
            "aircraft": _plain(asdict(Limits())),
            "avoidance": _plain(asdict(AvoidanceParams())),
            "traffic": _plain(asdict(TrafficParams())),
        }

    def _table(self, preset: str) -> dict[str, Any]:
        """The measures of all avoiders with a preset, and whether the product meets the pass lines."""
        rows = {COMPANION: measured(self._main[preset])}
        rows[COMPANION]["pass"] = verdicts(rows[COMPANION])
        if self._evidence.peers:
            rows[SAME] = row_of(self._on_peers_encounters(preset))
        for peer in self._evidence.peers:
            rows[peer] = measured(self.figures("peers", preset, peer))
        return rows

    def _on_peers_encounters(self, preset: str) -> dict[str, Any]:
        columns = self._main[preset].columns()
        numbers = self._campaign("peers").plan.numbers()
        return chosen_columns(columns, np.isin(columns["number"], np.array(numbers)))

    def _two_sided(self) -> dict[str, Any]:
        return {
            preset: {
                avoider: measured(self.figures("two-sided", preset, avoider))
                for avoider in (COMPANION, COMPANION + BOTH)
            }
            for preset in self._campaign("two-sided").plan.surveillance
        }

    def _convergence(self, preset: str) -> dict[str, Any]:
        columns = self._main[preset].columns()
        return {
            name: convergence_of(columns, event)
            for name, event in (("risk_ratio", "nmac"), ("lowc_ratio", "lowc"))
        }

    def _groups(self, preset: str) -> dict[str, Any]:
        figures = self._main[preset]
        columns = figures.columns()
        return {
            dimension: {name: row_of(chosen_columns(columns, chosen)) for name, chosen in masks.items()}
            for dimension, masks in groups_of(figures).items()
        }

    def _sweep(self, place: int) -> dict[str, Any]:
        sweep = self._evidence.sweeps[place]
        points = []
        for number, point in enumerate(sweep.points):
            figures = self.figures(campaign_of(sweep, number), point.surveillance)
            how = {"label": point.label, "value": point.value, "surveillance": point.surveillance}
            points.append(how | {"own_limits": dict(point.own_limits)} | row_of(figures.columns()))
        return {"name": sweep.name, "title": sweep.title, "unit": sweep.unit, "points": points}

    def _trade_off(self) -> list[dict[str, Any]]:
        rows = []
        for label, changes in self._evidence.trade_off:
            figures = self.figures(trade_off_campaign(label), BASE)
            rows.append({"label": label, "changes": dict(changes)} | row_of(figures.columns()))
        return rows

    def _tracks(self) -> dict[str, Any]:
        numbers = self._evidence.part.numbers(self._evidence.tracks)
        lines: dict[str, list[ResultLine]] = {preset: [] for preset in self._evidence.presets}
        for line in read_results(results_file(self._folder, TRACKS)):
            if line["number"] in numbers and line["surveillance"] in lines:
                lines[line["surveillance"]].append(line)
        return {preset: consistency_of(found) for preset, found in lines.items()}


def _plain(value: Any) -> Any:
    """A value for JSON: numbers stay, sets become lists, and the rest text."""
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, (set, frozenset)):
        return sorted(str(one) for one in value)
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    return value if value is None or isinstance(value, (bool, int, float)) else str(value)
