"""The evidence flown small: its page, document and figures, and continuing after an interruption."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from companion.errors import CompanionError, ConfigError
from sim.campaign.command import LOCAL
from sim.campaign.results import ResultLine, read_results
from sim.evidence import run as running
from sim.evidence.blocks import Drawing, Table
from sim.evidence.command import available, print_figures, run
from sim.evidence.content import sections_of
from sim.evidence.plan import EvidencePlan
from sim.evidence.sweeps import SWEEPS, TRADE_OFF
from sim.evidence.versions import note_version, versions_of
from tests.support.paths import OWN_DATA

QUIET = Console(quiet=True)
MODEL = str(OWN_DATA / "encounter-models" / "invented.txt")
LATENCY, BANK = (next(sweep for sweep in SWEEPS if sweep.name == name) for name in ("latency", "bank"))
PLAN = EvidencePlan(
    3, seed=5, peers=("none",), models=(MODEL,), presets=("perfect", "adsb-out"),
    sweeps=(replace(LATENCY, points=LATENCY.points[:2]), replace(BANK, points=BANK.points[:1])),
    trade_off=TRADE_OFF[:2],
)  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("evidence")
    run(PLAN, out, QUIET, workers=1, scheduler=LOCAL)
    return out


def lines_of(out: Path) -> dict[str, list[ResultLine]]:
    """The results by file, without what differs from run to run."""
    return {
        path.name: [{k: v for k, v in line.items() if k != "timing"} for line in read_results(path)]
        for path in sorted((out / "results").glob("*.ndjson"))
    }


def test_every_campaign_has_its_file(written: Path) -> None:
    names = {name.removesuffix(".ndjson") for name in lines_of(written)}
    assert names == {*PLAN.campaigns, "tracks"}
    assert names >= {"perfect", "presets", "peers", "two-sided", "latency", "bank-15", "trade-off-chosen"}
    assert sum(map(len, lines_of(written).values())) == PLAN.flights


def test_the_figures_are_complete(written: Path) -> None:
    report = json.loads((written / "evidence.json").read_text())
    ours = report["results"]["perfect"]["companion"]
    assert ours["encounters"] == 3
    assert set(ours) >= {"risk_ratio_ci95", "lowc_ratio", "nuisance_rate", "induced_nmac", "unresolved_lowc"}
    assert set(report["results"]["adsb-out"]) == {"companion", "companion, the peers' encounters", "none"}
    assert report["encounter_sets"]["invented"]["encounters"] == 3
    assert [point["label"] for point in report["sweeps"][0]["points"]] == ["0", "1"]
    assert report["sweeps"][1]["points"][0]["own_limits"]["max_bank_rad"] == pytest.approx(0.2618, abs=1e-4)
    assert [point["label"] for point in report["trade_off"]] == ["chosen", "latest"]
    assert report["trade_off"][0]["changes"] == {}
    assert set(report["two_sided"]["perfect"]) == {"companion", "companion-both"}
    assert report["tracks"]["adsb-out"]["position_nees"] > 0.0
    how = report["configuration"]
    assert how["seed"] == 5
    assert how["versions"]["companion"]
    assert how["machine"]["cores"] >= 1
    assert how["avoidance"]["begin_near"] > 0.0
    assert report["pass_lines"][-1] == {
        "name": "coordinating aircraft", "risk_ratio": 0.04, "lowc_ratio": 0.4,
        "source": "UK CAA CAP 3015 v2 (September 2026), second hand",
    }  # fmt: skip


def test_page_and_document_show_the_same_sections_offline(written: Path) -> None:
    page = (written / "evidence.html").read_text()
    report = json.loads((written / "evidence.json").read_text())
    sections = sections_of(report, [])
    assert page.startswith("<!doctype html>")
    assert not re.findall(r"(?:src|href)=.(?!data:|#)", page)
    assert "http" not in page.replace("http-equiv", "")
    for section in sections:
        assert f">{section.title}</h2>" in page
    blocks = [block for section in sections for block in section.blocks]
    tables = [block for block in blocks if isinstance(block, Table)]
    assert len(tables) >= 15
    assert all(len(row) == len(one.head) for one in tables for row in one.rows)
    assert sum(isinstance(block, Drawing) for block in blocks) == 4
    document = (written / "evidence.pdf").read_bytes()
    assert document.startswith(b"%PDF-")
    assert document.count(b"/Type /Page ") + document.count(b"/Type /Page\n") >= 6


def test_a_second_run_flies_only_what_is_missing(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = lines_of(written)
    cut = written / "results" / "latency.ndjson"
    whole = cut.read_text().splitlines(keepends=True)
    cut.write_text("".join(whole[:-1]) + whole[-1][:30])
    flown: list[str] = []
    original = running.run_here

    def noted(plan, results, **more):  # type: ignore[no-untyped-def]
        flown.append(results.path.name)
        original(plan, results, **more)

    monkeypatch.setattr(running, "run_here", noted)
    page = (written / "evidence.json").read_text()
    run(PLAN, written, QUIET, workers=1, scheduler=LOCAL)
    assert flown == ["latency.ndjson"]
    assert lines_of(written) == before
    assert json.loads((written / "evidence.json").read_text())["sweeps"] == json.loads(page)["sweeps"]


def test_results_of_several_versions_are_marked(written: Path) -> None:
    (only,) = versions_of(written / "results")
    report = json.loads((written / "evidence.json").read_text())
    assert report["configuration"]["flown_by"] == [only] == [report["configuration"]["versions"]]
    report["configuration"]["flown_by"].append(only | {"companion": "0.1 (other)"})
    texts = [block for block in sections_of(report, [])[0].blocks if isinstance(block, str)]
    assert texts[0].startswith("Several versions flew")


def test_a_damaged_list_of_versions_is_one_line(tmp_path: Path) -> None:
    note_version(tmp_path, {"companion": "1"})
    note_version(tmp_path, {"companion": "2"})
    note_version(tmp_path, {"companion": "1"})
    assert [one["companion"] for one in versions_of(tmp_path)] == ["1", "2"]
    for damaged in ("{", "{}"):
        (tmp_path / "versions.json").write_text(damaged)
        with pytest.raises(ConfigError, match="no list of versions"):
            versions_of(tmp_path)


def test_an_interruption_keeps_the_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(running, "run_here", interrupted)
    with pytest.raises(CompanionError, match="evidence: interrupted; the results are kept in"):
        run(PLAN, tmp_path, QUIET, workers=1, scheduler=LOCAL)


def test_another_seed_or_a_file_in_the_way_is_refused(written: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="results of another campaign"):
        run(replace(PLAN, seed=6), written, QUIET, workers=1, scheduler=LOCAL)
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="file"):
        run(PLAN, tmp_path / "file", QUIET, workers=1, scheduler=LOCAL)
    with pytest.raises(ConfigError, match="--workers: only for this machine"):
        run(PLAN, tmp_path, QUIET, workers=1, scheduler="tcp://127.0.0.1:9")


def test_the_table_fits_eighty_columns(written: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = json.loads((written / "evidence.json").read_text())
    report["results"]["gdl90-1hz"] = {"ardupilot-610": report["results"]["perfect"]["companion"]}
    print_figures(Console(width=80, highlight=False), report)
    shown = capsys.readouterr().out
    assert "ardupilot-610" in shown
    assert "…" not in shown
    assert "the peers' encounters" not in shown


def test_peers_are_those_named_or_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert available(["mvp", "companion", "mvp"], QUIET) == ("mvp",)
    monkeypatch.setattr("sim.evidence.command.find_spec", lambda _: None)
    assert available([], QUIET) == ("none", "ardupilot", "ardupilot-610", "mvp")


def test_the_default_sizes_are_some_ten_thousand_and_scale() -> None:
    peers = ("none", "ardupilot", "ardupilot-610", "mvp", "orca")
    usual, large = (EvidencePlan(count, peers=peers) for count in (1000, 10_000))
    assert 8_000 < usual.flights < 14_000
    assert large.campaigns["presets"].plan.encounters == 4000
    assert usual.campaigns["presets"].plan.encounters == 400
    assert set(EvidencePlan(1).campaigns["latency"].plan.numbers()) == {1}
