"""Reports of flight tests, alone and beside each other."""

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from companion.errors import ConfigError
from companion.geodesy import LocalFrame
from sim.flight_test.judge import Judged
from sim.flight_test.plan import EncounterPlan
from sim.flight_test.report import comparison_of, lines_of, load_report, report_of, table_of
from sim.flight_test.result import Result


def result(*failures: str, name: str = "head-on") -> Result:
    judged = Judged(EncounterPlan(name), 0.0, LocalFrame(47.0, 8.0), (), modes=["AUTO", "GUIDED", "AUTO"])
    judged.first_action_s, judged.back_s, judged.max_deviation_m = 7.0, 97.0, 250.0
    return Result("ardupilot", "4.7.0", "process", "SIMSTATE", [judged], {name: list(failures)})


def printed(renderable: object) -> str:
    shown = io.StringIO()
    Console(width=140, file=shown).print(renderable)
    return shown.getvalue()


def test_the_table_says_what_was_flown_and_what_failed() -> None:
    report = report_of(result("well clear lost"))
    shown = printed(table_of(report))
    assert "head-on" in shown
    assert "AUTO GUIDED AUTO" in shown
    assert "well clear lost" in shown
    assert "0 of 1 encounters as expected" in " ".join(lines_of(report))
    assert not report["passed"]


def test_a_flight_that_ended_early_did_not_pass() -> None:
    flown = result()
    assert flown.passed
    flown.problem = "nothing heard of the vehicle for 15 s"
    assert not flown.passed
    assert any("Ended early" in line for line in lines_of(report_of(flown)))


def test_a_flight_without_encounters_did_not_pass() -> None:
    assert not Result().passed


def test_two_runs_stand_side_by_side() -> None:
    other = report_of(result())
    other["encounters"][0]["max_deviation_m"] = 40.0
    shown = printed(comparison_of(report_of(result("not avoided")), other))
    ours, theirs = shown.splitlines()[-3:-1]
    assert "head-on: lost" in ours
    assert " 250 " in ours
    assert "the other: passed" in theirs
    assert " 40 " in theirs


def test_encounters_of_one_run_only_are_shown_too() -> None:
    shown = printed(comparison_of(report_of(result(name="one")), report_of(result(name="two"))))
    assert "one: passed" in shown
    assert "two: not flown" in shown
    assert shown.count("the other: not flown") == shown.count("the other: passed") == 1


@pytest.mark.parametrize("content", ["", "[]", '{"encounters": 3}', '{"encounters": [{}]}', "\udcff"])
def test_a_file_that_is_no_report_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "r.json"
    path.write_bytes(content.encode("utf-8", "surrogateescape"))
    with pytest.raises(ConfigError, match=r"r\.json"):
        load_report(path)


def test_a_report_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "r.json"
    path.write_text(json.dumps(report_of(result())))
    assert load_report(path)["encounters"][0]["modes"] == ["AUTO", "GUIDED", "AUTO"]
