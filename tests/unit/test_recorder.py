"""The recorder: names, contents, and a disk that fails in flight."""

import asyncio
import errno
import os
from pathlib import Path

import pytest

from companion import recorder as recorder_module
from companion.errors import LogError
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.tlog import read_tlog
from companion.recorder import Recorder

STARTED_S = 1_700_000_000.9  # 2023-11-14 22:13:20 UTC


def frame() -> bytes:
    return Encoder().encode(mavlink.MAVLink_mission_current_message(1), 1, 1)


def test_a_run_is_recorded_under_its_start_in_utc(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "logs" / "new", STARTED_S)
    recorder.received(1_000_000, frame())
    recorder.sent(2_000_000, frame())
    recorder.decision('{"layer": "clear"}')
    recorder.decision('{"layer": "öuter"}')
    # Nothing is closed: this is what a killed process leaves behind.
    assert recorder.tlog_path == tmp_path / "logs" / "new" / "companion-20231114-221320.tlog"
    assert [(time_us, one.raw) for time_us, one in read_tlog(recorder.tlog_path)] == [
        (1_000_000, frame()),
        (2_000_000, frame()),
    ]
    assert recorder.decisions_path.name == "companion-20231114-221320.jsonl"
    assert recorder.decisions_path.read_text() == '{"layer": "clear"}\n{"layer": "öuter"}\n'
    assert recorder.problem is None
    recorder.close()


def test_a_second_run_in_the_same_second_takes_another_name(tmp_path: Path) -> None:
    (tmp_path / "companion-20231114-221320-2.jsonl").touch()  # half of a pair is enough to be taken
    names = []
    for _ in range(3):
        recorder = Recorder(tmp_path, STARTED_S)
        names.append((recorder.tlog_path.stem, recorder.decisions_path.stem))
        recorder.close()
    stem = "companion-20231114-221320"
    assert names == [(stem, stem), (f"{stem}-3", f"{stem}-3"), (f"{stem}-4", f"{stem}-4")]


def test_a_folder_that_cannot_be_used_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(LogError, match="cannot record here"):
        Recorder(tmp_path / "file", STARTED_S)
    with pytest.raises(LogError, match="cannot record here"):
        Recorder(tmp_path / "file" / "below", STARTED_S)


@pytest.mark.parametrize("what", ["received", "decision"])
def test_a_full_disk_is_told_and_not_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    def full(_descriptor: int, _data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    recorder = Recorder(tmp_path, STARTED_S)
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", full)
        if what == "received":
            recorder.received(1, frame())
        else:
            recorder.decision("{}")
    assert recorder.problem is not None
    assert "No space left on device" in recorder.problem
    recorder.received(2, frame())
    assert len(list(read_tlog(recorder.tlog_path))) == 1
    recorder.close()


def test_text_that_is_no_unicode_is_recorded_all_the_same(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, STARTED_S)
    recorder.decision("\ud800")
    assert recorder.decisions_path.read_text() == "\\ud800\n"
    recorder.close()


async def test_both_files_are_synced_again_and_again_off_the_event_loop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "_SYNC_PERIOD_S", 0.001)
    recorder = Recorder(tmp_path, STARTED_S)
    loop, synced, enough = asyncio.get_running_loop(), [], asyncio.Event()

    def counting(descriptor: int) -> None:
        with pytest.raises(RuntimeError):
            asyncio.get_running_loop()  # there is none in a worker thread
        synced.append(descriptor)
        if len(synced) >= 6:
            loop.call_soon_threadsafe(enough.set)

    with monkeypatch.context() as patched:
        patched.setattr(os, "fdatasync", counting)
        running = asyncio.create_task(recorder.run())
        async with asyncio.timeout(5.0):
            await enough.wait()
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running
        await asyncio.get_running_loop().shutdown_default_executor()
    recorder.close()
    assert len(set(synced)) == 2


def test_nothing_happens_after_closing(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, STARTED_S)
    recorder.close()
    recorder.close()
    recorder.received(1, frame())
    recorder.decision("{}")
    recorder._sync()
    assert recorder.problem is None
    assert recorder.tlog_path.read_bytes() == b""
