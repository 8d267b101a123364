"""State files: text that one run leaves to the next, whole even after a kill."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from companion.recording.state_file import DurableStateFile, StateFile


def test_a_text_is_read_back_with_its_age(tmp_path: Path) -> None:
    path = tmp_path / "companion.state"
    state_file = StateFile(path)
    assert state_file.read() is None
    state_file.write("one")
    state_file.write("two")
    long_ago_s = time.time() - 3600.0
    os.utime(path, (long_ago_s, long_ago_s))
    saved = state_file.read()
    assert saved is not None
    assert saved[0] == "two"
    assert saved[1] == pytest.approx(3600.0, abs=60.0)
    assert [entry.name for entry in tmp_path.iterdir()] == ["companion.state"]
    state_file.write(None)
    assert state_file.read() is None
    state_file.write(None)


def test_a_file_that_is_not_text_reads_as_none(tmp_path: Path) -> None:
    path = tmp_path / "companion.state"
    path.write_bytes(b"\xff\xfe\x00")
    state_file = StateFile(path)
    assert state_file.read() is None
    assert state_file.set_aside_because == "damaged"
    assert [entry.name for entry in tmp_path.iterdir()] == ["companion.state.bad"]
    (condition,) = state_file.conditions()
    assert condition.text == "Avoidance: old state not used: damaged"


def test_what_cannot_be_written_is_found_at_the_start_and_ends_when_it_can(tmp_path: Path) -> None:
    path = tmp_path / "later" / "companion.state"
    state_file = StateFile(path)
    state_file.try_writing()
    (condition,) = state_file.conditions()
    assert condition.text == f"Avoidance: state not saved: there is no folder {path.parent}"
    path.parent.mkdir()
    state_file.write("one")
    assert list(state_file.conditions()) == []


def test_an_unwritable_path_is_logged_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    state_file = StateFile(tmp_path / "nowhere" / "companion.state")
    state_file.write("one")
    state_file.write("two")
    assert [record.levelname for record in caplog.records] == ["ERROR"]


def test_durable_writes_are_done_in_order(tmp_path: Path) -> None:
    path = tmp_path / "companion.settings"
    state_file = DurableStateFile(path)
    for count in range(20):
        state_file.write(None if count % 3 == 0 else str(count))
    state_file.close()
    assert path.read_text() == "19"
    assert [entry.name for entry in tmp_path.iterdir()] == ["companion.settings"]


def test_a_disk_error_of_a_durable_write_is_logged_and_not_raised(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    state_file = DurableStateFile(tmp_path / "nowhere" / "companion.settings")
    state_file.write("one")
    state_file.write("two")
    state_file.close()
    assert [record.levelname for record in caplog.records] == ["ERROR"]


_WRITES_FOR_EVER = """
import itertools, json, pathlib, sys, time
from companion.recording.state_file import DurableStateFile
path = pathlib.Path(sys.argv[1])
state_file = DurableStateFile(path)
going = False
for count in itertools.count():
    state_file.write(json.dumps({"CA_OUTER_TIME": count, "end": "x" * 5000}))
    # On a busy disk the first ones take a while.
    if not going and path.exists() and json.loads(path.read_text())["CA_OUTER_TIME"] > 3:
        going = True
        print("going", flush=True)
    time.sleep(0.0003)
"""


def test_a_process_killed_while_writing_leaves_a_whole_file(tmp_path: Path) -> None:
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
        saved = json.loads(path.read_text())
        assert saved["end"] == "x" * 5000
        last = max(last, saved["CA_OUTER_TIME"])
    assert last > 3
