"""Every signal that can be caught: the aircraft is given back first, or the signal changes nothing."""

import asyncio
import os
import signal
from pathlib import Path

import pytest

from companion.signals import ENDING, IGNORED
from tests.support.companion_process import aircraft

pytestmark = pytest.mark.wire

SOME_IGNORED = [number for number in IGNORED if number <= signal.SIGSYS] + [
    signal.SIGRTMIN, signal.SIGRTMAX,
]  # fmt: skip
NOT_CAUGHT = {
    signal.SIGKILL, signal.SIGSTOP, signal.SIGABRT,
    signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGTRAP, signal.SIGSYS,
}  # fmt: skip
# Ignored, or without any effect on a process, unless it asks for them.
HARMLESS = {signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH}


def test_every_signal_has_a_decision_and_a_reason() -> None:
    assert set(signal.Signals) <= {*ENDING, *IGNORED, *NOT_CAUGHT, *HARMLESS}
    assert not {*ENDING} & {*IGNORED}
    assert all([*ENDING.values(), *IGNORED.values()])


@pytest.mark.parametrize("number", [*ENDING], ids=lambda number: number.name)
async def test_a_signal_that_ends_the_service_gives_the_aircraft_back_first(
    number: signal.Signals, tmp_path: Path
) -> None:
    async with aircraft("ardupilot", tmp_path, display=number is signal.SIGTERM) as flight:
        await flight.flown()
        flight.signal(number)
        flight.signal(number)  # a second one does not cut the release short
        await asyncio.sleep(0.05)
        flight.signal(signal.SIGTERM)
        assert await flight.ended() == 0
        truth = flight.vehicle.truth
        assert truth.on_mission
        assert not truth.uncontrolled


async def test_ignored_signals_change_nothing(tmp_path: Path) -> None:
    async with aircraft("ardupilot", tmp_path, display=True) as flight:
        await flight.flown()
        for number in SOME_IGNORED:
            flight.signal(number)
            await asyncio.sleep(0.1)
            assert flight.running, number
            assert flight.vehicle.truth.companion_flies, number
        await asyncio.sleep(1.0)
        code, log = await flight.end(signal.SIGTERM)
        assert code == 0
        assert "Traceback" not in log
        assert flight.vehicle.truth.on_mission


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_a_closed_terminal_changes_nothing(autopilot: str, tmp_path: Path) -> None:
    """Its signal comes, and then every line of the log fails."""
    async with aircraft(autopilot, tmp_path, display=True) as flight:  # type: ignore[arg-type]
        await flight.flown()
        flight.close_log()
        flight.signal(signal.SIGHUP)
        flight.signal(signal.SIGPIPE)
        await asyncio.sleep(2.0)
        assert flight.running
        assert flight.vehicle.truth.companion_flies
        flight.signal(signal.SIGTERM)
        assert await flight.ended() == 0
        assert flight.vehicle.truth.on_mission


async def test_a_log_that_no_one_reads_does_not_stop_the_flight(tmp_path: Path) -> None:
    """As behind `| less`: the pipe is full, and a write to it would wait for ever."""
    async with aircraft("ardupilot", tmp_path, stuck_log=True) as flight:
        await flight.flown()
        assert flight.running
        flight.signal(signal.SIGTERM)
        assert await flight.ended() == 0
        assert flight.vehicle.truth.on_mission


DAMAGE = {
    "nested": b"[" * 1000,
    "number": b'{"time_s":1e9,"system_id":1,"before":{"mode":15,"sequence":1e308,"target":null,'
    b'"course_rad":0,"altitude_m":0,"airspeed_mps":0},"role":null,"left_behind":15,"borrowed":{}}',
    "large": b"9" * 5_000_000,
    "bytes": bytes(range(256)),
}


@pytest.mark.parametrize("kind", [*DAMAGE, "fifo", "folder", "endless"])
async def test_what_a_former_run_left_neither_hangs_nor_crashes_and_is_set_aside(
    kind: str, tmp_path: Path
) -> None:
    for name in ("state", "settings"):
        path = tmp_path / name
        if kind == "fifo":
            os.mkfifo(path)
        elif kind == "folder":
            path.mkdir()
        elif kind == "endless":
            path.symlink_to("/dev/zero")
        else:
            path.write_bytes(DAMAGE[kind])
    options = f"settings_file: {tmp_path / 'settings'}\n"
    async with aircraft("ardupilot", tmp_path, options=options) as flight:
        await flight.flown()
        code, log = await flight.end(signal.SIGTERM)
    assert code == 0, log
    assert "Traceback" not in log
    assert f"{tmp_path / 'state'}:" in log
    assert f"{tmp_path / 'settings'}:" in log
    # A folder is not ours to rename; settings with names that are unknown are a file all the same.
    stays = {"folder": {"state", "settings"}, "number": {"settings"}}.get(kind, set())
    bad = {"state.bad", "settings.bad"} - {f"{name}.bad" for name in stays}
    assert bad <= set(os.listdir(tmp_path))  # noqa: PTH208 - in an async test


@pytest.mark.parametrize("kind", ["fifo", "large"])
async def test_sigterm_ends_the_service_while_it_starts(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "state"
    if kind == "fifo":
        os.mkfifo(path)
    else:
        with path.open("wb") as file:
            file.truncate(1 << 40)
    async with aircraft("ardupilot", tmp_path, without_vehicle=True) as flight:
        code, _ = await flight.end(signal.SIGTERM)
        assert code == 0
