"""The MCAP file of a recording: other programs, truncation, repair, and disk errors."""

import errno
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import NonSeekingReader, make_reader

from companion.errors import LogError
from companion.recording import (
    DECISION,
    STATE,
    TEXT,
    Entry,
    McapMessage,
    McapWriter,
    Topic,
    read_mcap,
    repair_all,
    repair_file,
)


def message(number: int, topic: Topic = DECISION) -> McapMessage:
    return McapMessage(topic, number * 100_000, json.dumps({"time_us": number * 100_000, "because": "so"}))


def entry(number: int, topic: Topic = DECISION) -> Entry:
    one = message(number, topic)
    return Entry(topic.name, one.time_us, one.text.encode())


def written(path: Path, chunks: int = 5) -> McapWriter:
    """Ten decisions and a text in each chunk; neither closed nor synced."""
    file = McapWriter(path)
    for chunk in range(chunks):
        file.write([*(message(10 * chunk + i) for i in range(10)), message(10 * chunk, TEXT)])
    return file


def by_the_library(path: Path) -> list[Entry]:
    """The messages as read by the library with the summary, checksums verified."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return sorted(
            Entry(channel.topic, message.log_time // 1000, message.data)
            for schema, channel, message in reader.iter_messages()
            if schema is not None and schema.encoding == "jsonschema" and channel.message_encoding == "json"
        )


def test_other_programs_can_open_it(tmp_path: Path) -> None:
    file = written(tmp_path / "a.mcap")
    file.write([message(77, STATE)])
    file.close()
    file.close()
    with (tmp_path / "a.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 56
    assert summary.statistics.chunk_count == 6
    assert {index.compression for index in summary.chunk_indexes} == {"lz4"}
    assert {(c.topic, summary.schemas[c.schema_id].name) for c in summary.channels.values()} == {
        ("/companion/decision", "companion.Decision"),
        ("/companion/state", "companion.State"),
        ("/companion/text", "companion.Text"),
    }
    assert by_the_library(tmp_path / "a.mcap") == sorted(read_mcap(tmp_path / "a.mcap"))
    with (tmp_path / "a.mcap").open("rb") as stream:
        assert len(list(NonSeekingReader(stream, validate_crcs=True).iter_messages())) == 56


def properties(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """All schemas in a schema, as deep as Foxglove reads it."""
    assert schema["type"] == "object"
    for one in schema["properties"].values():
        inner = one["items"] if one["type"] == "array" else one
        yield inner
        if inner["type"] == "object":
            yield from properties(inner)


@pytest.mark.parametrize("topic", [DECISION, STATE, TEXT], ids=lambda topic: topic.schema_name)
def test_foxglove_can_read_the_schemas(topic: Topic) -> None:
    # foxglove/studio, packages/mcap-support/src/parseJsonSchema.ts: one type for each property, no lists of
    # lists, and every object with its properties; otherwise the whole channel is refused.
    kinds = {one["type"] for one in properties(json.loads(topic.schema_text))}
    assert kinds <= {"boolean", "string", "number", "integer", "object"}


@pytest.mark.parametrize("cut", [1, 7, 20, 100, 300])
def test_a_truncated_file_is_readable_to_its_last_whole_chunk(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "a.mcap"
    written(path, chunks=4)
    whole = path.read_bytes()
    written(tmp_path / "b.mcap", chunks=5)
    path.write_bytes((tmp_path / "b.mcap").read_bytes()[: len(whole) + cut])
    log = read_mcap(path)
    entries = list(log)
    assert entries[:44] == list(read_mcap(tmp_path / "b.mcap"))[:44]
    assert len(entries) in (44, 55)
    assert not log.closed


@pytest.mark.parametrize("cut", [0, 1, 20, 80, 300, 500])
def test_a_truncated_file_is_repaired(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "a.mcap"
    file = written(path)
    path.write_bytes(path.read_bytes()[: file.size - cut])
    os.utime(path, (1.0, 2.0))
    before = sorted(read_mcap(path))
    assert repair_file(path)
    assert by_the_library(path) == before
    assert path.stat().st_mtime == 2.0
    log = read_mcap(path)
    assert sorted(log) == before
    assert log.closed
    assert not repair_file(path), "repaired already"
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(before)
    assert all(index.message_index_offsets for index in summary.chunk_indexes)
    assert [left.name for left in tmp_path.iterdir()] == ["a.mcap"]


def test_zeros_in_place_of_the_last_chunk_end_the_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    size = written(path, chunks=3).size
    written(tmp_path / "b.mcap", chunks=5)
    raw = (tmp_path / "b.mcap").read_bytes()
    path.write_bytes(raw[: size + 30] + bytes(len(raw) - size - 30))
    assert len(list(read_mcap(path))) == 33
    assert repair_file(path)
    assert len(by_the_library(path)) == 33


def test_only_unfinished_recordings_that_are_not_being_written_are_repaired(tmp_path: Path) -> None:
    writing = written(tmp_path / "companion-20260101-120000.mcap")
    killed = tmp_path / "companion-20260101-110000.part2.mcap"
    killed.write_bytes(writing.path.read_bytes())
    foreign = tmp_path / "flight.mcap"
    foreign.write_bytes(killed.read_bytes())
    (tmp_path / "companion-20260101-100000.mcap").write_bytes(b"")
    (tmp_path / "companion-20260101-090000.mcap").write_bytes(os.urandom(1000))
    (tmp_path / "companion-20260101-080000.mcap.completing").touch()  # a repair that was killed
    assert repair_all(tmp_path) == [killed]
    assert repair_all(tmp_path) == []
    assert foreign.read_bytes() == writing.path.read_bytes()
    assert not list(tmp_path.glob("*.completing"))
    writing.close()
    assert len(by_the_library(writing.path)) == len(by_the_library(killed)) == 55


def test_a_file_stays_as_it_is_if_the_disk_is_too_full_for_the_repair(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "companion-20260101-110000.mcap"
    written(path)
    path.rename(tmp_path / "x")
    path.write_bytes((tmp_path / "x").read_bytes())

    def full(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        assert repair_all(tmp_path) == []
    assert path.read_bytes() == (tmp_path / "x").read_bytes()
    assert not list(tmp_path.glob("*.completing"))


@pytest.mark.parametrize("failing", [{0}, {1}, {2}, {1, 2}, {0, 1}])
def test_only_the_chunks_that_did_not_fit_are_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: set[int]
) -> None:
    write, count = os.write, iter(range(100))

    def half_full(descriptor: int, data: bytes) -> int:
        if next(count) in failing:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(descriptor, data)

    monkeypatch.setattr(os, "write", half_full)
    file = McapWriter(tmp_path / "a.mcap")  # write 0: the head
    for number in range(4):
        file.write([message(number)])
    assert file.problem is not None
    file.close()
    expected = [entry(number) for number in range(4) if number + 1 not in failing]
    assert list(read_mcap(tmp_path / "a.mcap")) == expected
    assert repair_file(tmp_path / "a.mcap")
    assert by_the_library(tmp_path / "a.mcap") == expected


def test_times_are_limited_to_the_range_of_the_format(tmp_path: Path) -> None:
    file = McapWriter(tmp_path / "a.mcap")
    file.write([McapMessage(TEXT, -5, "{}"), McapMessage(TEXT, 1 << 70, "\ud800")])
    file.close()
    assert [one.time_us for one in read_mcap(tmp_path / "a.mcap")] == [0, ((1 << 64) - 1) // 1000]


def test_other_files_are_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"PNG")
    with pytest.raises(LogError, match="not an MCAP file"):
        read_mcap(tmp_path / "a.mcap")
    with pytest.raises(LogError, match="cannot be read"):
        read_mcap(tmp_path / "nowhere.mcap")
    with pytest.raises(LogError, match="cannot be read"):
        read_mcap(tmp_path)
