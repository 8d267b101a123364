"""Logs whose time stamps make no clock, and logs of several vehicles: a recording with other stamps."""

import json
import math
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from companion.engine import Engine
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import Frame
from companion.mavlink.tlog import read_tlog
from companion.model import Layer
from companion.replay import Replay, replay
from tests.support.commands import call
from tests.support.paths import TLOGS
from tests.support.thorough import THOROUGH, sample

REAL = "arduplane_sitl_adsb_two_intruders"
NAME = REAL if THOROUGH and REAL in TLOGS else "arduplane_fake_two_intruders"
LONGEST_S = sample(95.0, math.inf)
START_US = 1_700_000_000_000_000
Stamp = Callable[[int], int]


def stepping_back(seconds: int) -> Stamp:
    """The clock of the recording computer is set back while the first intruder comes near."""
    return lambda since_us: START_US + since_us - (seconds * 1_000_000 if since_us > 60_000_000 else 0)


def byte_swapped(since_us: int) -> int:
    return int.from_bytes((START_US + since_us).to_bytes(8, "little"), "big")


NO_CLOCKS: dict[str, Stamp] = {
    "zero": lambda _: 0,
    "constant": lambda _: START_US,
    "milliseconds": lambda since_us: (START_US + since_us) // 1000,
    "little-endian": byte_swapped,
}


def recorded() -> Iterator[tuple[int, Frame]]:
    """The frames of the recording, to some time after the first intruder; times since its start [us]."""
    first_us: int | None = None
    for time_us, frame in read_tlog(TLOGS[NAME]):
        first_us = time_us if first_us is None else first_us
        if time_us - first_us > LONGEST_S * 1e6:
            return
        yield time_us - first_us, frame


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Replay:
    log = restamped(tmp_path_factory.mktemp("whole") / "log.tlog", lambda since_us: START_US + since_us)
    return replay(log, Engine())


def restamped(path: Path, stamp: Stamp) -> Path:
    """The recording with other time stamps."""
    with path.open("wb") as file:
        for since_us, frame in recorded():
            file.write(struct.pack(">Q", stamp(since_us) & (1 << 64) - 1) + frame.raw)
    return path


@pytest.mark.parametrize("kind", sample(["zero", "little-endian"], [*NO_CLOCKS]))
def test_without_usable_stamps_the_autopilots_time_is_used(tmp_path: Path, whole: Replay, kind: str) -> None:
    result = replay(restamped(tmp_path / "log.tlog", NO_CLOCKS[kind]), Engine())
    assert result.by_boot_time
    assert result.report()["clock"] == "time_boot_ms"
    assert result.duration_s == pytest.approx(whole.duration_s, rel=0.1)
    assert result.layers.keys() | {Layer.CLEAR} == whole.layers.keys() | {Layer.CLEAR}
    assert result.layers.total() == pytest.approx(whole.layers.total(), rel=0.1)


@pytest.mark.parametrize("seconds", sample([2, 58], [2, 30, 58, 3600]))
def test_stamps_that_step_back_and_stay_do_not_stop_the_time(
    tmp_path: Path, whole: Replay, seconds: int
) -> None:
    result = replay(restamped(tmp_path / "log.tlog", stepping_back(seconds)), Engine())
    assert not result.by_boot_time
    assert result.jumps == 1
    assert result.duration_s == pytest.approx(whole.duration_s, abs=2.0)
    for layer, count in whole.layers.items():
        assert result.layers[layer] == pytest.approx(count, rel=0.05, abs=5)


def test_stamps_in_nanoseconds_are_read_as_such(tmp_path: Path, whole: Replay) -> None:
    log = restamped(tmp_path / "log.tlog", lambda since_us: (START_US + since_us) * 1000)
    result = replay(log, Engine())
    assert (result.by_boot_time, result.jumps) == (False, 0)
    assert result.duration_s == pytest.approx(whole.duration_s, abs=0.01)
    for layer, count in whole.layers.items():
        assert result.layers[layer] == pytest.approx(count, abs=2)


def test_good_stamps_are_followed(whole: Replay) -> None:
    assert not whole.by_boot_time
    assert whole.jumps == 0


def with_second_vehicle(path: Path) -> Path:
    """The recording with every frame of the autopilot a second time, from system 2."""
    encoder = Encoder()
    decoder = mavlink.MAVLink(None)
    decoder.robust_parsing = True
    with path.open("wb") as file:
        for since_us, frame in recorded():
            time_us = START_US + since_us
            file.write(struct.pack(">Q", time_us) + frame.raw)
            if (frame.system_id, frame.component_id) == (1, 1):
                for message in decoder.parse_buffer(frame.raw) or []:
                    file.write(struct.pack(">Q", time_us) + encoder.encode(message, 2, 1))
    return path


def test_a_log_of_two_vehicles_says_how_to_choose(tmp_path: Path) -> None:
    log = with_second_vehicle(tmp_path / "two.tlog")
    run = call("replay", str(log))
    assert run.returncode == 1
    assert run.stderr.strip().endswith("systems 1, 2 are vehicles, choose one with --system")
    report = tmp_path / "report.json"
    assert call("replay", str(log), "--system", "1", "--report", str(report)).returncode == 0
    assert json.loads(report.read_text())["vehicles"] == [1, 2]
    run = call("replay", str(log), "--system", "7")
    assert run.returncode == 1
    assert run.stderr.strip().endswith("system 7 is not in it, but 1, 2")


def test_a_log_without_an_autopilot_fails_in_one_line(tmp_path: Path) -> None:
    log = tmp_path / "station.tlog"
    heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    frame = Encoder().encode(heartbeat, 255, 190)
    log.write_bytes(b"".join(struct.pack(">Q", START_US + at * 1_000_000) + frame for at in range(30)))
    run = call("replay", str(log))
    assert run.returncode == 1
    assert run.stderr.strip().endswith("it has no heartbeat of an autopilot")
