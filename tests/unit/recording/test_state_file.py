"""What one run leaves to the next."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from companion.recording.state_file import DurableStateFile, StateFile


def test_what_is_kept_is_read_with_its_age(tmp_path: Path) -> None:
    path = tmp_path / "companion.state"
    keeper = StateFile(path)
    assert keeper.read() is None
    keeper.keep("one")
    keeper.keep("two")
    long_ago_s = time.time() - 3600.0
    os.utime(path, (long_ago_s, long_ago_s))
    kept = keeper.read()
    assert kept is not None
    assert kept[0] == "two"
    assert kept[1] == pytest.approx(3600.0, abs=60.0)
    assert [entry.name for entry in tmp_path.iterdir()] == ["companion.state"]
    keeper.keep(None)
    assert keeper.read() is None
    keeper.keep(None)


def test_what_is_no_text_is_nothing(tmp_path: Path) -> None:
    path = tmp_path / "companion.state"
    path.write_bytes(b"\xff\xfe\x00")
    assert StateFile(path).read() is None


def test_a_place_that_cannot_be_written_is_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    keeper = StateFile(tmp_path / "nowhere" / "companion.state")
    keeper.keep("one")
    keeper.keep("two")
    assert [record.levelname for record in caplog.records] == ["ERROR"]


def test_what_is_to_last_is_there_in_the_order_in_which_it_was_kept(tmp_path: Path) -> None:
    path = tmp_path / "companion.settings"
    keeper = DurableStateFile(path)
    for count in range(20):
        keeper.keep(None if count % 3 == 0 else str(count))
    keeper.close()
    assert path.read_text() == "19"
    assert [entry.name for entry in tmp_path.iterdir()] == ["companion.settings"]


def test_a_disk_that_fails_keeps_nobody_from_flying(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    keeper = DurableStateFile(tmp_path / "nowhere" / "companion.settings")
    keeper.keep("one")
    keeper.keep("two")
    keeper.close()
    assert [record.levelname for record in caplog.records] == ["ERROR"]


_WRITES_FOR_EVER = """
import itertools, json, pathlib, sys, time
from companion.recording.state_file import DurableStateFile
path = pathlib.Path(sys.argv[1])
keeper = DurableStateFile(path)
going = False
for count in itertools.count():
    keeper.keep(json.dumps({"CA_OUTER_TIME": count, "end": "x" * 5000}))
    if not going and path.exists():  # a busy disk takes its time for the first one
        going = True
        print("going", flush=True)
    time.sleep(0.0003)
"""


def test_killed_while_it_writes_it_leaves_what_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "companion.settings"
    last = -1
    for attempt in range(8):
        words = [sys.executable, "-c", _WRITES_FOR_EVER, str(path)]
        process = subprocess.Popen(words, stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(0.02 + 0.0037 * attempt)
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=10.0)
        kept = json.loads(path.read_text())
        assert kept["end"] == "x" * 5000
        last = max(last, kept["CA_OUTER_TIME"])
    assert last > 3
