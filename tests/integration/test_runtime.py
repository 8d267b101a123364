"""The shell: links that fail, bugs, and the end of the service, over links in memory."""

import asyncio
import itertools
import os
import socket
import tty
from pathlib import Path
from typing import Any

import pytest

from companion.control.state_machine import State
from companion.engine import Engine, EngineConfig, EngineParams, Transmit
from companion.errors import CompanionError
from companion.links import memory_pair, open_link
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import Frame, decode
from companion.mavlink.tlog import read_tlog
from companion.recording.recorder import Recorder
from companion.recording.state_file import StateFile
from companion.runtime import Runtime
from companion.watchdog import Watchdog
from tests.support.talking_autopilot import Autopilot, traffic


def recorded(folder: Path) -> list[Any]:
    """The messages of the one log in the folder."""
    (log,) = folder.glob("*.tlog")
    return [decode(frame) for _, frame in read_tlog(log)]


async def until(runtime: Runtime, *states: State) -> None:
    async with asyncio.timeout(10.0):
        while runtime.engine.supervisor.state not in states:  # noqa: ASYNC110 - the engine sets no events
            await asyncio.sleep(0.02)


def new_engine() -> Engine:
    return Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1)))


class ClockByHand:
    """Stands still until it is set."""

    def __init__(self) -> None:
        self.time_us = 1_700_000_000_000_000

    def now_us(self) -> int:
        return self.time_us

    def wall_seconds_until(self, time_us: int) -> float:
        return max((time_us - self.time_us) / 1e6, 0.0)


def test_messages_that_are_late_by_a_stall_are_counted_and_not_sent() -> None:
    near, _far = memory_pair()
    clock = ClockByHand()
    runtime = Runtime(new_engine(), [near], clock=clock)
    message = mavlink.MAVLink_heartbeat_message(18, 8, 1, 0, 4, 3)
    for late_us in (0, 700_000, 701_000, 3_000_000):
        begun_us, clock.time_us = clock.time_us, clock.time_us + late_us
        runtime._perform(begun_us, [Transmit(runtime.engine.sender, message)])
    assert (near.counters.sent_frames, runtime.unsent) == (2, 2)


async def test_stopping_gives_back_and_ends() -> None:
    near, far = memory_pair()
    runtime, autopilot = Runtime(new_engine(), [near]), Autopilot(far)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    await until(runtime, State.OUTER, State.INNER)
    assert autopilot.mode == 15
    runtime.stop()
    runtime.stop()
    await asyncio.wait_for(running, 10.0)
    assert autopilot.mode == 10
    flying.cancel()


async def test_a_bug_gives_the_aircraft_back_before_it_ends_the_service() -> None:
    near, far = memory_pair()
    runtime, autopilot = Runtime(new_engine(), [near]), Autopilot(far)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    await until(runtime, State.OUTER, State.INNER)

    def broken(_now_s: float) -> list[object]:
        raise ZeroDivisionError("a bug")

    runtime.engine.tick = broken  # type: ignore[method-assign,assignment]
    with pytest.raises(ZeroDivisionError):
        await asyncio.wait_for(running, 10.0)
    assert autopilot.mode == 10
    flying.cancel()


@pytest.mark.parametrize("broken", ["tick", "decide"])
async def test_a_bug_on_the_pilots_own_heartbeat_is_not_answered_with_a_mode(broken: str) -> None:
    near, far = memory_pair()
    runtime, autopilot = Runtime(new_engine(), [near]), Autopilot(far)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    await until(runtime, State.OUTER, State.INNER)
    engine = runtime.engine
    part = engine if broken == "tick" else engine.avoider
    works = getattr(part, broken)

    def fails_when_taken(*arguments: object) -> object:
        if engine.aircraft.flight_state.custom_mode == 5:
            raise ZeroDivisionError("a bug")
        return works(*arguments)

    setattr(part, broken, fails_when_taken)
    autopilot.modes_asked.clear()
    autopilot.mode = 5
    with pytest.raises(ZeroDivisionError):
        await asyncio.wait_for(running, 10.0)
    assert autopilot.modes_asked == []
    assert autopilot.mode == 5
    flying.cancel()


async def test_an_emergency_release_hears_the_pilot_and_is_recorded(tmp_path: Path) -> None:
    near, far = memory_pair()
    recorder = Recorder(tmp_path, 0.0)
    runtime = Runtime(new_engine(), [near], recorder=recorder)
    autopilot = Autopilot(far, obeys=False)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    await until(runtime, State.OUTER, State.INNER)
    autopilot.modes_asked.clear()

    def broken(_now_s: float) -> list[object]:
        raise ZeroDivisionError("a bug")

    runtime.engine.tick = broken  # type: ignore[method-assign,assignment]
    async with asyncio.timeout(5.0):
        while not autopilot.modes_asked:  # noqa: ASYNC110 - the autopilot sets no events
            await asyncio.sleep(0.01)
    autopilot.mode = 5  # the pilot, before our request is obeyed
    with pytest.raises(ZeroDivisionError):
        await asyncio.wait_for(running, 10.0)
    assert autopilot.modes_asked == [10]
    assert autopilot.mode == 5
    flying.cancel()
    messages = recorded(tmp_path)
    asked = [int(m.param2) for m in messages if getattr(m, "command", None) == 176]
    assert asked == [15, 10], "what was sent in the emergency is recorded too"
    heard = [m.custom_mode for m in messages if m.get_type() == "HEARTBEAT" and m.autopilot == 3]
    assert heard[-1] == 5


async def test_after_an_emergency_release_the_next_run_gives_nothing_back(tmp_path: Path) -> None:
    near, far = memory_pair()
    state_file = StateFile(tmp_path / "companion.state")
    runtime, autopilot = Runtime(new_engine(), [near], state_file=state_file), Autopilot(far)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    await until(runtime, State.OUTER, State.INNER)
    assert state_file.read() is not None

    def broken(_now_s: float) -> list[object]:
        raise ZeroDivisionError("a bug")

    runtime.engine.tick = broken  # type: ignore[method-assign,assignment]
    with pytest.raises(ZeroDivisionError):
        await asyncio.wait_for(running, 10.0)
    assert autopilot.mode == 10
    assert state_file.read() is None
    flying.cancel()


async def test_an_autopilot_that_never_takes_it_back_is_said() -> None:
    near, far = memory_pair()
    runtime, autopilot = Runtime(new_engine(), [near]), Autopilot(far, obeys=False)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    await until(runtime, State.OUTER, State.INNER)
    runtime.stop()
    with pytest.raises(CompanionError, match="did not confirm"):
        await asyncio.wait_for(running, 15.0)
    assert autopilot.modes_asked.count(10) >= 3
    flying.cancel()


async def test_a_link_that_fails_is_opened_again_and_the_flight_goes_on() -> None:
    near, far = memory_pair()
    spare, spare_far = memory_pair()
    runtime, autopilot = Runtime(new_engine(), [near, spare]), Autopilot(far)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    await until(runtime, State.OUTER, State.INNER)
    spare.failed("cable pulled")
    spare_far.send(Encoder().encode(traffic(0), 1, 1))
    heard = spare.counters.frames
    async with asyncio.timeout(10.0):
        while spare.counters.frames == heard:  # noqa: ASYNC110 - a link sets no events
            await asyncio.sleep(0.02)
    assert runtime.engine.supervisor.flying
    runtime.stop()
    await asyncio.wait_for(running, 10.0)
    assert autopilot.mode == 10
    flying.cancel()
    spare_far.close()


async def test_traffic_by_a_serial_receiver_that_is_never_talked_to_and_comes_later(tmp_path: Path) -> None:
    """Autopilot on one link, ADS-B receiver on another, plugged in when the flight has begun."""
    near, far = memory_pair()
    device = tmp_path / "ttyUSB0"
    receiver = open_link(f"serial:{device}?listen")
    runtime, autopilot = Runtime(new_engine(), [near, receiver]), Autopilot(far, sees_traffic=False)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    await until(runtime, State.MONITOR)
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    device.symlink_to(os.ttyname(slave))
    encoder = Encoder()
    async with asyncio.timeout(20.0):
        for tick in itertools.count(step=4):
            os.write(master, encoder.encode(traffic(tick), 1, 156))
            await asyncio.sleep(0.2)
            if runtime.engine.supervisor.flying:
                break
    with pytest.raises(BlockingIOError):
        os.read(master, 1)
    os.close(slave)
    os.close(master)  # unplugged
    await asyncio.sleep(0.3)
    assert runtime.engine.supervisor.flying
    runtime.stop()
    await asyncio.wait_for(running, 10.0)
    assert autopilot.mode == 10
    flying.cancel()


@pytest.mark.wire
async def test_a_name_that_is_not_known_and_a_host_that_refuses_do_not_keep_it_from_flying() -> None:
    near, far = memory_pair()
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        refusing = open_link(f"tcpout:127.0.0.1:{nobody.getsockname()[1]}")
        unknown = open_link("udpout:no-such-host.invalid:14550")
        runtime, autopilot = Runtime(new_engine(), [refusing, unknown, near]), Autopilot(far)
        flying = asyncio.create_task(autopilot.run())
        running = asyncio.create_task(runtime.run())
        await until(runtime, State.OUTER, State.INNER)
        runtime.stop()
        await asyncio.wait_for(running, 10.0)
    assert autopilot.mode == 10
    flying.cancel()


async def test_the_service_manager_hears_of_start_life_and_end(tmp_path: Path) -> None:
    address = tmp_path / "notify"
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    manager.bind(str(address))
    manager.setblocking(False)
    near, far = memory_pair()
    watchdog = Watchdog({"NOTIFY_SOCKET": str(address), "WATCHDOG_USEC": "400000"})
    runtime, autopilot = Runtime(new_engine(), [near], watchdog=watchdog), Autopilot(far)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    loop = asyncio.get_running_loop()
    async with asyncio.timeout(10.0):
        heard = [await loop.sock_recv(manager, 100) for _ in range(4)]
        runtime.stop()
        await running
        while heard[-1] != b"STOPPING=1":
            heard.append(await loop.sock_recv(manager, 100))
    assert heard[:4] == [b"READY=1", b"WATCHDOG=1", b"WATCHDOG=1", b"WATCHDOG=1"]
    assert heard.count(b"READY=1") == heard.count(b"STOPPING=1") == 1
    manager.close()
    flying.cancel()


class FailingRecorder(Recorder):
    """Records until it is told to fail."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, 0.0)
        self.fail = asyncio.Event()

    async def run(self) -> None:
        await self.fail.wait()
        raise OSError("the disk is gone")


async def test_whatever_fails_beside_the_engine_gives_the_aircraft_back(tmp_path: Path) -> None:
    near, far = memory_pair()
    recorder = FailingRecorder(tmp_path)
    runtime, autopilot = Runtime(new_engine(), [near], recorder=recorder), Autopilot(far)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    await until(runtime, State.OUTER, State.INNER)
    recorder.fail.set()
    with pytest.raises(OSError, match="the disk is gone"):
        await asyncio.wait_for(running, 10.0)
    assert autopilot.mode == 10
    flying.cancel()


class FullDisk(Recorder):
    """Records until the disk is full."""

    full = False

    @property
    def problem(self) -> str | None:
        return "/media/card/companion.tlog: No space left on device" if self.full else None


async def test_a_full_disk_is_told_to_the_operator_once_and_flying_goes_on(tmp_path: Path) -> None:
    near, far = memory_pair()
    autopilot, recorder = Autopilot(far), FullDisk(tmp_path, 0.0)
    runtime = Runtime(Engine(), [near], recorder=recorder)
    told: list[str] = []
    hear = autopilot.hear

    def listen(frames: list[Frame], link: object) -> None:
        for frame in frames:
            message = decode(frame)
            if message is not None and message.get_type() == "STATUSTEXT":
                told.append(message.text)
        hear(frames, link)

    autopilot.hear = listen  # type: ignore[method-assign]
    flying, running = asyncio.create_task(autopilot.run()), asyncio.create_task(runtime.run())
    await until(runtime, State.OUTER, State.INNER)
    recorder.full = True
    await asyncio.sleep(1.0)
    assert runtime.engine.supervisor.flying
    assert [text for text in told if "recorded" in text] == ["Not recorded: No space left on device"]
    runtime.stop()
    await running
    flying.cancel()
    await asyncio.gather(flying, return_exceptions=True)
