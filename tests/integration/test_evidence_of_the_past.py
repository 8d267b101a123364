"""What is old when it is read: late copies of everything, and a companion that was stopped for a while."""

import asyncio
import os
import signal
from pathlib import Path

import pytest

from companion.control.state_machine import State
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import FrameSplitter
from sim.faults import Faults
from sim.scenario import Autopilot
from sim.vehicle import Mode
from tests.support.companion_process import Aircraft, aircraft
from tests.support.faulty_flight import GUIDED, MISSION, faulty_flight
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire

every = pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "px4-1.18"])


# --- late copies


@every
@pytest.mark.parametrize("late_s", [0.8, 5.0])
@in_virtual_time
async def test_late_copies_of_every_frame_change_nothing(autopilot: Autopilot, late_s: float) -> None:
    async with faulty_flight(autopilot, forth=Faults(copy_after_s=late_s)) as flight:
        await flight.engaged()
        await flight.resumed()
        assert flight.modes == [MISSION[autopilot], GUIDED[autopilot], MISSION[autopilot]]
        assert flight.runtime.intake.past > 1000
        assert not any("hands off" in text for text in flight.notes.texts())
        assert not flight.lowc


@in_virtual_time
async def test_among_late_copies_a_pilots_mode_is_the_newest() -> None:
    async with faulty_flight("ardupilot", forth=Faults(copy_after_s=5.0)) as flight:
        await flight.engaged()
        flight.vehicle.set_mode(Mode.FBWA)
        await flight.until(lambda: flight.state is State.HANDS_OFF, 1.5)
        since_s = flight.now_s + 0.05
        await flight.fly(20.0)
        assert flight.notes.commands(since_s) == []
        assert flight.modes[-1] == "FBWA"


# --- a second companion


@pytest.mark.parametrize("component_id", [196, 197])
@in_virtual_time
async def test_beside_a_second_companion_the_aircraft_is_not_flown(component_id: int) -> None:
    async with faulty_flight("ardupilot") as flight:
        flight.receiver.deaf = True
        encoder, splitter = Encoder(), FrameSplitter()
        beat = mavlink.MAVLink_heartbeat_message(18, 8, 1, 2, 4, 3)
        for second in range(40):
            flight.receiver.deaf = second < 8
            flight.runtime._hear(splitter.feed_datagram(encoder.encode(beat, 1, component_id)))
            await flight.fly(1.0)
        assert flight.modes == ["AUTO"]
        assert any("another companion" in text for text in flight.notes.texts())


# --- a companion that is stopped for a while, as by swap or a slow disk


def pid_of(flight: Aircraft) -> int:
    assert flight._process is not None
    return flight._process.pid


@pytest.mark.parametrize(
    ("autopilot", "taken", "while_flying"),
    [
        ("ardupilot", Mode.MANUAL, True),
        ("ardupilot", Mode.RTL, False),
        ("px4", "POSCTL", True),
        ("px4-1.18", "POSCTL", True),
    ],
    ids=["MANUAL", "RTL", "POSCTL", "POSCTL in GUIDED_COURSE"],
)
async def test_a_pilot_who_takes_over_while_the_companion_is_stalled_is_left_alone(
    autopilot: Autopilot, taken: Mode | str, while_flying: bool, tmp_path: Path
) -> None:
    async with aircraft(autopilot, tmp_path) as flight:
        if while_flying:
            await flight.flown()
        else:
            await asyncio.sleep(4.0)
        os.kill(pid_of(flight), signal.SIGSTOP)
        await asyncio.sleep(2.0)
        flight.vehicle.set_mode(taken)
        mode = flight.vehicle.truth.mode
        await asyncio.sleep(2.0)
        os.kill(pid_of(flight), signal.SIGCONT)
        for _ in range(60):
            await asyncio.sleep(0.1)
            assert flight.vehicle.truth.mode == mode
        code, log = await flight.end(signal.SIGTERM)
        assert flight.vehicle.truth.mode == mode
        assert "stalled for 4" in log
        assert "Traceback" not in log
        assert code == 0


@pytest.mark.parametrize("autopilot", ["px4", "px4-1.18"])
async def test_px4_after_a_short_stall_is_entered_again_in_order_or_given_back(
    autopilot: Autopilot, tmp_path: Path
) -> None:
    async with aircraft(autopilot, tmp_path) as flight:
        await flight.flown()
        os.kill(pid_of(flight), signal.SIGSTOP)
        await asyncio.sleep(1.3)
        os.kill(pid_of(flight), signal.SIGCONT)
        for _ in range(80):
            await asyncio.sleep(0.1)
            assert not flight.vehicle.truth.uncontrolled
        assert flight.vehicle.truth.companion_flies or flight.vehicle.truth.on_mission
