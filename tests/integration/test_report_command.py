"""`companion report` as a process: pages, notes, exit codes, one-line errors."""

import re
import subprocess
from pathlib import Path

import pytest

from companion.recording import parts_in, read_mcap
from tests.integration.test_command_line import assert_one_line
from tests.support.commands import call
from tests.support.paths import TLOGS
from tests.support.short_scenario import write_short_head_on
from tests.unit.report.test_flight_report import recording


def report(log: Path, out: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return call("report", str(log), "--out", str(out), *words)


def test_report_of_a_recording(tmp_path: Path) -> None:
    result = report(recording(tmp_path / "a.mcap"), tmp_path / "r.html")
    assert result.returncode == 0, result.stderr
    assert "r.html" in result.stdout
    text = (tmp_path / "r.html").read_text()
    assert text.startswith("<!doctype html>")
    assert "<td>N1</td>" in text


def test_report_of_a_truncated_recording(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", close=False)
    path.write_bytes(path.read_bytes()[:-50])
    result = report(path, tmp_path / "r.html")
    assert result.returncode == 0, result.stderr
    assert "was cut off" in result.stdout
    assert "was cut off" in (tmp_path / "r.html").read_text()


# What the page says about logs.
SAID = {
    "px4_fake_two_intruders": ("<td>OWN2</td>", "decided 73 s, not flown"),
    "first_version": ("the log has no own position",),
    "px4_sih_fixed_wing_adsb_two_intruders": ("<td>N51402</td>", "decided 46 s, not flown"),
    "copter_2021_v2_cut": ("the log has no own position",),
}


@pytest.mark.parametrize("name", [name for name in SAID if name in TLOGS])
def test_report_of_a_tlog(tmp_path: Path, name: str) -> None:
    result = report(TLOGS[name], tmp_path / "r.html")
    assert result.returncode == 0, result.stderr
    text = (tmp_path / "r.html").read_text()
    assert all(words in text for words in SAID[name])
    if name.startswith("px4"):
        times = re.findall(r"<td>(\d+:\d\d)</td><td>companion</td>", text)
        assert len(times) > 3
        assert len(set(times)) > 1, "each text has its own time"


def test_errors_are_one_line(tmp_path: Path) -> None:
    out = tmp_path / "r.html"
    assert_one_line(report(tmp_path / "nowhere.mcap", out), 1, "nowhere.mcap: cannot be read")
    assert_one_line(report(tmp_path, out), 1, "cannot be read")
    (tmp_path / "empty.tlog").touch()
    assert_one_line(report(tmp_path / "empty.tlog", out), 1, "the file is empty")
    (tmp_path / "a.png").write_bytes(b"\x89PNG" + bytes(1000))
    assert_one_line(report(tmp_path / "a.png", out), 1, "no MAVLink frame")
    log = recording(tmp_path / "a.mcap")
    assert_one_line(report(log, tmp_path / "nowhere" / "r.html"), 2, "there is no folder")
    assert_one_line(report(log, tmp_path), 2, "this is a folder")
    assert_one_line(report(log, out, "--config", "nowhere.yaml"), 2, "nowhere.yaml")
    assert not out.exists()


@pytest.mark.wire
def test_a_flown_demonstration_is_recorded_and_reported(tmp_path: Path) -> None:
    words = ("demo", "--scenario", str(write_short_head_on(tmp_path)), "--speedup", "20")
    flown = call(*words, "--record", str(tmp_path / "rec"), module="sim")
    assert flown.returncode == 0, flown.stdout
    (name,) = parts_in(tmp_path / "rec")
    mcap = name.path(tmp_path / "rec", ".mcap")
    log = read_mcap(mcap)
    assert {entry.topic for entry in log} >= {"/companion/decision", "/companion/text"}
    assert log.closed
    result = report(mcap, tmp_path / "r.html")
    assert result.returncode == 0, result.stderr
    text = (tmp_path / "r.html").read_text()
    assert "taken over once" in text
    assert "<h2>The link</h2>" in text
    assert "well clear lost</th><td>never" in text
