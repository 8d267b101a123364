"""Receivers that do not speak MAVLink: from their bytes to what is flown, recorded and replayed."""

import asyncio
import contextlib
import json
import socket
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from companion.address import parse_receiver_address
from companion.config import Config
from companion.control.state_machine import State
from companion.engine import Engine, EngineConfig, EngineParams
from companion.links import MemoryLink, ReceiverLink, memory_pair
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import Frame, decode, make_frame
from companion.mavlink.tlog import read_tlog
from companion.preflight import run_preflight
from companion.recording.pieces import NOTES, TUNNEL, PieceWriter
from companion.recording.recorder import Recorder
from companion.replay import RecordedReceivers, replay
from companion.runtime import Runtime
from companion.sources.receiver import INTERNAL_ERROR, Piece
from companion.summary import summary
from companion.web.replay_server import ReplayServer
from companion.web.settings import Settings
from sim.clock import ScaledClock
from tests.support.line_decoder import line_formats, traffic_line
from tests.support.talking_autopilot import Autopilot, traffic
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire

STATUSTEXT = mavlink.MAVLINK_MSG_ID_STATUSTEXT


@pytest.fixture(autouse=True)
def _lines() -> Iterator[None]:
    with line_formats():
        yield


def new_engine() -> Engine:
    return Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1)))


def head_on(step: int, icao: int = 0xA00001) -> bytes:
    """An aircraft ahead of `Autopilot`, coming at 60 m/s; five steps a second."""
    return traffic_line(icao, -34.985 - step * 12.0 / 111_195.0, 149.0)


class Listening(Autopilot):
    """Remembers what it hears."""

    def __init__(self, link: MemoryLink) -> None:
        super().__init__(link, sees_traffic=False)
        self.heard: list[Frame] = []

    def hear(self, frames: list[Frame], link: object) -> None:
        self.heard += frames
        super().hear(frames, link)


@dataclass
class Flight:
    runtime: Runtime
    receiver: ReceiverLink
    autopilot: Listening
    station: socket.socket
    stopped_us: int = 0

    def say(self, data: bytes) -> None:
        port: int = self.receiver.link.local_port  # type: ignore[attr-defined]
        self.station.sendto(data, ("127.0.0.1", port))

    async def meet(self) -> None:
        """Report an intruder until we avoid it."""
        async with asyncio.timeout(15.0):
            step = 0
            while not self.runtime.engine.supervisor.flying:
                self.say(head_on(step))
                step += 1
                await asyncio.sleep(0.2)


@contextlib.asynccontextmanager
async def flight(folder: Path | None = None) -> AsyncIterator[Flight]:
    """A service with an autopilot in memory and a receiver by UDP; at the end it gives the aircraft back."""
    near, far = memory_pair()
    text = "gdl90:udpin:127.0.0.1:0"
    receiver = ReceiverLink(text, parse_receiver_address(text))
    recorder = None if folder is None else Recorder(folder, 0.0)
    clock = ScaledClock(1.0, start_s=1.75e9, monotonic_s=asyncio.get_running_loop().time)
    runtime = Runtime(new_engine(), [near], receivers=[receiver], recorder=recorder, clock=clock)
    autopilot = Listening(far)
    flying = asyncio.create_task(autopilot.run())
    running = asyncio.create_task(runtime.run())
    try:
        async with asyncio.timeout(10.0):
            while runtime.engine.supervisor.state is not State.MONITOR:  # noqa: ASYNC110 - no event is set
                await asyncio.sleep(0.02)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
            flown = Flight(runtime, receiver, autopilot, station)
            yield flown
        flown.stopped_us = runtime.clock.now_us()
        runtime.stop()
        await asyncio.wait_for(running, 15.0)
        assert autopilot.mode == 10
    finally:
        for task in (flying, running):
            task.cancel()
        await asyncio.gather(flying, running, return_exceptions=True)


def log_in(folder: Path) -> Path:
    (log,) = folder.glob("*.tlog")
    return log


def decisions_in(folder: Path) -> list[str]:
    (lines,) = folder.glob("*.jsonl")
    return lines.read_text().splitlines()


def tunnels_in(folder: Path) -> list[Frame]:
    """What is recorded of receivers, without the notes about links."""
    frames = [frame for _, frame in read_tlog(log_in(folder)) if frame.message_id == TUNNEL]
    return [frame for frame in frames if NOTES.encode() + b"{" not in frame.raw]


@in_virtual_time
async def test_traffic_of_a_receiver_is_avoided_and_replayed_alike(tmp_path: Path) -> None:
    async with flight(tmp_path) as flown:
        await flown.meet()
        await asyncio.sleep(1.0)
    replayed: list[str] = []
    result = replay(log_in(tmp_path), new_engine(), on_decision=replayed.append)
    recorded = decisions_in(tmp_path)
    # A replay knows nothing of the request to stop.
    before = [line for line in recorded if json.loads(line)["time_us"] < flown.stopped_us]
    assert len(before) > 10
    assert any(json.loads(line)["flying"] for line in before)
    assert replayed[: len(before)] == before
    (receiver,) = result.receivers
    assert receiver.counters == flown.receiver.receiver.counters
    assert result.lost_pieces == 0
    report = result.report()
    assert report["receivers"] == [
        {"address": "gdl90:udpin:127.0.0.1:0", "messages": receiver.counters.messages,
         "reports": receiver.counters.reports, "bad": {}}
    ]  # fmt: skip
    assert len(tunnels_in(tmp_path)) == flown.receiver.receiver.pieces
    (aircraft,) = report["aircraft"]  # type: ignore[misc]
    assert (aircraft["track"], aircraft["sources"]) == ("A00001", ["gdl90:udpin:127.0.0.1:0"])
    assert 1 <= aircraft["reports"] <= receiver.counters.reports
    state = shown_in_a_replay(log_in(tmp_path))
    (seen,) = state["receivers"]
    assert (seen["address"], seen["aircraft"]) == ("gdl90:udpin:127.0.0.1:0", 1)
    assert seen["title"]
    assert state["tracks"][0]["sources"] == ["gdl90:udpin:127.0.0.1:0"]


def shown_in_a_replay(log: Path) -> dict[str, Any]:
    """The last state of the page of a replay."""
    engine, receivers = new_engine(), RecordedReceivers()
    server = ReplayServer(engine, Settings(port=0), lambda: receivers.by_address.values())
    replay(log, engine, on_moment=server.take, receivers=receivers)
    server.close()
    state: dict[str, Any] = json.loads(server.source.newest() or "")
    return state


@in_virtual_time
async def test_nothing_recorded_of_a_receiver_is_sent(tmp_path: Path) -> None:
    async with flight(tmp_path) as flown:
        await flown.meet()
    assert len(flown.autopilot.heard) > 20
    assert TUNNEL not in {frame.message_id for frame in flown.autopilot.heard}
    assert tunnels_in(tmp_path)


def test_a_damaged_record_is_replayed_without_its_damaged_pieces(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, 0.0)
    text = "readsb:file:/a"
    document = b"".join(traffic_line(0xA00000 + number, 48.0, 11.0 + number / 7.0) for number in range(100))
    for second in range(3):
        recorder.heard(1_000_000 * second, Piece(text, document), new_engine().sender)
    recorder.close()
    data = bytearray(recorder.tlog_path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    recorder.tlog_path.write_bytes(data)
    result = replay(recorder.tlog_path, new_engine())
    assert result.lost_pieces == 1
    assert result.receivers[0].counters.reports == 200


def test_a_piece_of_a_format_that_is_not_known_is_counted(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, 0.0)
    for address in ("asterix:udpin:0.0.0.0:8600", "gdl90", "gdl90:udpin:0.0.0.0:4000"):
        recorder.heard(0, Piece(address, b"H\n"), new_engine().sender)
    recorder.close()
    result = replay(recorder.tlog_path, new_engine())
    assert result.lost_pieces == 2
    assert [one.counters.messages for one in result.receivers] == [1]


@in_virtual_time
async def test_a_frame_that_imitates_the_record_is_not_recorded(tmp_path: Path) -> None:
    async with flight(tmp_path) as flown:
        # As another component with our address would send it.
        (raw,) = PieceWriter().frames(Piece("gdl90:udpin:127.0.0.1:0", head_on(0)), new_engine().sender)
        flown.autopilot.link.send(raw)
        flown.autopilot.link.send(make_frame(TUNNEL, b"\1\0\0\0\1a", 0, 1, 1))
        async with asyncio.timeout(5.0):
            while not flown.runtime._receiving.imitated:  # noqa: ASYNC110 - no event is set
                await asyncio.sleep(0.02)
    assert len(tunnels_in(tmp_path)) == 1, "the other one is not ours"
    assert replay(log_in(tmp_path), new_engine()).receivers == []


@in_virtual_time
async def test_a_threat_is_answered_at_once() -> None:
    async with flight() as flown:
        await flown.meet()
        before = len(flown.runtime.latencies_s)
        await asyncio.sleep(0.3)
        for step in range(50, 60):
            flown.say(head_on(step))
            await asyncio.sleep(0.15)
        assert len(flown.runtime.latencies_s) > before
        assert sorted(flown.runtime.latencies_s)[len(flown.runtime.latencies_s) // 2] < 0.05


async def test_a_flood_leaves_ticks_on_time_and_drops_are_counted() -> None:
    async with flight() as flown:
        ticks = flown.runtime._stepper.ticks
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        datagram = b"".join(traffic_line(0xB00000 + n, -34.0 + n * 1e-3, 149.5) for n in range(1000))
        while loop.time() - began_s < 1.0:
            flown.receiver.link.arrived("station", datagram)  # type: ignore[attr-defined]
            await asyncio.sleep(0.01)
        lasted_s = loop.time() - began_s
        assert flown.receiver.receiver.counters.messages > 100
        assert flown.receiver.link.counters.dropped > 0
        # On a busy machine some are skipped; without a bound there would be none.
        assert flown.runtime._stepper.ticks - ticks >= int(lasted_s * 10) // 2


@in_virtual_time
async def test_a_decoder_with_a_bug_does_not_end_the_flight() -> None:
    async with flight() as flown:
        flown.say(b"!\n")
        await flown.meet()
        assert flown.receiver.receiver.counters.bad[INTERNAL_ERROR] == 1


@in_virtual_time
async def test_health_and_what_the_operator_is_told() -> None:
    async with flight() as flown:
        flown.say(head_on(0) + b"S,no GPS fix\njunk\n")
        async with asyncio.timeout(5.0):
            while not any("no GPS fix" in one.text for one in flown.runtime.engine.conditions):  # noqa: ASYNC110
                await asyncio.sleep(0.02)
        (counts,) = flown.runtime._health().receivers
        assert counts.address == "gdl90:udpin:127.0.0.1:0"
        assert (counts.messages, counts.reports, counts.aircraft, counts.dropped) == (2, 1, 1, 0)
        assert counts.bad == (("unknown line", 1),)
        assert counts.problem == "no GPS fix"
        assert counts.silent_s < 5.0
        _, line, _ = summary(
            flown.runtime.links, [flown.receiver], flown.runtime._health(), flown.runtime.engine
        )
        assert line == "gdl90:udpin:127.0.0.1:0: 2 messages, 1 reports, 1 unknown line, 0 pieces dropped"


@in_virtual_time
async def test_check_lists_each_receiver_and_what_it_lacks() -> None:
    texts = ("gdl90:udpin:127.0.0.1:0", "gdl90:tcpin:127.0.0.1:0", "readsb:file:/nowhere/a.json")
    receivers = [ReceiverLink(text, parse_receiver_address(text)) for text in texts]
    near, far = memory_pair()
    config, loop = Config(("udpin:127.0.0.1:0", *texts)), asyncio.get_running_loop()
    clock = ScaledClock(1.0, start_s=1.75e9, monotonic_s=loop.time)
    checking = asyncio.create_task(run_preflight(config, [near], 12.0, clock, receivers=receivers))
    await asyncio.sleep(1.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        port: int = receivers[0].link.local_port  # type: ignore[attr-defined]
        for _ in range(12):
            for icao in (0xA00001, 0xA00002):
                station.sendto(head_on(0, icao), ("127.0.0.1", port))
            far.send(Encoder().encode(traffic(0), 1, 156))
            await asyncio.sleep(0.9)
    found = {finding.topic: finding for finding in (await checking).findings}
    far.close()
    udp, tcp, file = (found[f"receiver {text}"] for text in texts)
    assert udp.text == "GDL 90, 2.0 messages/s, 2.0 reports/s, 2 aircraft; lacks everything but lines"
    assert udp.good
    assert "GDL 90, 0.0 messages/s, 0.0 reports/s, 0 aircraft; silent for 10 s; lacks" in tcp.text
    assert "readsb, 0.0 messages/s" in file.text
    assert "No such file or directory" in file.text
    assert not tcp.good
    assert not file.good
    by_mavlink = found["receiver ADS-B by MAVLink 1/156"].text
    assert by_mavlink == "1.0 reports/s; lacks accuracy; ages are whole seconds"


@in_virtual_time
async def test_silence_is_told_repeated_and_its_end_told() -> None:
    async with flight() as flown:
        await asyncio.sleep(50.0)
        flown.say(b"H\n")
        await asyncio.sleep(5.0)
    messages = [decode(frame) for frame in flown.autopilot.heard if frame.message_id == STATUSTEXT]
    texts = [message.text for message in messages if message is not None and "gdl90" in message.text]
    silent = "Avoidance: gdl90 receiver: silent for 10 s"
    assert texts == [silent, silent, "Avoidance: gdl90 receiver works again"]
