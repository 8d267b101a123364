"""Recorded flights through the engine: times of the first action, and the same bytes every time."""

import json
from functools import cache
from pathlib import Path

import pytest

from companion.engine import Engine
from companion.mavlink.log_clock import LogClock
from companion.model import Layer
from companion.replay import Replay, replay
from tests.support.paths import TLOGS
from tests.support.thorough import THOROUGH, sample

# Closest approaches in the logs by intruder, seconds since the start, measured on the logged positions.
CLOSEST_S = {
    "arduplane_fake_two_intruders": {"B00001": 60.0, "B00002": 110.0},
    "px4_fake_two_intruders": {"B00001": 60.0, "B00002": 110.0},
    "arduplane_sitl_adsb_two_intruders": {"A00000": 166.1, "A00001": 302.2},
    "px4_sih_fixed_wing_adsb_two_intruders": {"A10001": 79.5, "A10002": 138.8},
}
# This one ends within the second encounter.
CUT_SHORT = "px4_sih_fixed_wing_adsb_two_intruders"
# So much of each log without traffic is flown; `test_real_logs_read.py` reads all of it.
LONGEST_BYTES = sample(1_000_000, None)


@cache
def decide(log: Path) -> tuple[Replay, list[str]]:
    lines: list[str] = []
    return replay(log, Engine(), on_decision=lines.append), lines


def first_action_s(lines: list[str], track: str) -> float:
    """When an aircraft was first avoided [s since the first decision]."""
    decisions = [json.loads(line) for line in lines]
    acted_us = next(
        decision["time_us"]
        for decision in decisions
        if decision["guidance"] is not None and track in {threat["track"] for threat in decision["threats"]}
    )
    seconds: float = (acted_us - decisions[0]["time_us"]) / 1e6
    return seconds


@pytest.mark.parametrize("name", [name for name in CLOSEST_S if name in TLOGS])
def test_both_intruders_are_avoided_in_time(name: str) -> None:
    result, lines = decide(TLOGS[name])
    assert result.messages > 3_000
    assert result.bad_bytes == 0
    for track, at_s in CLOSEST_S[name].items():
        assert first_action_s(lines, track) <= at_s - 20.0
    assert result.events[0][1] is Layer.OUTER, "first by the outer layer"
    assert result.layers[Layer.INNER] > 0, "the advice was not flown, so that the inner layer acted"
    assert result.events[-1][1] is Layer.CLEAR or name == CUT_SHORT
    if THOROUGH or name == "arduplane_fake_two_intruders":
        again, lines_again = decide.__wrapped__(TLOGS[name])
        assert lines_again == lines
        assert again.report()["layers"] == result.report()["layers"]


@pytest.mark.parametrize("name", [name for name in CLOSEST_S if name in TLOGS][:1])
def test_a_replay_lists_the_aircraft_with_their_sources(name: str) -> None:
    result, lines = decide(TLOGS[name])
    aircraft = {one["track"]: one for one in result.report()["aircraft"]}  # type: ignore[attr-defined]
    assert set(aircraft) == set(CLOSEST_S[name])
    decisions = [json.loads(line) for line in lines]
    for track, at_s in CLOSEST_S[name].items():
        one = aircraft[track]
        assert one["sources"] == ["ADS-B"]
        assert one["closest_s"] == pytest.approx(at_s, abs=2.0)
        seen = [each for decision in decisions for each in decision["traffic"] if each["track"] == track]
        assert one["reports"] == max(each["reports"] for each in seen) > 50
        assert 0.0 <= one["first_heard_s"] < one["last_heard_s"]
    table = [*result.sightings.lines()]
    assert len(table) == 1 + len(aircraft)
    assert table[0].split()[0] == "aircraft"
    assert all(line.endswith("ADS-B") for line in table[1:])


@pytest.mark.parametrize("name", [name for name in TLOGS if name not in CLOSEST_S])
def test_logs_without_traffic_stay_clear(name: str, tmp_path: Path) -> None:
    log = tmp_path / "log.tlog"
    log.write_bytes(TLOGS[name].read_bytes()[:LONGEST_BYTES])
    result, lines = decide(log)
    assert result.messages > 500
    assert result.layers[Layer.CLEAR] == len(lines)
    assert result.layers.total() == len(lines)
    assert result.events == []


def test_the_log_clock_never_runs_backwards_and_ignores_impossible_jumps() -> None:
    clock = LogClock()
    stamps = [1_000_000, 2_000_000, 1_500_000, 99_000_000_000_000, 99_000_000_500_000, 3_000_000, 4_000_000]
    times = [clock.at(stamp) for stamp in stamps]
    assert times == sorted(times)
    assert times[:3] == [1_000_000, 2_000_000, 2_000_000]
    assert times[-1] - times[0] < 5_000_000
    assert clock.jumps == 2
