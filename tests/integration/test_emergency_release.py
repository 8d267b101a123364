"""The emergency release of the running service: what the pilot did just before the failure counts."""

import asyncio
from collections.abc import Callable

import pytest

from companion.control.state_machine import State
from companion.engine import Engine, EngineConfig, EngineParams
from companion.links import Link, memory_pair, open_link
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.facts import Sender
from companion.mavlink.framing import Frame, FrameSplitter, decode
from companion.mavlink.translate import frame_to_fact
from companion.recording.recorder import Recorder
from companion.runtime import Runtime
from companion.sources.receiver import Piece
from tests.support.faulty_flight import free_ports

AUTO, GUIDED, FBWA = 10, 15, 5
INTERVAL_S = 0.2


class Autopilot:
    """ArduPlane in AUTO with traffic ahead; it notes every mode that is asked for, and obeys in AUTO."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.mode = AUTO
        self.asked: list[int] = []
        self._encoder = Encoder()

    def hear(self, frames: list[Frame], _link: object) -> None:
        for frame in frames:
            message = decode(frame)
            if message is not None and message.get_type() == "MISSION_REQUEST_LIST":
                self.send(mavlink.MAVLink_mission_count_message(1, 196, 0, message.mission_type))
            if getattr(message, "command", None) == mavlink.MAV_CMD_DO_SET_MODE:
                assert message is not None
                self.asked.append(round(message.param2))
                if self.mode == AUTO:
                    self.mode = self.asked[-1]

    def send(self, *messages: Message) -> None:
        self.link.send(b"".join(self._encoder.encode(message, 1, 1) for message in messages))

    def heartbeat(self) -> Message:
        return mavlink.MAVLink_heartbeat_message(1, 3, 217, self.mode, 4, 3)

    async def run(self) -> None:
        hearing = asyncio.create_task(self.link.run(self.hear))
        try:
            for tick in range(10_000):
                if tick % 4 == 0:
                    self.send(self.heartbeat())
                position = -350_000_000, 1_490_000_000, 884_000, 300_000, 2200, 0, 0, 0
                self.send(mavlink.MAVLink_global_position_int_message(tick * 50, *position))
                if tick % 10 == 0:
                    north = -349_800_000 - tick * 300
                    self.send(
                        mavlink.MAVLink_adsb_vehicle_message(
                            0xA00001, north, 1_490_000_000, 1, 884_000, 18_000, 6_000, 0, b"T", 1, 0, 143, 0
                        )
                    )
                await asyncio.sleep(INTERVAL_S / 4)
        finally:
            self.link.close()
            await hearing


async def asked_after(
    prepare: Callable[[Runtime, Autopilot], None],
    recorder: Recorder | None = None,
    links: tuple[Link, Link] | None = None,
) -> list[int]:
    """The modes asked for after `prepare` has broken something in flight."""
    near, far = links or memory_pair()
    if links is not None:
        await far.open()
    engine = Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1)))
    runtime, autopilot = Runtime(engine, [near], recorder=recorder), Autopilot(far)
    flying, running = asyncio.create_task(autopilot.run()), asyncio.create_task(runtime.run())
    async with asyncio.timeout(10.0):
        while engine.supervisor.state not in (State.OUTER, State.INNER):  # noqa: ASYNC110 - sets no events
            await asyncio.sleep(0.02)
    autopilot.asked.clear()
    prepare(runtime, autopilot)
    with pytest.raises(ZeroDivisionError):
        await asyncio.wait_for(running, 10.0)
    flying.cancel()
    await asyncio.gather(flying, return_exceptions=True)
    assert autopilot.mode == FBWA
    return autopilot.asked


@pytest.mark.wire
async def test_a_heartbeat_that_waits_in_the_socket_is_heard_before_a_mode_is_asked_for() -> None:
    """A tick takes long and fails; the pilot's heartbeat arrived meanwhile, behind many other datagrams."""

    def prepare(runtime: Runtime, autopilot: Autopilot) -> None:
        def takes_long(_now_s: float) -> list[object]:
            for _ in range(50):
                autopilot.send(mavlink.MAVLink_vfr_hud_message(22.0, 22.0, 0, 50, 884.0, 0.0))
            autopilot.mode = FBWA
            autopilot.send(autopilot.heartbeat())
            raise ZeroDivisionError("a bug")

        runtime.engine.tick = takes_long  # type: ignore[method-assign,assignment]

    (port,) = free_ports(1)
    links = open_link(f"udpin:127.0.0.1:{port}"), open_link(f"udpout:127.0.0.1:{port}")
    assert await asked_after(prepare, links=links) == []


class FailingRecorder(Recorder):
    """Records until it fails on the heartbeat of a mode."""

    def __init__(self) -> None:
        pass

    @property
    def problem(self) -> str | None:
        return None

    def received(self, time_us: int, raw: bytes) -> None:  # noqa: ARG002
        (frame,) = FrameSplitter().feed_datagram(raw)
        message = decode(frame)
        if message is not None and message.get_type() == "HEARTBEAT" and message.custom_mode == FBWA:
            raise ZeroDivisionError("a bug")

    def heard(self, time_us: int, piece: Piece, us: Sender) -> None:
        pass

    def sent(self, time_us: int, raw: bytes) -> None:
        pass

    def decision(self, time_us: int, line: str) -> None:
        pass

    def state(self, time_us: int, line: str) -> None:
        pass

    def text(self, time_us: int, severity: int, text: str) -> None:
        pass

    async def run(self) -> None:
        await asyncio.Event().wait()

    def close(self) -> None:
        pass


async def test_the_heartbeat_on_which_the_recorder_fails_is_heard() -> None:
    def prepare(_runtime: Runtime, autopilot: Autopilot) -> None:
        autopilot.mode = FBWA

    assert await asked_after(prepare, FailingRecorder()) == []


async def test_a_frame_that_cannot_be_read_does_not_hide_the_heartbeat_behind_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def prepare(_runtime: Runtime, autopilot: Autopilot) -> None:
        def broken(frame: Frame, now_s: float) -> object:
            if frame.message_id == mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET:
                raise ZeroDivisionError("a bug")
            return frame_to_fact(frame, now_s)

        monkeypatch.setattr("companion.mavlink.intake.frame_to_fact", broken)
        junk = mavlink.MAVLink_attitude_target_message(0, 0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, 0.0)
        autopilot.mode = FBWA
        autopilot.send(junk, junk, autopilot.heartbeat())

    assert await asked_after(prepare) == []
