"""Results on disk, one JSON line per flight, so that an interrupted campaign can continue."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from companion.errors import ConfigError
from sim.campaign.flight import ClosestApproach, EncounterResult
from sim.encounters import Encounter

# Decision times are counted in bins, each 5 % wider than the one before.
_SHORTEST_MS, _WIDER = 0.01, 1.05

ResultLine = dict[str, Any]
Key = tuple[str, str, int]  # avoider, surveillance or radio, number of the encounter


def result_line(
    key: Key, encounter: Encounter, nominal: ClosestApproach, flown: EncounterResult
) -> ResultLine:
    """One line of the results; everything except `timing` is the same on any machine."""
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
        "source": encounter.source,
        "altitude_m": round(-encounter.own_position_m[2], 1),
        "nominal": _approach(nominal),
        "flown": _approach(flown.closest),
        "deviation_m": round(flown.deviation_m, 2),
        "height_m": round(flown.height_m, 2),
        "avoided": flown.avoided,
        "engagements": flown.engagements,
        "first_action_s": None if flown.first_action_s is None else round(flown.first_action_s, 1),
        "back_s": None if flown.back_s is None else round(flown.back_s, 1),
        "return_s": None if flown.return_s is None else round(flown.return_s, 1),
        "on_left_leg": flown.on_left_leg,
        "given_back_on_leg": flown.given_back_on_leg,
        "strayed_s": round(flown.strayed_s, 1),
        **({} if flown.mirrored is None else {"mirrored": list(flown.mirrored)}),
        "timing": histogram(flown.decision_ms),
    }


def _approach(near: ClosestApproach) -> dict[str, object]:
    return {
        "horizontal_m": round(near.horizontal_m, 2),
        "vertical_m": round(near.vertical_m, 2),
        "severity": round(near.severity, 5),
        "nmac": near.nmac,
        "lowc": near.lowc,
    }


def histogram(durations_ms: list[float]) -> dict[str, int]:
    """Counts of decision times by bin."""
    counts: dict[str, int] = {}
    for duration_ms in durations_ms:
        place = max(round(math.log(max(duration_ms, _SHORTEST_MS) / _SHORTEST_MS, _WIDER)), 0)
        counts[str(place)] = counts.get(str(place), 0) + 1
    return counts


def percentile_ms(counts: dict[str, int], share: float) -> float:
    """The quantile of decision times counted in bins [ms]."""
    total, seen = sum(counts.values()), 0
    for place, count in sorted((int(place), count) for place, count in counts.items()):
        seen += count
        if seen >= share * total:
            return round(_SHORTEST_MS * _WIDER**place, 3)
    return math.nan


@dataclass
class Results:
    """The results file of one campaign, open for appending."""

    path: Path
    done: set[Key]
    _file: TextIO

    @classmethod
    def open(cls, path: Path, identity: dict[str, object]) -> "Results":
        """Create a file, or continue one of the same campaign; an incomplete last line is removed."""
        done: set[Key] = set()
        try:
            if path.exists() and path.stat().st_size > 0:
                _cut_unfinished(path)
                _, first = next(_lines(path), (0, {}))
                if first.get("campaign") != json.loads(json.dumps(identity)):
                    raise ConfigError(
                        f"{path}: results of another campaign; choose another file, or remove it"
                    )
                done = {key_of(result) for result in read_results(path)}
                return cls(path, done, path.open("a", encoding="utf-8"))
            file = path.open("w", encoding="utf-8")
            file.write(json.dumps({"campaign": identity}) + "\n")
            file.flush()
        except OSError as error:
            raise ConfigError(f"{path}: {error.strerror}") from error
        return cls(path, done, file)

    def add(self, results: list[ResultLine]) -> None:
        """Write results, each flight once, and flush."""
        for result in results:
            key = key_of(result)
            if key not in self.done:
                self.done.add(key)
                self._file.write(json.dumps(result) + "\n")
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def key_of(result: ResultLine) -> Key:
    """The key of a result's flight."""
    return result["avoider"], result.get("surveillance") or result["radio"], result["number"]


def read_results(path: Path) -> Iterator[ResultLine]:
    """The results of a file, one at a time."""
    for number, line in _lines(path):
        if "campaign" in line:
            continue
        if not (line.keys() >= {"avoider", "number"} and line.keys() & {"surveillance", "radio"}):
            raise ConfigError(f"{path}, line {number}: not a result of a campaign")
        yield line


def _lines(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    with path.open(encoding="utf-8") as file:
        for number, text in enumerate(file, start=1):
            try:
                line = json.loads(text)
            except ValueError:
                line = None
            if not isinstance(line, dict):
                raise ConfigError(f"{path}, line {number}: not a result of a campaign")
            yield number, line


def _cut_unfinished(path: Path) -> None:
    """Remove an incomplete last line, left by a process that was killed while writing."""
    with path.open("rb+") as file:
        content = file.read()
        if not content.endswith(b"\n"):
            file.truncate(content.rfind(b"\n") + 1)
