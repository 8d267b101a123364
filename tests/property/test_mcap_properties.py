"""Properties of damaged MCAP files: reading gives a prefix of the written messages."""

import contextlib
import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.errors import LogError
from companion.recording import (
    DECISION,
    TEXT,
    Entry,
    McapMessage,
    McapWriter,
    read_mcap,
    repair_all,
    repair_file,
)
from tests.support.thorough import sample


def recorded() -> tuple[bytes, list[Entry]]:
    with tempfile.TemporaryDirectory() as folder:
        file = McapWriter(Path(folder) / "a.mcap")
        for chunk in range(6):
            file.write([McapMessage(DECISION, 100 * chunk + i, f'{{"n":{chunk}}}') for i in range(5)])
            file.write([McapMessage(TEXT, 100 * chunk, "{}")])
        file.close()
        return file.path.read_bytes(), list(read_mcap(file.path))


RAW, ENTRIES = recorded()


def read(raw: bytes) -> list[Entry]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        path.write_bytes(raw)
        entries = list(read_mcap(path))
        if repair_file(path):
            assert list(read_mcap(path)) == entries
        return entries


@settings(deadline=None)
@given(st.integers(8, len(RAW)))
def test_any_prefix_of_a_file_reads_as_a_prefix(size: int) -> None:
    entries = read(RAW[:size])
    assert entries == ENTRIES[: len(entries)]
    if size == len(RAW):
        assert entries == ENTRIES


@settings(deadline=None)
@given(st.integers(8, len(RAW) - 1), st.binary(min_size=1, max_size=40))
def test_damage_ends_the_file_or_changes_nothing(at: int, junk: bytes) -> None:
    for entry in read(RAW[:at] + junk + RAW[at + len(junk) :]):
        assert isinstance(entry.data, bytes)


@settings(deadline=None)
@given(st.binary(max_size=400))
def test_any_bytes_after_the_magic_are_read_without_error(junk: bytes) -> None:
    read(RAW[:8] + junk)


def test_any_single_byte_may_be_wrong(tmp_path: Path) -> None:
    """Recordings of former runs are repaired at every start: no damage may raise an error."""
    file = McapWriter(tmp_path / "whole")
    decisions = [McapMessage(DECISION, 100 + i, f'{{"n":{i}}}') for i in range(10)]
    file.write([*decisions, McapMessage(TEXT, 100, "{}")])
    whole = file.path.read_bytes()
    path = tmp_path / "companion-20260101-120000.mcap"
    for at in range(0, len(whole), sample(2, 1)):
        for wrong in (0xFF, 0x7F):
            path.write_bytes(whole[:at] + bytes([wrong]) + whole[at + 1 :])
            with contextlib.suppress(LogError):
                list(read_mcap(path))
            repair_all(tmp_path)
