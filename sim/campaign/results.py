"""Results on disk: one JSON line each as they come, so that an interrupted campaign can go on."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from companion.errors import ConfigError
from sim.campaign.flight import Closeness, Flown
from sim.encounters import Encounter

# Durations of decisions are counted in bins, each a twentieth wider than the one before.
_SHORTEST_MS, _WIDER = 0.01, 1.05

Result = dict[str, Any]
Key = tuple[str, str, int]  # by whom, how known, which


def result_of(key: Key, encounter: Encounter, nominal: Closeness, flown: Flown) -> Result:
    """One line of the results. All but `timing` is the same whenever and wherever the encounter is flown."""
    avoider, surveillance, number = key
    return {
        "number": number,
        "avoider": avoider,
        "surveillance": surveillance,
        "id": encounter.encounter_id,
        "weight": encounter.weight,
        "geometry": encounter.geometry,
        "closing_mps": round(encounter.closing_mps, 2),
        "intruders": len(encounter.intruders),
        "nominal": _closeness(nominal),
        "flown": _closeness(flown.closeness),
        "deviation_m": round(flown.deviation_m, 2),
        "height_m": round(flown.height_m, 2),
        "avoided": flown.avoided,
        "engagements": flown.engagements,
        "first_action_s": None if flown.first_action_s is None else round(flown.first_action_s, 1),
        "back_s": None if flown.back_s is None else round(flown.back_s, 1),
        "timing": _histogram(flown.decision_ms),
    }


def _closeness(near: Closeness) -> dict[str, object]:
    return {
        "horizontal_m": round(near.horizontal_m, 2),
        "vertical_m": round(near.vertical_m, 2),
        "severity": round(near.severity, 5),
        "nmac": near.nmac,
        "lowc": near.lowc,
    }


def _histogram(durations_ms: list[float]) -> dict[str, int]:
    counts: dict[str, int] = {}
    for duration_ms in durations_ms:
        place = max(round(math.log(max(duration_ms, _SHORTEST_MS) / _SHORTEST_MS, _WIDER)), 0)
        counts[str(place)] = counts.get(str(place), 0) + 1
    return counts


def percentile_ms(counts: dict[str, int], share: float) -> float:
    """The duration that this share of the decisions counted in bins stays within [ms]."""
    total, seen = sum(counts.values()), 0
    for place, count in sorted((int(place), count) for place, count in counts.items()):
        seen += count
        if seen >= share * total:
            return round(_SHORTEST_MS * _WIDER**place, 3)
    return math.nan


@dataclass
class Results:
    """The file of one campaign, open for more."""

    path: Path
    done: set[Key]
    _file: TextIO

    @classmethod
    def open(cls, path: Path, identity: dict[str, object]) -> "Results":
        """Begin a file, or go on with one of the same campaign; a line that was cut off is flown again."""
        done: set[Key] = set()
        try:
            if path.exists() and path.stat().st_size > 0:
                _cut_unfinished(path)
                _, first = next(_lines(path), (0, {}))
                if first.get("campaign") != json.loads(json.dumps(identity)):
                    raise ConfigError(f"{path}: results of another campaign; name another file, or remove it")
                done = {key_of(result) for result in read_results(path)}
                return cls(path, done, path.open("a", encoding="utf-8"))
            file = path.open("w", encoding="utf-8")
            file.write(json.dumps({"campaign": identity}) + "\n")
            file.flush()
        except OSError as error:
            raise ConfigError(f"{path}: {error.strerror}") from error
        return cls(path, done, file)

    def add(self, results: list[Result]) -> None:
        """Keep these, each once, whatever becomes of the campaign."""
        for result in results:
            key = key_of(result)
            if key not in self.done:
                self.done.add(key)
                self._file.write(json.dumps(result) + "\n")
        self._file.flush()

    def close(self) -> None:
        """No more."""
        self._file.close()


def key_of(result: Result) -> Key:
    """Which flight a result is of."""
    return result["avoider"], result["surveillance"], result["number"]


def read_results(path: Path) -> Iterator[Result]:
    """The results of a file, one at a time."""
    for number, line in _lines(path):
        if "campaign" in line:
            continue
        if not line.keys() >= {"avoider", "surveillance", "number"}:
            raise ConfigError(f"{path}, line {number}: no result of a campaign")
        yield line


def _lines(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    with path.open(encoding="utf-8") as file:
        for number, text in enumerate(file, start=1):
            try:
                line = json.loads(text)
            except ValueError:
                line = None
            if not isinstance(line, dict):
                raise ConfigError(f"{path}, line {number}: no result of a campaign")
            yield number, line


def _cut_unfinished(path: Path) -> None:
    """Take off the last line when it does not end: whoever wrote it was killed meanwhile."""
    with path.open("rb+") as file:
        content = file.read()
        if not content.endswith(b"\n"):
            file.truncate(content.rfind(b"\n") + 1)
