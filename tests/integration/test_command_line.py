"""The commands as processes: exit codes, one-line errors, reports."""

import json
import subprocess
from pathlib import Path

import pytest

from companion import __version__
from tests.support.commands import call
from tests.support.paths import CONFIGS, TLOGS


def last_line(text: str) -> str:
    return text.strip().splitlines()[-1]


def assert_one_line(result: subprocess.CompletedProcess[str], code: int, words: str) -> None:
    assert result.returncode == code
    assert "Traceback" not in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert words in result.stderr


@pytest.mark.parametrize("name", ["arduplane.yaml", "px4.yaml", "sitl.yaml"])
def test_check_prints_the_values_in_effect(name: str) -> None:
    result = call("check", str(CONFIGS / name))
    assert result.returncode == 0
    assert "max_bank_deg: 30" in result.stdout
    assert "good to fly with" in last_line(result.stdout)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("links: [udpin:127.0.0.1:14550]\navoidance: {outer_tim_s: 3}\n", "2: avoidance.outer_tim_s"),
        ("links: [udpin:127.0.0.1:14550]\ntraffic: {stale_s: -1}\n", "2: traffic.stale_s"),
        ("links: [tcp:1]\n", "1: links"),
        (
            "links: [udpin:127.0.0.1:14550]\navoidance: {inner_time_s: 50, outer_time_s: 40}\n",
            "inner_time_s must",
        ),
    ],
    ids=["unknown key", "impossible value", "bad link", "contradiction"],
)
@pytest.mark.parametrize("command", ["check", "run"])
def test_a_bad_configuration_is_refused(tmp_path: Path, command: str, text: str, words: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    result = call(command, str(path))
    assert_one_line(result, 2, words)
    assert "bad.yaml:" in result.stderr


def test_files_of_the_flight_that_cannot_be_written_are_refused_by_check(tmp_path: Path) -> None:
    (tmp_path / "a file").touch()
    (tmp_path / "folder").mkdir()
    path = tmp_path / "c.yaml"
    path.write_text(
        "links: [udpin:127.0.0.1:14550]\n"
        f"state_file: {tmp_path}/nowhere/state\n"
        f"settings_file: {tmp_path}/folder\n"
        "recording:\n"
        "  enabled: true\n"
        f"  directory: '{tmp_path}/a file/recordings'\n"
    )
    result = call("check", str(path))
    assert result.returncode == 2
    assert result.stderr.splitlines() == [
        f"{path}:2: state_file: {tmp_path}/nowhere/state cannot be written: "
        f"there is no folder {tmp_path}/nowhere",
        f"{path}:3: settings_file: {tmp_path}/folder cannot be written: this is a folder, not a file",
        f"{path}:6: recording.directory: {tmp_path}/a file/recordings cannot be written: "
        f"there is no folder {tmp_path}/a file",
    ]
    assert "good to fly" not in result.stdout


@pytest.mark.parametrize("option", ["--report", "--decisions"])
def test_an_output_that_cannot_be_written_is_refused_before_the_replay(option: str) -> None:
    log = str(next(iter(TLOGS.values())))
    result = call("replay", log, option, "/proc/out.json")
    assert_one_line(result, 2, "/proc/out.json: cannot be written: ")
    assert result.stdout == "", "nothing was replayed"


@pytest.mark.parametrize("command", ["check", "run"])
def test_a_bad_obstacle_file_is_refused(tmp_path: Path, command: str) -> None:
    (tmp_path / "masts.yaml").write_text("obstacles:\n- {name: Mast, lat_deg: 47, lon_deg: 8}\n")
    config = tmp_path / "c.yaml"
    config.write_text("links: [udpin:127.0.0.1:14550]\nobstacle_files: [masts.yaml]\n")
    assert_one_line(call(command, str(config)), 2, "masts.yaml:2: obstacles[0]: Mast: give either")


def test_check_counts_the_obstacles(tmp_path: Path) -> None:
    masts = "obstacles:\n" + "".join(
        f"- {{name: Mast {i}, lat_deg: 47.{i}, lon_deg: 8, height_m: 30}}\n" for i in range(3)
    )
    (tmp_path / "masts.yaml").write_text(masts)
    config = tmp_path / "c.yaml"
    config.write_text("links: [udpin:127.0.0.1:14550]\nobstacle_files: [masts.yaml]\n")
    assert "# obstacle_files: 3 obstacles" in call("check", str(config)).stdout


def test_missing_files_are_refused_in_one_line() -> None:
    assert_one_line(call("run", "nowhere.yaml"), 2, "nowhere.yaml")
    assert_one_line(call("replay", "nowhere.tlog"), 1, "nowhere.tlog")


def test_a_log_without_frames_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "noise.tlog"
    path.write_bytes(bytes(5000))
    assert_one_line(call("replay", str(path)), 1, "noise.tlog")


@pytest.mark.parametrize("module", ["companion", "sim"])
def test_the_help_of_every_command_has_an_example(module: str) -> None:
    overview = call("--help", module=module)
    assert overview.returncode == 0
    commands = {"companion": ["run", "check", "replay", "report"], "sim": ["demo", "vehicle", "bench"]}[
        module
    ]
    for command in commands:
        assert command in overview.stdout
        text = call(command, "--help", module=module)
        assert text.returncode == 0
        assert "Example:" in text.stdout


@pytest.mark.parametrize(("module", "name"), [("companion", "companion"), ("sim", "companion-sim")])
def test_version_prints_name_and_version(module: str, name: str) -> None:
    result = call("--version", module=module)
    assert result.returncode == 0
    assert result.stdout == f"{name} {__version__}\n"


@pytest.mark.parametrize("option", ["--report", "--decisions"])
def test_a_replay_refuses_an_impossible_output_path_before_it_reads_the_log(
    tmp_path: Path, option: str
) -> None:
    out = tmp_path / "no such folder" / "out"
    assert_one_line(call("replay", "nowhere.tlog", option, str(out)), 2, "there is no folder")


@pytest.mark.parametrize("arguments", [["fly"], ["run"], ["replay", "x.tlog", "--unknown"]])
def test_bad_usage_is_exit_2(arguments: list[str]) -> None:
    assert call(*arguments).returncode == 2


@pytest.mark.parametrize(
    "arguments",
    [["demo", "--scenario", "nowhere"], ["demo", "--speedup", "0"], ["vehicle", "--link", "carrier-pigeon"]],
)
def test_bad_usage_of_the_simulation_is_exit_2(arguments: list[str]) -> None:
    result = call(*arguments, module="sim")
    assert result.returncode == 2
    assert "Traceback" not in result.stderr


def test_replay_writes_report_and_decisions(tmp_path: Path) -> None:
    report, decisions = tmp_path / "r.json", tmp_path / "d.jsonl"
    log = TLOGS["arduplane_fake_two_intruders"]
    result = call("replay", str(log), "--report", str(report), "--decisions", str(decisions))
    assert result.returncode == 0
    figures = json.loads(report.read_text())
    assert figures["messages"] == 3152
    assert set(figures) >= {
        "messages", "bad_bytes", "duration_s", "elapsed_s", "messages_per_s", "decisions", "layers",
    }  # fmt: skip
    assert set(figures["layers"]) == {"clear", "outer", "inner"}
    lines = [json.loads(line) for line in decisions.read_text().splitlines()]
    assert len(lines) == figures["decisions"]
    assert "outer" in result.stdout


def test_saved_settings_take_precedence_over_the_configuration(tmp_path: Path) -> None:
    config, saved = tmp_path / "companion.yaml", tmp_path / "companion.settings"
    config.write_text(f"links: [udpin:127.0.0.1:14550]\nsettings_file: {saved}\n")
    saved.write_text('{"CA_ROLE": 1, "CA_DOMAIN": 45.5, "CA_OLD": 1}')
    result = call("check", str(config))
    assert result.returncode == 0
    assert f"# {saved}: CA_ROLE 1 instead of 2: supervisor.role\n" in result.stdout
    assert f"# {saved}: CA_DOMAIN 45.5 deg instead of 90 deg: avoidance.delta_beta_deg\n" in result.stdout
    assert f"# {saved}: not used: CA_OLD: unknown\n" in result.stdout
    assert "good to fly with" in last_line(result.stdout)


@pytest.mark.parametrize(
    ("text", "words"),
    [(None, "there is no such file"), ("{", "damaged"), ('{"CA_DOMAIN": 999}', "CA_DOMAIN: 999 refused")],
)
def test_a_replay_refuses_unusable_settings(tmp_path: Path, text: str | None, words: str) -> None:
    log, settings = tmp_path / "flight.tlog", tmp_path / "settings"
    log.write_bytes(b"")
    if text is not None:
        settings.write_text(text)
    assert_one_line(call("replay", str(log), "--settings", str(settings)), 2, words)
