"""Notifications to the service manager on a real socket, and the settings of its unit file."""

import configparser
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from companion import runtime
from companion.engine import TICK_US, WATCHDOG_S
from companion.watchdog import Watchdog
from tests.support.paths import CONFIGS

UNIT = CONFIGS / "companion.service"


@pytest.fixture(params=["path", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[socket.socket, str]]:
    """A socket like systemd's, and its name for NOTIFY_SOCKET."""
    name = str(tmp_path / "notify") if request.param == "path" else f"@companion-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(name.replace("@", "\0", 1))
        listening.setblocking(False)
        yield listening, name


def heard(listening: socket.socket) -> list[str]:
    messages = []
    while True:
        try:
            messages.append(listening.recv(4096).decode())
        except BlockingIOError:
            return messages


def test_start_and_stop_are_reported(manager: tuple[socket.socket, str]) -> None:
    listening, name = manager
    watchdog = Watchdog({"NOTIFY_SOCKET": name})
    watchdog.ready()
    watchdog.alive(1, 0.0)
    watchdog.alive(1000, 100.0)
    watchdog.stopping()
    assert heard(listening) == ["READY=1", "STOPPING=1"], "no watchdog is configured"


def test_alive_is_sent_twice_a_period_and_only_after_new_ticks(manager: tuple[socket.socket, str]) -> None:
    listening, name = manager
    watchdog = Watchdog({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "3000000", "WATCHDOG_PID": str(os.getpid())})
    watchdog.alive(0, 100.0)
    assert heard(listening) == [], "no tick yet"
    for tick in range(1, 101):  # ten seconds of ten ticks
        watchdog.alive(tick, 100.0 + tick / 8.0)
    assert heard(listening) == 9 * ["WATCHDOG=1"]
    for later in range(100):
        watchdog.alive(100, 200.0 + later)
    assert len(heard(listening)) <= 1, "ticks have stopped"
    watchdog.alive(101, 400.0)
    assert heard(listening) == ["WATCHDOG=1"]


@pytest.mark.parametrize(
    "more",
    [{"WATCHDOG_PID": "1"}, {"WATCHDOG_USEC": "soon"}, {"WATCHDOG_USEC": "-5"}, {"WATCHDOG_USEC": "0"}],
)
def test_nothing_is_sent_without_a_watchdog(manager: tuple[socket.socket, str], more: dict[str, str]) -> None:
    listening, name = manager
    watchdog = Watchdog({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "3000000", **more})
    watchdog.alive(5, 100.0)
    assert heard(listening) == []


@pytest.mark.parametrize("name", ["/nowhere/notify", "@no-listener", "x" * 300, "", "vsock:2:1"])
def test_a_missing_manager_is_ignored(name: str) -> None:
    watchdog = Watchdog({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "1000"})
    watchdog.ready()
    watchdog.alive(1, 0.0)
    watchdog.stopping()


def test_a_manager_that_does_not_read_does_not_block_the_service(manager: tuple[socket.socket, str]) -> None:
    listening, name = manager
    watchdog = Watchdog({"NOTIFY_SOCKET": name})
    for _ in range(5000):
        watchdog.ready()
    assert 0 < len(heard(listening)) < 5000


def test_the_unit_file_restarts_the_service_and_waits_for_the_release() -> None:
    unit = configparser.ConfigParser(interpolation=None, strict=True)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    unit.read_string(UNIT.read_text())
    service = dict(unit["Service"])
    assert unit["Unit"]["StartLimitIntervalSec"] == "0", "restarted without limit"
    assert service["Type"] == "notify"
    assert service["Restart"] == "always"
    assert service["RestartSec"] == "500ms"
    assert service["KillSignal"] == "SIGTERM"
    assert service["User"] not in {"root", "0"}
    assert service["RestartPreventExitStatus"] == "2"
    assert " run " in service["ExecStart"]
    assert float(service["WatchdogSec"]) == WATCHDOG_S
    release_s = (runtime._LONGEST_RELEASE_US + runtime._EMERGENCY_TICKS * TICK_US) / 1e6
    assert float(service["TimeoutStopSec"]) > release_s + 2.0
    assert not set(service) & {"PrivateDevices", "ProtectClock", "DevicePolicy"}, "they hide serial ports"
