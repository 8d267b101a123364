"""The recorder: file names, contents, and disk errors in flight."""

import asyncio
import errno
import os
import shutil
from pathlib import Path

import pytest

from companion.errors import LogError
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.tlog import read_tlog
from companion.recording import McapReader, PartName, parts_in, read_mcap, remove_oldest
from companion.recording import recorder as recorder_module
from companion.recording.recorder import Recorder

STARTED_S = 1_700_000_000.9  # 2023-11-14 22:13:20 UTC


def frame() -> bytes:
    return Encoder().encode(mavlink.MAVLink_mission_current_message(1), 1, 1)


def test_a_recording_is_named_after_its_start_in_utc(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "logs" / "new", STARTED_S)
    recorder.received(1_000_000, frame())
    recorder.sent(2_000_000, frame())
    recorder.decision(1_000_000, '{"layer": "clear"}')
    recorder.decision(1_100_000, '{"layer": "öuter"}')
    # Nothing is closed, as after a killed process.
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
    (tmp_path / "companion-20231114-221320-2.jsonl").touch()  # one file is enough for a name to be taken
    names = []
    for _ in range(3):
        recorder = Recorder(tmp_path, STARTED_S)
        names.append((recorder.tlog_path.stem, recorder.decisions_path.stem))
        recorder.close()
    stem = "companion-20231114-221320"
    assert names == [(stem, stem), (f"{stem}-3", f"{stem}-3"), (f"{stem}-4", f"{stem}-4")]


def test_an_unusable_folder_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(LogError, match="cannot record here"):
        Recorder(tmp_path / "file", STARTED_S)
    with pytest.raises(LogError, match="cannot record here"):
        Recorder(tmp_path / "file" / "below", STARTED_S)


@pytest.mark.parametrize("what", ["received", "decision", "state"])
def test_a_full_disk_is_reported_but_not_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    def full(_descriptor: int, _data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    recorder = Recorder(tmp_path, STARTED_S)
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", full)
        if what == "received":
            recorder.received(1, frame())
        elif what == "decision":
            recorder.decision(1, "{}")
        else:
            recorder.state(1, "{}")
            recorder._sync()
    assert recorder.problem is not None
    assert "No space left on device" in recorder.problem
    recorder.received(2, frame())
    assert len(list(read_tlog(recorder.tlog_path))) == 1
    recorder.close()


def test_a_text_with_a_lone_surrogate_is_recorded(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, STARTED_S)
    recorder.decision(1, "\ud800")
    assert recorder.decisions_path.read_text() == "\\ud800\n"
    recorder.close()


async def test_all_files_are_synced_repeatedly_in_a_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "_SYNC_PERIOD_S", 0.001)
    recorder = Recorder(tmp_path, STARTED_S)
    loop, synced, enough = asyncio.get_running_loop(), [], asyncio.Event()

    def counting(descriptor: int) -> None:
        with pytest.raises(RuntimeError):
            asyncio.get_running_loop()  # a worker thread has none
        synced.append(descriptor)
        if len(synced) >= 9:
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
    assert len(set(synced)) == 3


def test_nothing_is_recorded_after_closing(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, STARTED_S)
    recorder.close()
    recorder.close()
    recorder.received(1, frame())
    recorder.decision(1, "{}")
    recorder._sync()
    assert recorder.problem is None
    assert recorder.tlog_path.read_bytes() == b""


def test_the_mcap_file_has_decisions_states_and_texts(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, STARTED_S)
    recorder.decision(1_000_000, '{"layer":"clear"}')
    recorder.state(1_000_001, '{"version":1}')
    recorder._sync()
    recorder.text(2_000_000, 4, 'Traffic "N1"')
    recorder.close()
    assert recorder.mcap_path.name == "companion-20231114-221320.mcap"
    assert list(read_mcap(recorder.mcap_path)) == [
        ("/companion/decision", 1_000_000, b'{"layer":"clear"}'),
        ("/companion/state", 1_000_001, b'{"version":1}'),
        ("/companion/text", 2_000_000, b'{"time_us": 2000000, "severity": 4, "text": "Traffic \\"N1\\""}'),
    ]


def test_a_new_part_begins_when_a_file_is_full_and_nothing_is_lost(tmp_path: Path) -> None:
    recorder, limit = Recorder(tmp_path, STARTED_S, max_file_bytes=5_000), 5_000
    for second in range(60):
        for tenth in range(10):
            recorder.received(second, frame())
            recorder.decision(10 * second + tenth, f'{{"n":{10 * second + tenth}}}')
        recorder._sync()
    recorder.close()
    parts = parts_in(tmp_path)
    assert len(parts) > 2
    assert [name.part for name in parts] == list(range(1, len(parts) + 1))
    summary_bytes = 8_000  # at the end of an MCAP file, nearly all of it schemas
    for path in (path for paths in parts.values() for path in paths):
        assert path.stat().st_size <= limit + (summary_bytes if path.suffix == ".mcap" else 0)
    stem = "companion-20231114-221320"
    assert {path.name for path in parts[PartName("20231114-221320", 1, 2)]} == {
        f"{stem}.part2{suffix}" for suffix in (".tlog", ".jsonl", ".mcap")
    }
    lines, logged, times_us = [], 0, []
    for name in parts:
        lines += name.path(tmp_path, ".jsonl").read_text().splitlines()
        times_us += [entry.time_us for entry in read_mcap(name.path(tmp_path, ".mcap"))]
        if name.path(tmp_path, ".tlog").stat().st_size:  # the newest may have just begun
            logged += len(list(read_tlog(name.path(tmp_path, ".tlog"))))
    assert lines == [f'{{"n":{n}}}' for n in range(600)]
    assert times_us == list(range(600))
    assert logged == 600
    assert recorder.problem is None


def test_the_old_part_continues_if_a_new_one_cannot_begin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = Recorder(tmp_path, STARTED_S, max_file_bytes=100)

    def full(*_: object) -> int:
        raise OSError(errno.EMFILE, "Too many open files")

    recorder.decision(1, "{}" * 100)
    with monkeypatch.context() as patched:
        patched.setattr(os, "open", full)
        recorder._sync()
    assert recorder.problem is not None
    assert "Too many open files" in recorder.problem
    recorder.decision(2, "{}")
    recorder.close()
    assert len(recorder.decisions_path.read_text().splitlines()) == 2


def recording(folder: Path, name: str, size: int) -> list[Path]:
    paths = [folder / f"{name}{suffix}" for suffix in (".tlog", ".jsonl", ".mcap")]
    for path in paths:
        path.write_bytes(bytes(size))
    return paths


def test_the_oldest_recordings_are_deleted_first(tmp_path: Path) -> None:
    oldest = recording(tmp_path, "companion-20250101-000000", 1000)
    second = recording(tmp_path, "companion-20250101-000000.part2", 1000)
    tenth = recording(tmp_path, "companion-20250101-000000.part10", 1000)
    again = recording(tmp_path, "companion-20250101-000000-2", 1000)
    ours = recording(tmp_path, "companion-20240101-000000", 1000)
    for other in ("companion.tlog", "companion-20250101.tlog", "companion-20240101-000000.tlog.gz", "x.mcap"):
        (tmp_path / other).write_bytes(bytes(50_000))
    others = sorted(path.name for path in tmp_path.iterdir() if path.stat().st_size == 50_000)
    assert remove_oldest(tmp_path, 15_000, keep=ours) == []
    assert sorted(remove_oldest(tmp_path, 12_500, keep=ours)) == sorted(oldest)
    assert sorted(remove_oldest(tmp_path, 6_000, keep=ours)) == sorted([*second, *tenth])
    assert sorted(remove_oldest(tmp_path, 0, keep=ours)) == sorted(again)
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == sorted([*others, *(path.name for path in ours)])


async def test_a_run_deletes_the_oldest_and_repairs_but_leaves_a_running_recorder_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "_SYNC_PERIOD_S", 0.01)
    recording(tmp_path, "companion-20220101-000000", 30_000)
    beside = Recorder(tmp_path, STARTED_S - 100.0)  # its files look like those of another process
    beside.decision(1, "{}" * 30_000)
    beside._sync()
    killed = tmp_path / "companion-20220601-000000.mcap"
    killed.write_bytes(beside.mcap_path.read_bytes())
    recorder = Recorder(tmp_path, STARTED_S, max_total_bytes=100_000)
    running = asyncio.create_task(recorder.run())
    async with asyncio.timeout(10.0):
        while not log_read(killed).closed:  # noqa: ASYNC110 - a file sets no event
            await asyncio.sleep(0.01)
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running
    assert {name.started for name in parts_in(tmp_path)} == {
        "20220601-000000",
        "20231114-221140",
        "20231114-221320",
    }
    assert not log_read(beside.mcap_path).closed
    assert recorder.problem is None
    beside.close()
    recorder.close()


def log_read(path: Path) -> McapReader:
    log = read_mcap(path)
    assert list(log)
    return log


async def test_a_folder_that_vanishes_is_reported_but_not_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "_SYNC_PERIOD_S", 0.001)
    recorder = Recorder(tmp_path / "card", STARTED_S, max_file_bytes=10)
    shutil.rmtree(tmp_path / "card")
    running = asyncio.create_task(recorder.run())
    for _ in range(50):
        recorder.decision(1, "{}")
        await asyncio.sleep(0.005)
    assert not running.done()
    assert recorder.problem is not None
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running
    recorder.close()


def test_the_queue_for_a_slow_disk_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "_MAX_WAITING_BYTES", 1000)
    recorder = Recorder(tmp_path, STARTED_S)
    for _ in range(100):
        recorder.state(1, "x" * 99)
    assert recorder.problem is not None
    assert "does not keep up" in recorder.problem
    recorder._sync()
    recorder.state(2, "{}")
    recorder.close()
    assert [entry.time_us for entry in read_mcap(recorder.mcap_path)] == [1] * 11 + [2]
