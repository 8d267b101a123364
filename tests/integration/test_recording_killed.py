"""A recording process killed at any moment leaves readable files that lack at most one second."""

import json
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from companion.mavlink.tlog import read_tlog
from companion.recording import parts_in, read_mcap, repair_all

# Records decisions and frames in several parts, and prints the number of the newest.
RECORDS = """
import asyncio, itertools, json, sys, time
from pathlib import Path
from companion.mavlink.dialect import Encoder, mavlink
from companion.recording.recorder import Recorder

async def main():
    recorder = Recorder(Path(sys.argv[1]), 1_700_000_000.0, max_file_bytes=400_000)
    running = asyncio.create_task(recorder.run())
    frame = Encoder().encode(mavlink.MAVLink_mission_current_message(1), 1, 1)
    for number in itertools.count(1):
        recorder.received(number, frame)
        recorder.decision(number, json.dumps({"n": number, "words": "x" * 500}))
        recorder.state(number, json.dumps({"n": number}))
        print(number, time.monotonic(), flush=True)
        await asyncio.sleep(0.002)

asyncio.run(main())
"""


@pytest.mark.parametrize("seed", range(4))
def test_killed_at_any_moment(tmp_path: Path, seed: int) -> None:
    command = [sys.executable, "-c", RECORDS, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(random.Random(seed).uniform(1.2, 4.0))
        process.kill()
        printed = [line.split() for line in process.stdout.read().splitlines() if line.count(" ") == 1]
    newest, ended_s = int(printed[-1][0]), float(printed[-1][1])
    a_second_before = max(int(number) for number, at_s in printed if float(at_s) <= ended_s - 1.25)

    names = list(parts_in(tmp_path))
    texts = [name.path(tmp_path, ".jsonl").read_text() for name in names]
    lines = [json.loads(line)["n"] for text in texts for line in text.splitlines()]
    assert lines[:newest] == list(range(1, newest + 1)), "a killed process loses no line"
    logged = [
        time_us
        for name in names
        if name.path(tmp_path, ".tlog").stat().st_size
        for time_us, _ in read_tlog(name.path(tmp_path, ".tlog"))
    ]
    assert logged[:newest] == list(range(1, newest + 1)), "a killed process loses no frame"

    def states() -> list[int]:
        mcaps = [name.path(tmp_path, ".mcap") for name in names]
        return [e.time_us for path in mcaps for e in read_mcap(path) if e.topic == "/companion/state"]

    before = states()
    assert before == list(range(1, len(before) + 1))
    assert len(before) >= a_second_before
    repaired = repair_all(tmp_path)
    assert len(repaired) in (0, 1, 2), "the newest, and one that was full a moment ago"
    assert states() == before
    assert repair_all(tmp_path) == []
