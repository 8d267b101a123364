"""A small MAVLink router between the vehicle, the ground station and Companion, that records everything."""

import asyncio
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from companion.links import Link, Reconnect, open_all
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import Frame, decode
from companion.mavlink.tlog import TlogWriter

# Messages with a target: they go to the end where it was heard. ArduPilot takes what is addressed to another
# component for its own when it cannot pass it on.
_TARGETED = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_COMMAND_INT,
        mavlink.MAVLINK_MSG_ID_PARAM_SET,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_COUNT,
        mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_ACK,
    }
)

Observe = Callable[[Frame], None]


class Hub:
    """Passes frames from one end on to the others, as mavlink-router does.

    What is addressed goes to the end where its target was heard.

    `observe` sees each frame before it is passed on. The test's own messages are sent with `send`.
    """

    def __init__(self, ends: Mapping[str, Link], observe: Observe, tlog: Path | None) -> None:
        self._ends = dict(ends)
        self._observe = observe
        self._tlog = None if tlog is None else TlogWriter(tlog)
        self._encoders: dict[tuple[int, int], Encoder] = {}
        self._heard: dict[tuple[int, int], str] = {}  # the end of each component

    async def open(self) -> None:
        """Open all ends; `LinkError` when one cannot be opened."""
        await open_all(list(self._ends.values()))

    async def run(self) -> None:
        """Pass frames on until `close`; an end that is lost is opened again."""
        try:
            async with asyncio.TaskGroup() as tasks:
                for name, link in self._ends.items():
                    tasks.create_task(Reconnect(link).run(partial(self._forward, name)), name=f"hub {name}")
        finally:
            self.close()

    def close(self) -> None:
        """Stop; a second call does nothing."""
        for link in self._ends.values():
            link.close()
        if self._tlog is not None:
            self._tlog.close()
            self._tlog = None

    def send(self, message: Message, sender: tuple[int, int]) -> None:
        """Send a message of a component that is a part of the test, to all ends."""
        encoder = self._encoders.setdefault(sender, Encoder())
        raw = encoder.encode(message, *sender)
        self._record(raw)
        for link in self._ends.values():
            link.send(raw)

    def _forward(self, name: str, frames: list[Frame], _link: Link) -> None:
        for frame in frames:
            self._record(frame.raw)
            self._heard[frame.system_id, frame.component_id] = name
            self._observe(frame)
            only = self._target_end(frame)
            for other, link in self._ends.items():
                if other != name and only in (None, other):
                    link.send(frame.raw)

    def _target_end(self, frame: Frame) -> str | None:
        """The end where the target of a frame was heard; `None`: unknown, or it is for all."""
        if frame.message_id not in _TARGETED:
            return None
        message = decode(frame)
        return None if message is None else self._heard.get((message.target_system, message.target_component))

    def _record(self, raw: bytes) -> None:
        if self._tlog is not None:
            self._tlog.write(time.time_ns() // 1000, raw)
