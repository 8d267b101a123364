"""`companion-sim campaign --scheduler ADDRESS` against a real scheduler and real workers on loopback."""

import contextlib
import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from sim.campaign.command import run
from sim.campaign.plan import Plan
from sim.campaign.results import ResultLine, read_results
from tests.support.commands import call
from tests.support.paths import ROOT

CAMPAIGN = (sys.executable, "-c", "from sim.cli import main; main()", "campaign", "--results", "r.ndjson")
# Time limit that a busy machine does not reach.
PATIENCE_S = 90.0


@contextlib.contextmanager
def started(*command: str, folder: Path, log: str, sources: Path = ROOT) -> Iterator[subprocess.Popen[bytes]]:
    """A dask process, killed at the end; its output is in the file `log`."""
    # Ignore the user's settings and folders.
    settings = {"DASK_CONFIG": str(folder), "DASK_TEMPORARY_DIRECTORY": str(folder)}
    environment = {**os.environ, **settings, "PYTHONPATH": str(sources)}
    with (folder / log).open("wb") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{command[0]}", *command[1:], "--no-dashboard"],
            cwd=folder,
            env=environment,
            stdout=said,
            stderr=said,
        )
        try:
            yield process
        finally:
            process.kill()
            process.wait()


@contextlib.contextmanager
def scheduler(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A scheduler on a free port: its address, and its process."""
    info = folder / "scheduler.json"
    options = ("--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(info))
    with started("scheduler", *options, folder=folder, log="scheduler.log") as process:
        until(lambda: info.exists() and info.read_text().endswith("}"), process)
        yield json.loads(info.read_text())["address"], process


def worker(
    address: str, folder: Path, log: str, sources: Path = ROOT
) -> contextlib.AbstractContextManager[subprocess.Popen[bytes]]:
    """A worker without a nanny that would restart it."""
    return started(
        "worker", address, "--no-nanny", "--nthreads", "1", folder=folder, log=log, sources=sources
    )


def campaign(folder: Path, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*CAMPAIGN, *options], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def until(happened: Callable[[], bool], process: subprocess.Popen[Any]) -> None:
    """Wait for an effect of a running process."""
    deadline_s = time.monotonic() + PATIENCE_S
    while not happened():
        assert process.poll() is None, "the process ended before"
        assert time.monotonic() < deadline_s, "timeout"
        time.sleep(0.02)


def has_results(folder: Path) -> bool:
    path = folder / "r.ndjson"
    return path.exists() and path.read_bytes().count(b"\n") > 1


def one_line(text: str) -> str:
    (line,) = text.splitlines()
    return line


def without_timing(path: Path) -> list[ResultLine]:
    results = sorted(read_results(path), key=lambda result: result["number"])
    return [{key: value for key, value in result.items() if key != "timing"} for result in results]


def test_a_killed_worker_does_not_change_the_results(tmp_path: Path) -> None:
    # ArduPilot's rule decides fastest.
    plan = Plan(16, seed=3, avoiders=("ardupilot",))
    options = ("--encounters", "16", "--seed", "3", "--avoider", "ardupilot", "--report", "r.json")
    with (
        scheduler(tmp_path) as (address, process),
        worker(address, tmp_path, "first.log") as first,
        worker(address, tmp_path, "second.log"),
    ):
        joined = tmp_path / "scheduler.log"
        until(lambda: joined.read_text().count("Register worker") == 2, process)
        flying = campaign(tmp_path, *options, "--scheduler", address)
        until(lambda: has_results(tmp_path), flying)
        first.kill()
        assert flying.poll() is None, "the worker must die during the campaign"
        _, errors = flying.communicate(timeout=PATIENCE_S)
    assert (flying.returncode, errors) == (0, "")
    numbers = [result["number"] for result in read_results(tmp_path / "r.ndjson")]
    assert sorted(numbers) == list(plan.numbers())
    here = run(plan, tmp_path / "here.ndjson", Console(quiet=True), workers=1)["avoiders"]["ardupilot"]
    there = json.loads((tmp_path / "r.json").read_text())["avoiders"]["ardupilot"]
    measured = {"decision_ms", "encounters_per_s"}
    assert {k: v for k, v in there.items() if k not in measured} == {
        k: v for k, v in here.items() if k not in measured
    }
    assert without_timing(tmp_path / "r.ndjson") == without_timing(tmp_path / "here.ndjson")


def test_a_lost_scheduler_is_one_line_and_the_results_are_kept(tmp_path: Path) -> None:
    with scheduler(tmp_path) as (address, process), worker(address, tmp_path, "worker.log"):
        flying = campaign(tmp_path, "--encounters", "500", "--avoider", "ardupilot", "--scheduler", address)
        until(lambda: has_results(tmp_path), flying)
        process.kill()
        _, errors = flying.communicate(timeout=PATIENCE_S)
    kept = len(list(read_results(tmp_path / "r.ndjson")))
    assert flying.returncode == 1
    assert f"lost the scheduler {address}; {kept} results are kept" in one_line(errors)


def test_it_waits_for_workers_and_refuses_one_with_another_version(tmp_path: Path) -> None:
    """The worker joins while the campaign waits; its results would differ."""
    for package in ("companion", "sim"):
        shutil.copytree(ROOT / package, tmp_path / "other" / package)
    changed = tmp_path / "other" / "sim" / "metrics.py"
    changed.write_text(changed.read_text() + "# changed\n")
    with scheduler(tmp_path) as (address, _):
        flying = campaign(tmp_path, "--scheduler", address)
        assert flying.stdout is not None
        assert "waiting" in flying.stdout.readline()
        with worker(address, tmp_path, "worker.log", sources=tmp_path / "other"):
            _, errors = flying.communicate(timeout=PATIENCE_S)
    assert flying.returncode == 2
    assert "is refused: companion" in one_line(errors)
    assert not has_results(tmp_path)


def test_a_missing_scheduler_is_one_line_and_exit_code_two(tmp_path: Path) -> None:
    plan = Plan(1, avoiders=("none",))
    run(plan, tmp_path / "r.ndjson", Console(quiet=True), workers=1)
    before = (tmp_path / "r.ndjson").read_bytes()
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))  # without listening
        address = f"127.0.0.1:{unused.getsockname()[1]}"
        flying = campaign(tmp_path, "--scheduler", address)
        _, errors = flying.communicate(timeout=PATIENCE_S)
    assert flying.returncode == 2
    assert one_line(errors) == f"--scheduler {address}: Connection refused"
    assert (tmp_path / "r.ndjson").read_bytes() == before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--scheduler", "somewhere"), "such as tcp://"),
        (("--scheduler", "127.0.0.1:8786", "--workers", "2"), "--workers"),
    ],
)
def test_bad_usage_is_one_line_and_exit_two(tmp_path: Path, options: tuple[str, ...], words: str) -> None:
    done = call("campaign", "--results", "r.ndjson", *options, module="sim", folder=tmp_path)
    assert done.returncode == 2
    assert words in one_line(done.stderr)
    assert not (tmp_path / "r.ndjson").exists()
