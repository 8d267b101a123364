"""What is old when it is read: late copies of everything, and a companion that was stopped for a while."""

import asyncio
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from companion.control.state_machine import State
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import FrameSplitter
from companion.model import Role
from sim.faults import Faults
from sim.scenario import Autopilot
from sim.vehicle import Mode
from tests.support.autopilots import ALL, BOTH, GUIDED_MODE, MISSION_MODE, every, paired
from tests.support.companion_process import Aircraft, aircraft
from tests.support.faulty_flight import FaultyFlight, faulty_flight
from tests.support.thorough import pairs, sample
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire


# --- late copies


LATE_S = (0.8, 5.0)


@pytest.mark.parametrize(("autopilot", "late_s"), sample(pairs(BOTH, LATE_S)[1:], pairs(ALL, LATE_S)))
@in_virtual_time
async def test_late_copies_of_every_frame_change_nothing(autopilot: Autopilot, late_s: float) -> None:
    async with faulty_flight(autopilot, forth=Faults(copy_after_s=late_s)) as flight:
        await flight.engaged()
        await flight.resumed()
        assert flight.modes == [MISSION_MODE[autopilot], GUIDED_MODE[autopilot], MISSION_MODE[autopilot]]
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


class Station:
    """A ground station, whose frames go the way of the vehicle's."""

    def __init__(self, flight: FaultyFlight, own: socket.socket) -> None:
        self._flight = flight
        self._socket = own
        self._encoder = Encoder()

    def send(self, message: Message) -> None:
        self._socket.send(self._encoder.encode(message, 255, 190))

    def command(self, number: int, *params: float, confirmation: int = 0) -> None:
        filled = [*params, *[0.0] * (7 - len(params))]
        self.send(mavlink.MAVLink_command_long_message(1, 196, number, confirmation, *filled))

    def role(self, role: Role) -> None:
        self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, role)

    def well_clear(self, metres: float) -> None:
        self.send(mavlink.MAVLink_param_set_message(1, 196, b"CA_WC_HORIZ", metres, 9))

    def beat(self) -> None:
        self.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))


def answers(flight: FaultyFlight) -> list[Message]:
    return [message for _, message in flight.notes.sent_messages if message.get_type() == "COMMAND_ACK"]


@contextmanager
def station(flight: FaultyFlight) -> Iterator[Station]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.connect(("127.0.0.1", flight.relay.local_port))
        yield Station(flight, own)


@paired("late_s", [0.8, 5.0, 12.0])
@in_virtual_time
async def test_late_copies_of_an_operators_requests_do_not_undo_later_ones(
    autopilot: Autopilot, late_s: float
) -> None:
    async with faulty_flight(autopilot, forth=Faults(copy_after_s=late_s)) as flight:
        flight.receiver.deaf = True
        await flight.until(lambda: flight.state is State.MONITOR)
        operator = flight.engine.operator
        with station(flight) as one:
            for role, metres in ((Role.OFF, 700.0), (Role.FLY, 800.0), (Role.ADVISE, 900.0)):
                one.role(role)
                one.well_clear(metres)
                await flight.fly(0.2)
                one.beat()
                await flight.fly(0.1)
            for _ in range(150):
                await flight.fly(0.1)
                assert operator.role is Role.ADVISE
                assert operator.settings.avoidance.well_clear_horizontal_m == 900.0
        assert flight.runtime.intake.repeated == 6
        accepted, rejected = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        results = [answer.result for answer in answers(flight)]
        assert results == [*[accepted] * 3, rejected, rejected, accepted], "copies of off, fly and advise"


@every
@in_virtual_time
async def test_a_late_copy_of_resume_is_not_obeyed_and_a_repetition_is(autopilot: Autopilot) -> None:
    async with faulty_flight(autopilot, forth=Faults(copy_after_s=5.0)) as flight:
        await flight.engaged()
        with station(flight) as one:
            one.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 1.0)
            await flight.until(lambda: flight.vehicle.truth.on_mission, 4.0)
            await flight.fly(8.0)
            assert flight.runtime.intake.repeated == 1
            assert [one.result for one in answers(flight)] == [mavlink.MAV_RESULT_ACCEPTED] * 2
            one.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 1.0, confirmation=1)
            await flight.fly(1.0)
        assert len(answers(flight)) == 3


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


TAKEN: list[tuple[Autopilot, Mode | str]] = [
    ("ardupilot", Mode.MANUAL),
    ("px4", "POSCTL"),
    ("ardupilot", Mode.RTL),
    ("px4", "HOLD"),  # PX4 has entered the same mode by itself a second before
    ("px4-1.18", "POSCTL"),
]


@pytest.mark.parametrize(
    ("autopilot", "taken", "while_flying"),
    [(*each, True) for each in TAKEN] + [(*each, False) for each in sample(TAKEN[:2], TAKEN)],
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
