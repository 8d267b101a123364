"""Telemetry logs: written records are read back, and damage hides no good record."""

import errno
import os
from pathlib import Path

import pytest
from pymavlink import mavutil

from companion.errors import LogError
from companion.mavlink import tlog
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.tlog import TlogReader, TlogWriter, read_tlog

START_US = 1_700_000_000_000_000


def frames(count: int) -> list[bytes]:
    encoder = Encoder()
    return [encoder.encode(mavlink.MAVLink_mission_current_message(n), 1, 1) for n in range(count)]


def record(time_us: int, raw: bytes) -> bytes:
    return time_us.to_bytes(8, "big") + raw


def read(path: Path, data: bytes) -> tuple[list[tuple[int, bytes]], TlogReader]:
    path.write_bytes(data)
    reader = read_tlog(path)
    return [(time_us, frame.raw) for time_us, frame in reader], reader


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "some.tlog"


def test_written_records_are_read_back(path: Path) -> None:
    writer = TlogWriter(path)
    expected = [(START_US + n, raw) for n, raw in enumerate(frames(300))]
    for time_us, raw in expected:
        writer.write(time_us, raw)
    reader = read_tlog(path)  # not closed yet: the operating system already has every record
    assert [(time_us, frame.raw) for time_us, frame in reader] == expected
    assert (reader.messages, reader.bad_bytes, reader.unknown) == (300, 0, 0)
    writer.close()
    writer.close()
    writer.write(START_US, b"late")
    assert path.stat().st_size == sum(8 + len(raw) for _, raw in expected)


def test_pymavlink_reads_it(path: Path) -> None:
    writer = TlogWriter(path)
    for n, raw in enumerate(frames(20)):
        writer.write(START_US + n * 1_000_000, raw)
    writer.close()
    played = mavutil.mavlink_connection(str(path))
    messages = []
    while (message := played.recv_match()) is not None:
        messages.append(message)
    played.close()
    assert [message.seq for message in messages] == list(range(20))
    assert messages[5]._timestamp == START_US / 1e6 + 5


def test_an_existing_log_is_never_overwritten(path: Path) -> None:
    path.write_bytes(b"precious")
    with pytest.raises(LogError, match="exists already"):
        TlogWriter(path)
    assert path.read_bytes() == b"precious"


def test_a_record_cut_off_by_a_full_disk_is_removed_and_the_log_continues(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = TlogWriter(path)
    first, second, third = frames(3)
    writer.write(START_US, first)
    real_write, calls = os.write, []

    def nearly_full(descriptor: int, data: bytes) -> int:
        calls.append(data)
        if len(calls) == 1:
            return real_write(descriptor, data[:11])
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "write", nearly_full)
        writer.write(START_US + 1, second)
    assert writer.failures == 1
    assert writer.problem is not None
    assert "No space left" in writer.problem
    writer.write(START_US + 2, third)
    writer.close()
    assert path.read_bytes() == record(START_US, first) + record(START_US + 2, third)


def test_a_record_may_need_several_writes(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real_write = os.write
    writer = TlogWriter(path)
    (raw,) = frames(1)
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", lambda descriptor, data: real_write(descriptor, data[:5]))
        writer.write(START_US, raw)
    writer.close()
    assert path.read_bytes() == record(START_US, raw)
    assert writer.problem is None


def test_a_failed_sync_is_reported_but_not_raised(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_descriptor: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    writer = TlogWriter(path)
    with monkeypatch.context() as patched:
        patched.setattr(os, "fdatasync", broken)
        writer.sync()
    writer.close()
    assert writer.problem is not None
    assert "Input/output error" in writer.problem


@pytest.mark.parametrize("time_us", [-1, 2**64])
def test_an_impossible_time_does_not_stop_the_log(path: Path, time_us: int) -> None:
    writer = TlogWriter(path)
    writer.write(time_us, frames(1)[0])
    writer.close()
    assert len(list(read_tlog(path))) == 1


def test_a_log_truncated_in_its_last_frame(path: Path) -> None:
    whole = [record(START_US + n, raw) for n, raw in enumerate(frames(5))]
    found, reader = read(path, b"".join(whole)[:-3])
    assert [time_us - START_US for time_us, _ in found] == [0, 1, 2, 3]
    assert reader.bad_bytes == len(whole[-1]) - 3


def test_text_at_the_start_zeros_in_the_middle_and_time_running_backwards(path: Path) -> None:
    a, b, c = frames(3)
    text, zeros = b"Connected on \xfe udp\n", bytes(4096)
    data = text + record(START_US, a) + zeros + record(5, b) + record(START_US + 10**15, c)
    found, reader = read(path, data)
    assert found == [(START_US, a), (5, b), (START_US + 10**15, c)]
    assert reader.bad_bytes == len(text) + len(zeros)


def test_a_frame_of_another_dialect_hides_no_other_frame(path: Path) -> None:
    a, b, c = frames(3)
    foreign = b[:-2] + bytes((b[-2] ^ 0x55, b[-1]))
    found, reader = read(path, record(1, a) + record(2, foreign) + record(3, c))
    assert found == [(1, a), (3, c)]
    assert reader.bad_bytes == 8 + len(b)
    assert reader.counters.bad_crc == 1


def test_an_unknown_message_is_skipped_with_its_stamp(path: Path) -> None:
    a, b = frames(2)
    header = bytes((0xFD, 2, 0, 0, 9, 1, 1)) + (54_321).to_bytes(3, "little")
    checksum = mavlink.x25crc(header[1:] + b"hi" + b"\x07").crc.to_bytes(2, "little")
    found, reader = read(path, record(1, a) + record(2, header + b"hi" + checksum) + record(3, b))
    assert found == [(1, a), (3, b)]
    assert (reader.unknown, reader.bad_bytes) == (1, 0)


def test_frames_without_a_stamp_have_the_previous_one(path: Path) -> None:
    a, b, c, d, e, *rest = frames(100)
    more = [(9 + n, raw) for n, raw in enumerate(rest)]
    tail = b"".join(record(time_us, raw) for time_us, raw in more)
    found, reader = read(path, a + record(7, b) + record(8, c) + d + b"\xfd" + e + tail)
    assert found == [(0, a), (7, b), (8, c), (8, d), (8, e), *more]
    assert reader.bad_bytes == 1


def test_a_record_with_an_unknown_flag_is_skipped(path: Path) -> None:
    header = bytes((0xFD, 1, 0x02, 0, 0, 1, 1, 42, 0, 0))
    checksum = mavlink.x25crc(header[1:] + b"\x01" + bytes((mavlink.mavlink_map[42].crc_extra,)))
    unreadable = header + b"\x01" + checksum.crc.to_bytes(2, "little") + bytes(13)
    data = record(1, unreadable) + b"".join(record(2, raw) for raw in frames(50))
    found, reader = read(path, data)
    assert found == [(2, raw) for raw in frames(50)]
    assert reader.bad_bytes == 8 + len(unreadable)


@pytest.mark.parametrize("chunk_bytes", [1, 7, 100, 1000])
def test_the_result_does_not_depend_on_the_chunk_size(
    path: Path, chunk_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, list(range(1, 252)))
    long_frame = Encoder().encode(text, 1, 1)
    raws = [raw for pair in zip(frames(100), [long_frame] * 100, strict=True) for raw in pair]
    pieces = [
        record(START_US + n, raw) + (b"\xfd junk" + bytes(400))[: n % 7 * 50] for n, raw in enumerate(raws)
    ]
    expected, reader = read(path, b"".join(pieces))
    counters = reader.counters
    monkeypatch.setattr(tlog, "_CHUNK_BYTES", chunk_bytes)
    assert [(time_us, frame.raw) for time_us, frame in reader] == expected
    assert len(expected) == 200
    assert reader.counters == counters
    assert reader.counters is not counters


def test_only_the_wanted_messages_are_returned_but_all_are_counted(path: Path) -> None:
    encoder = Encoder()
    beat = encoder.encode(mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3), 1, 1)
    path.write_bytes(b"".join(record(n, raw) for n, raw in enumerate([*frames(50), beat, *frames(50)])))
    reader = read_tlog(path, only={0})
    assert [(time_us, frame.raw) for time_us, frame in reader] == [(50, beat)]
    assert reader.messages == 101


@pytest.mark.parametrize(
    ("content", "problem"), [(b"", "the file is empty"), (b"no log at all" * 500, "no MAVLink frame")]
)
def test_a_file_without_frames_is_refused_in_one_line(path: Path, content: bytes, problem: str) -> None:
    path.write_bytes(content)
    with pytest.raises(LogError, match=problem) as refusal:
        list(read_tlog(path))
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_missing_file_or_a_folder_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="No such file"):
        read_tlog(tmp_path / "none.tlog")
    with pytest.raises(LogError, match="directory"):
        read_tlog(tmp_path)


def test_a_log_that_cannot_be_created_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="cannot be written"):
        TlogWriter(tmp_path / "no such folder" / "a.tlog")
