"""What one run leaves to the next."""

import os
import time
from pathlib import Path

import pytest

from companion.keeper import Keeper


def test_what_is_kept_is_read_with_its_age(tmp_path: Path) -> None:
    path = tmp_path / "companion.state"
    keeper = Keeper(path)
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
    assert Keeper(path).read() is None


def test_a_place_that_cannot_be_written_is_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    keeper = Keeper(tmp_path / "nowhere" / "companion.state")
    keeper.keep("one")
    keeper.keep("two")
    assert [record.levelname for record in caplog.records] == ["ERROR"]
