"""Files: whatever is at a path, reading, writing, trying and setting aside end at once."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from companion.files import (
    MAX_BYTES,
    read_small,
    replace_small,
    set_aside,
    why_no_new_file,
    why_not_replaceable,
    why_not_writable,
)


@pytest.fixture(autouse=True)
def _no_hang() -> Iterator[None]:
    assert threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("it hangs"))
    signal.alarm(5)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def fifo(path: Path) -> None:
    os.mkfifo(path)


def folder(path: Path) -> None:
    path.mkdir()


def endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


def device(path: Path) -> None:
    path.symlink_to("/dev/null")


def large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 40)  # a terabyte, sparse


STRANGE = [fifo, folder, endless, device, large]
strange = pytest.mark.parametrize("make", STRANGE, ids=lambda make: make.__name__)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "state"
    with pytest.raises(FileNotFoundError):
        read_small(path)
    for content in (b"", b"one", b"x" * MAX_BYTES):
        replace_small(path, content, durable=True)
        assert read_small(path) == content
    assert [each.name for each in tmp_path.iterdir()] == ["state"]


@strange
def test_what_is_no_small_file_is_refused_at_once(tmp_path: Path, make: Callable[[Path], None]) -> None:
    path = tmp_path / "state"
    make(path)
    with pytest.raises(OSError, match=r".") as refused:
        read_small(path)
    assert refused.value.strerror


@strange
def test_only_files_are_replaced_and_nothing_blocks_writing(
    tmp_path: Path, make: Callable[[Path], None]
) -> None:
    path = tmp_path / "state"
    make(path)
    if make is large:
        assert why_not_replaceable(path) is None
        replace_small(path, b"new", durable=False)
        assert read_small(path) == b"new"
        return
    kind = path.stat().st_mode
    assert why_not_replaceable(path)
    with pytest.raises(OSError, match=r"."):
        replace_small(path, b"new", durable=False)
    assert path.stat().st_mode == kind


@pytest.mark.parametrize("make", [fifo, folder, device], ids=lambda make: make.__name__)
def test_something_at_the_temporary_path_does_not_block(tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(tmp_path / "state.new")
    with pytest.raises(OSError, match=r"."):
        replace_small(tmp_path / "state", b"new", durable=True)


def test_bad_files_are_set_aside_but_folders_and_devices_stay(tmp_path: Path) -> None:
    path, bad = tmp_path / "state", tmp_path / "state.bad"
    for content in ("one", "two"):
        path.write_text(content)
        assert set_aside(path) == bad
        assert bad.read_text() == content
        assert not path.exists()
    fifo(path)
    assert set_aside(path) == bad
    folder(path)
    assert set_aside(path) is None
    assert path.is_dir()
    assert set_aside(Path("/dev/null")) is None
    assert Path("/dev/null").is_char_device()
    assert set_aside(tmp_path / "missing") is None


def test_a_file_that_cannot_be_replaced_is_found_without_leaving_anything(tmp_path: Path) -> None:
    assert why_not_replaceable(tmp_path / "state") is None
    assert list(tmp_path.iterdir()) == []
    assert why_not_replaceable(tmp_path / "nowhere" / "state") == f"there is no folder {tmp_path}/nowhere"
    assert why_not_replaceable(tmp_path) == "this is a folder, not a file"
    fifo(tmp_path / "fifo")
    assert why_not_replaceable(tmp_path / "fifo") == "not a regular file"


def test_a_file_that_can_be_written_is_left_as_it_is(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    kept.write_text("old")
    assert why_not_writable(kept) is None
    assert why_not_writable(tmp_path / "new") is None
    assert why_no_new_file(tmp_path / "a" / "b") is None
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
    assert why_no_new_file(Path("/proc/recordings")) is not None
    (tmp_path / "file").touch()
    assert why_no_new_file(tmp_path / "file" / "no") == f"there is no folder {tmp_path}/file"
