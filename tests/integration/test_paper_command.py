"""`companion-sim paper` as a user runs it: files, output and errors."""

import json
import subprocess
from pathlib import Path

import pytest
from rich.console import Console

from sim.paper import command, studies
from tests.support.commands import call
from tests.support.contract import MEASURES

PNG = b"\x89PNG\r\n\x1a\n"


def paper(*arguments: str) -> "subprocess.CompletedProcess[str]":
    # Wide enough for all tables.
    return call("paper", *arguments, module="sim", COLUMNS="140")


@pytest.fixture(scope="module")
def experiments(tmp_path_factory: pytest.TempPathFactory) -> "tuple[Path, subprocess.CompletedProcess[str]]":
    out = tmp_path_factory.mktemp("paper") / "results"
    return out, paper("--out", str(out))


def test_the_experiments_are_flown_and_written(
    experiments: "tuple[Path, subprocess.CompletedProcess[str]]",
) -> None:
    out, done = experiments
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "two layers" in done.stdout
    assert "\x1b" not in done.stdout, "no progress bar and no colours outside a terminal"
    content = json.loads((out / "report.json").read_text())
    for name in ("single", "group"):
        assert set(content[name]) == {"none", "outer", "inner", "two_layer"}
        for row in content[name].values():
            assert set(row) >= MEASURES
        assert content[name]["none"]["collisions"] > 0, "without avoidance the scene has collisions"
        assert content[name]["two_layer"]["arrived"]
        assert content[name]["two_layer"]["collisions"] == 0
    figures = [f"figure-{number:02d}.png" for number in range(7, 13)] + ["minima.png"]
    for figure in figures:
        assert (out / figure).read_bytes().startswith(PNG)
        assert (out / figure).stat().st_size > 20_000
    text = (out / "table.md").read_text()
    assert "1.6192" in text, "the paper's values are beside ours"


def test_the_two_layers_reach_the_papers_ratios(
    experiments: "tuple[Path, subprocess.CompletedProcess[str]]",
) -> None:
    """The ratios, or a report of a missed target."""
    out, _ = experiments
    content = json.loads((out / "report.json").read_text())
    single, group = content["single"], content["group"]
    both = single["two_layer"]
    assert both["safety_value"] >= 0.95 * single["inner"]["safety_value"]
    assert both["heading_effort"] <= 0.73 * single["inner"]["heading_effort"]
    for other in ("outer", "inner"):
        assert group["two_layer"]["safety_value"] >= 1.35 * group[other]["safety_value"]
    if both["safety_value"] < 1.20 * single["outer"]["safety_value"]:
        assert "**short**" in (out / "table.md").read_text()


def test_the_strategy_table_is_printed() -> None:
    done = paper("--table")
    assert done.returncode == 0, done.stderr
    for words in ("heading rule (eq. 11)", "speed rule (eq. 13)", "turn left 30°", "over", "slowest"):
        assert words in done.stdout


def test_a_small_study_of_fields_is_flown_and_written(tmp_path: Path) -> None:
    done = paper("--out", str(tmp_path), "--study", "fields", "--fields", "1")
    assert done.returncode == 0, done.stderr
    content = json.loads((tmp_path / "fields.json").read_text())
    assert content["strategies"]["two_layer"]["fields"] + content["without_way"] == 1
    assert (tmp_path / "fields.png").read_bytes().startswith(PNG)
    assert "two layers" in (tmp_path / "fields.md").read_text()


def test_a_small_study_of_the_transition_domain_is_flown_and_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studies, "DELTA_BETAS_DEG", (5.0, 90.0))
    command.run_transition(tmp_path, 1, Console(quiet=True))
    content = json.loads((tmp_path / "transition.json").read_text())
    assert [point["delta_beta_deg"] for point in content["points"]] == [5.0, 90.0] * 2
    assert content["chosen_deg"] in (5.0, 90.0)
    assert (tmp_path / "transition.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "--out DIR"),
        (("--out", "/dev/null/results"), "/dev/null"),
        (("--out", "/tmp", "--study", "everything"), "everything"),
        (("--out", "/tmp", "--fields", "0"), "--fields"),
    ],
)
def test_bad_usage_is_one_clear_line(arguments: tuple[str, ...], words: str) -> None:
    done = paper(*arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
