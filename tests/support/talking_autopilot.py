"""An autopilot in a few lines, at the other end of a link in memory."""

import asyncio

from companion.links import MemoryLink
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import Frame, decode


def traffic(tick: int) -> object:
    """An aircraft two kilometres ahead, coming at 66 m/s."""
    lat = -349_800_000 - tick * 300
    flags = 0b1000_1111
    return mavlink.MAVLink_adsb_vehicle_message(
        0xA00001, lat, 1_490_000_000, 1, 884_000 + tick, 18_000, 6_000, 0, b"T", 1, 0, flags, 1200
    )


class Autopilot:
    """Says that it flies north in AUTO with traffic ahead, and takes every mode it is asked for."""

    def __init__(self, link: MemoryLink, *, obeys: bool = True, sees_traffic: bool = True) -> None:
        self.link = link
        self.mode = 10
        self.modes_asked: list[int] = []
        self._obeys = obeys
        self._sees_traffic = sees_traffic
        self._encoder = Encoder()

    def hear(self, frames: list[Frame], _link: object) -> None:
        for frame in frames:
            message = decode(frame)
            if message is not None and message.get_type() == "MISSION_REQUEST_LIST":
                count = mavlink.MAVLink_mission_count_message(1, 196, 0, message.mission_type)
                self.say(count)
            if getattr(message, "command", None) == 176:
                self.modes_asked.append(int(message.param2))
                if self._obeys or self.mode == 10:
                    self.mode = int(message.param2)

    def say(self, message: object) -> None:
        self.link.send(self._encoder.encode(message, 1, 1))

    async def run(self) -> None:
        hearing = asyncio.create_task(self.link.run(self.hear))
        try:
            for tick in range(10_000):
                self.say(mavlink.MAVLink_heartbeat_message(1, 3, 217, self.mode, 4, 3))
                self.say(
                    mavlink.MAVLink_global_position_int_message(
                        tick * 50, -350_000_000, 1_490_000_000, 884_000, 300_000, 2200, 0, 0, 0
                    )
                )
                if self._sees_traffic and tick % 10 == 0:
                    self.say(traffic(tick))
                await asyncio.sleep(0.05)
        finally:
            self.link.close()
            await hearing
