"""Whether a file can be written is found out without leaving a trace."""

import os
from pathlib import Path

from companion.recording.writable import why_no_new_file, why_not_writable


def test_a_file_that_can_be_written_is_left_as_it_is(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    kept.write_text("old")
    assert why_not_writable(kept) is None
    assert why_not_writable(tmp_path / "new") is None
    assert why_no_new_file(tmp_path / "a" / "b", made=True) is None
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
    assert kept.read_text() == "old"
    assert why_not_writable(Path(os.devnull)) is None


def test_a_fifo_is_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    assert why_not_writable(tmp_path / "fifo") is None


def test_the_reason_is_named(tmp_path: Path) -> None:
    assert why_not_writable(tmp_path / "no" / "file") == f"there is no folder {tmp_path}/no"
    assert why_not_writable(tmp_path) == "this is a folder, not a file"
    assert why_not_writable(Path("/proc/a file")) is not None
    assert why_no_new_file(Path("/proc/recordings"), made=True) is not None
    assert why_no_new_file(tmp_path / "no") == f"there is no folder {tmp_path}/no"
