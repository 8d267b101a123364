"""Every command of an installed package, from an empty folder outside the repository."""

import json
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from tests.support.installation import Installation, add_extensions, install
from tests.support.paths import ROOT
from tests.support.short_scenario import write_short_head_on

SHORT_BENCH = """
import sim.bench, sim.cli
sim.bench.TRACK_COUNTS = (1, 10)
sim.bench._MEMBERS = 2
sim.bench._LOG_STEPS, sim.bench._REPLAYS = 600, 1
sim.bench._wire_latency_ms.__defaults__ = (3.0,)
sim.cli.main()
"""
LINK_LINE = "links: [udpin:127.0.0.1:{port}]\nrecording: {{enabled: false}}\nweb: {{enabled: false}}\n"


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Installation:
    """Installed without a compiler."""
    return install(tmp_path_factory.mktemp("installation"))


@pytest.fixture(scope="module")
def installed(plain: Installation) -> Installation:
    """The same with extensions where the repository has them: plain Python takes longer."""
    done = plain.run("companion", "check", "--example", "sitl")
    (plain.folder / "sitl.yaml").write_text(done.stdout)
    notice = plain.run("companion", "check", "sitl.yaml").stderr
    assert notice.startswith("Companion runs without its compiled part")
    if add_extensions(plain):
        assert plain.run("companion", "check", "sitl.yaml").stderr == ""
    return plain


@pytest.fixture(scope="module")
def measuring(installed: Installation) -> "subprocess.Popen[str]":
    """A measurement that runs beside the other tests, of fewer tracks, members and seconds than usual."""
    return installed.start("python", "-c", SHORT_BENCH, "bench", "--report", "bench.json")


@pytest.fixture(scope="module")
def flown(installed: Installation) -> Path:
    """The log that a demonstration recorded."""
    scenario = write_short_head_on(installed.folder)
    words = ("--scenario", scenario.name, "--speedup", "30", "--no-web", "--report", "demo.json")
    done = installed.run("companion-sim", "demo", *words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads((installed.folder / "demo.json").read_text())["mission_completed"]
    (log,) = (installed.folder / "recordings").glob("*.tlog")
    return log


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def stop(running: "subprocess.Popen[str]") -> str:
    """End a command as a user does; what it wrote. The exit code must be 0."""
    running.send_signal(signal.SIGTERM)
    written, _ = running.communicate(timeout=60)
    assert running.returncode == 0, written
    return written


@pytest.mark.usefixtures("measuring")
def test_it_is_the_wheel_that_runs_and_all_data_are_in_it(installed: Installation) -> None:
    done = installed.run("python", "-c", "import companion, sim; print(*companion.__path__, *sim.__path__)")
    for name, place in zip(("companion", "sim"), map(Path, done.stdout.split()), strict=True):
        assert place.is_relative_to(installed.venv)
        kept = {path.relative_to(ROOT / name) for path in (ROOT / name).rglob("*") if is_data(path)}
        assert kept <= {path.relative_to(place) for path in place.rglob("*")}


def is_data(path: Path) -> bool:
    return path.is_file() and path.suffix not in (".py", ".so", ".pyc", ".md")


def test_a_configuration_is_shown_checked_and_flown(installed: Installation) -> None:
    for words in (("--version",), ("--help",), ("check", "--reference"), ("check", "sitl.yaml", "--table")):
        assert installed.run("companion", *words).returncode == 0
    (installed.folder / "other.yaml").write_text(LINK_LINE.format(port=free_port()))
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as service_manager:
        service_manager.settimeout(60.0)
        service_manager.bind(place := str(installed.folder / "notify"))
        running = installed.start("companion", "run", "other.yaml", NOTIFY_SOCKET=place)
        while b"READY=1" not in service_manager.recv(1000):
            pass
        stop(running)


def test_a_vehicle_is_found_through_a_relay(installed: Installation) -> None:
    near, far = free_port(), free_port()
    (installed.folder / "near.yaml").write_text(LINK_LINE.format(port=near))
    words = ("--listen", f"udpin:127.0.0.1:{far}", "--to", f"udpout:127.0.0.1:{near}")
    relay = installed.start("companion-sim", "relay", *words)
    vehicle = installed.start("companion-sim", "vehicle", "--link", f"udpout:127.0.0.1:{far}")
    done = installed.run("companion", "check", "near.yaml", "--link", "--seconds", "8")
    stop(vehicle)
    stop(relay)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "ArduPlane" in done.stdout


def test_a_flight_is_replayed_and_reported(installed: Installation, flown: Path) -> None:
    done = installed.run("companion", "replay", str(flown), "--report", "replay.json")
    assert done.returncode == 0, done.stderr
    assert json.loads((installed.folder / "replay.json").read_text())["layers"]["outer"] > 0
    refused = installed.run("companion", "report", str(flown))
    assert refused.stderr == "companion report needs matplotlib: pip install 'mavlink-companion[report]'\n"
    assert installed.run("companion", "report", str(flown), "--out", "r.html", extras=True).returncode == 0
    assert (installed.folder / "r.html").stat().st_size > 100_000


def test_experiments_are_flown(installed: Installation) -> None:
    assert installed.run("companion-sim", "paper", "--table").returncode == 0
    words = ("paper", "--out", "results", "--study", "fields", "--fields", "1")
    assert installed.run("companion-sim", *words).returncode == 2, "matplotlib is not there"
    assert installed.run("companion-sim", *words, extras=True).returncode == 0
    assert (installed.folder / "results" / "fields.png").exists()


def test_encounters_are_flown(installed: Installation) -> None:
    words = ("--encounters", "2", "--workers", "1")
    done = installed.run("companion-sim", "encounter", "1")
    assert done.returncode == 0, done.stderr
    assert installed.run("companion-sim", "campaign", *words, "--page", "p.html", extras=True).returncode == 0
    assert (installed.folder / "p.html").exists()


def test_speed_is_measured(installed: Installation, measuring: "subprocess.Popen[str]") -> None:
    written, _ = measuring.communicate(timeout=240)
    assert measuring.returncode == 0, written
    assert "wire_latency_ms" in json.loads((installed.folder / "bench.json").read_text())
