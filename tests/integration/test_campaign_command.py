"""`companion-sim campaign`, `encounter` and `evidence` as a user runs them."""

import json
import subprocess
from pathlib import Path

import pytest

from tests.support.commands import call

KEYS = {
    "encounters", "p_nmac", "p_lowc", "risk_ratio", "risk_ratio_ci95", "lowc_ratio", "lowc_ratio_ci95",
    "median_max_deviation_m", "nuisance_rate", "median_max_height_m", "decision_ms", "encounters_per_s",
}  # fmt: skip


def companion_sim(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return call(*arguments, module="sim", folder=folder)


def test_a_campaign_reports_and_continues(tmp_path: Path) -> None:
    options = ("--seed", "2", "--report", "r.json", "--page", "p.html", "--workers", "2")
    first = companion_sim("campaign", "--encounters", "4", *options, folder=tmp_path)
    assert first.returncode == 0, first.stderr
    report = json.loads((tmp_path / "r.json").read_text())
    assert set(report["avoiders"]["companion"]) >= KEYS
    assert report["avoiders"]["companion"]["encounters"] == 4
    assert (tmp_path / "p.html").read_text().startswith("<!doctype html>")
    more = companion_sim("campaign", "--encounters", "6", *options, folder=tmp_path)
    assert more.returncode == 0, more.stderr
    assert len((tmp_path / "campaign.ndjson").read_text().splitlines()) == 7


def test_one_encounter_is_shown(tmp_path: Path) -> None:
    shown = companion_sim("encounter", "3", "--seed", "2", "--out", "e.png", folder=tmp_path)
    assert shown.returncode == 0, shown.stderr
    assert "unmitigated: nearest" in shown.stdout
    assert (tmp_path / "e.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--avoider", "wizard"), "wizard"),
        (("--surveillance", "magic"), "magic"),
        (("--surveillance", "poor,colour=3"), "no field 'colour'; there are period_s"),
        (("--model", "missing.txt"), "missing.txt"),
        (("--report", "no/such/folder/r.json"), "no/such/folder"),
        (("--encounters", "0"), "encounters"),
    ],
)
def test_bad_usage_is_one_line_and_exit_two(tmp_path: Path, options: tuple[str, ...], words: str) -> None:
    refused = companion_sim("campaign", *options, folder=tmp_path)
    assert refused.returncode == 2
    assert words in refused.stderr
    assert "Traceback" not in refused.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "--out"),
        (("--out", "e", "--avoider", "wizard"), "wizard"),
        (("--out", "e", "--model", "missing.txt"), "missing.txt"),
        (("--out", "e", "--encounters", "0"), "encounters"),
        (("--out", "e", "--scheduler", "there"), "--scheduler there"),
        (("--out", "e", "--part", "best"), "part"),
    ],
)
def test_bad_usage_of_evidence_is_one_line_and_exit_two(
    tmp_path: Path, options: tuple[str, ...], words: str
) -> None:
    refused = companion_sim("evidence", *options, folder=tmp_path)
    assert refused.returncode == 2
    assert words in refused.stderr
    assert "Traceback" not in refused.stderr
