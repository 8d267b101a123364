"""Faults of the companion itself: killed, terminated, and a step of its computer's clock."""

import asyncio
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from companion.clock import SteadyClock
from sim.scenario import Autopilot
from tests.support.autopilots import GUIDED_MODE, MISSION_MODE, every, in_turn
from tests.support.companion_process import aircraft
from tests.support.faulty_flight import START_S, faulty_flight
from tests.support.virtual_time import VirtualTimeLoop, in_virtual_time

pytestmark = pytest.mark.wire


def longest_recovery_s(start_s: float) -> float:
    """The limit from the first line of log to control of the aircraft; a busy machine also starts slowly."""
    return 2.0 + 2.0 * start_s


@every
async def test_a_companion_killed_while_flying_gives_the_aircraft_back_after_a_restart(
    autopilot: Autopilot, tmp_path: Path
) -> None:
    """Also: a companion terminated while flying gives the aircraft back first."""
    async with aircraft(autopilot, tmp_path) as flight:
        await flight.flown()
        course_rad = flight.vehicle.truth.heading_rad
        await flight.end(signal.SIGKILL)
        await asyncio.sleep(2.0)
        truth = flight.vehicle.truth
        assert truth.mode == {**GUIDED_MODE, "px4": "HOLD"}[autopilot]
        assert not truth.uncontrolled
        if autopilot != "px4":
            assert abs(truth.heading_rad - course_rad) < 0.6, "it keeps or reaches its commanded course"
        start_s = await flight.start()
        started_s = flight.vehicle.time_s
        # Given back after the restart; then flown again, as the conflict still lasts.
        await flight.until(lambda: flight.vehicle.truth.on_mission)
        assert flight.vehicle.time_s - started_s < longest_recovery_s(start_s)
        await flight.until(lambda: flight.vehicle.truth.companion_flies)
        code, log = await flight.end(signal.SIGTERM)
        assert code == 0
        assert f"found, giving back to {MISSION_MODE[autopilot]}" in log
        assert "Traceback" not in log
        assert flight.vehicle.truth.on_mission
        assert not flight.vehicle.truth.uncontrolled
        assert not (tmp_path / "state").exists()


async def test_px4_left_in_a_climb_is_uncontrolled_until_the_next_run_recovers_it(tmp_path: Path) -> None:
    allow_climb = "avoidance: {reserve_s: 60, weights: {spared_height: 0}}\n"
    async with aircraft("px4", tmp_path, below_m=30.0, options=allow_climb) as flight:
        await flight.flown()
        await asyncio.sleep(1.5)
        await flight.end(signal.SIGKILL)
        await flight.until(lambda: flight.vehicle.truth.mode == "HOLD")
        assert flight.vehicle.truth.uncontrolled
        start_s = await flight.start()
        started_s = flight.vehicle.time_s
        await flight.until(lambda: flight.vehicle.truth.companion_flies)
        assert flight.vehicle.time_s - started_s < longest_recovery_s(start_s)
        await flight.until(lambda: not flight.vehicle.truth.uncontrolled)
        await asyncio.sleep(1.0)
        assert not flight.vehicle.truth.uncontrolled
        code, log = await flight.end(signal.SIGTERM)
        assert code == 0
        assert "attitude setpoint lost, recovering" in log
        assert flight.vehicle.truth.on_mission
        assert not flight.vehicle.truth.uncontrolled


class SteppedTime:
    """The clocks that `companion.clock` reads: a system clock that is set meanwhile, and a monotonic one."""

    def __init__(self, monotonic_s: Callable[[], float]) -> None:
        self._monotonic_s = monotonic_s
        self.error_s = 0.0

    def time_ns(self) -> int:
        return round((START_S + self.error_s + self._monotonic_s()) * 1e9)

    def monotonic_ns(self) -> int:
        return round(self._monotonic_s() * 1e9)


@in_turn("error_s", [-3600.0, 3600.0, -3600.0])
@in_virtual_time
async def test_a_step_of_the_system_clock_changes_nothing(
    autopilot: Autopilot, error_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    computer = SteppedTime(loop.time)
    monkeypatch.setattr("companion.clock.time", computer)
    monkeypatch.setattr(time, "time", lambda: computer.time_ns() / 1e9)
    async with faulty_flight(autopilot, clock=SteadyClock()) as flight:
        await flight.engaged()
        computer.error_s = error_s
        before = len(flight.notes.commands())
        await flight.fly(5.0)
        assert flight.engine.supervisor.flying
        # GUIDED_COURSE is sent a course every two seconds.
        assert len(flight.notes.commands()) - before >= (2 if autopilot == "px4-1.18" else 20)
        computer.error_s = 0.0
        await flight.fly(5.0)
        assert flight.modes == [MISSION_MODE[autopilot], GUIDED_MODE[autopilot]]
