"""Whatever becomes of an MCAP file's bytes, reading gives a beginning of what was written."""

import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.recording import DECISION, TEXT, Entry, McapFile, Note, complete, read_mcap


def recorded() -> tuple[bytes, list[Entry]]:
    with tempfile.TemporaryDirectory() as folder:
        file = McapFile(Path(folder) / "a.mcap")
        for chunk in range(6):
            file.flush([Note(DECISION, 100 * chunk + i, f'{{"n":{chunk}}}') for i in range(5)])
            file.flush([Note(TEXT, 100 * chunk, "{}")])
        file.close()
        return file.path.read_bytes(), list(read_mcap(file.path))


RAW, ENTRIES = recorded()


def read(raw: bytes) -> list[Entry]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        path.write_bytes(raw)
        entries = list(read_mcap(path))
        if complete(path):
            assert list(read_mcap(path)) == entries
        return entries


@settings(deadline=None)
@given(st.integers(8, len(RAW)))
def test_any_beginning_of_a_file_reads_as_a_beginning(size: int) -> None:
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
def test_any_bytes_behind_the_magic_are_survived(junk: bytes) -> None:
    read(RAW[:8] + junk)
