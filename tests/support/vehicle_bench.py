"""A fake vehicle under test, and the messages received from it."""

from collections.abc import Sequence

from companion.mavlink.dialect import Message, mavlink
from sim.vehicle import FakeVehicle

GCS, COMPANION = (255, 190), (1, 191)
ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED, INT_ONLY = 0, 1, 2, 3, 4, 8
SET_MODE, ARM, SET_INTERVAL, REQUEST_MESSAGE, REPOSITION = 176, 400, 511, 512, 192
CHANGE_SPEED, CHANGE_ALTITUDE, CHANGE_HEADING = 43000, 43001, 43002


class Bench:
    """A vehicle and the messages received from it, by channel."""

    def __init__(self, vehicle: FakeVehicle, channels: Sequence[int] = (0,), rate_hz: float = 0.0) -> None:
        self.vehicle = vehicle
        self.received: list[tuple[int, Message]] = []
        for channel in channels:
            vehicle.add_channel(channel, stream_rate_hz=rate_hz)

    def fly(self, seconds: float) -> None:
        self.received += self.vehicle.step(self.vehicle.time_s + seconds)

    def send(self, message: Message, sender: tuple[int, int] = GCS, channel: int = 0) -> None:
        message.get_header().srcSystem, message.get_header().srcComponent = sender
        self.vehicle.receive(message, self.vehicle.time_s, channel)
        self.received += self.vehicle.step(self.vehicle.time_s)

    def messages(self, kind: str, channel: int = 0) -> list[Message]:
        return [m for c, m in self.received if c == channel and m.get_type() == kind]

    def texts(self) -> list[str]:
        return [m.text for m in self.messages("STATUSTEXT")]

    def by_long(
        self, command: int, *params: float, target: tuple[int, int] = (1, 1), channel: int = 0
    ) -> int:
        values = (*params, *(0.0,) * (7 - len(params)))
        message = mavlink.MAVLink_command_long_message(*target, command, 0, *values)
        return self._result(message, command, channel)

    def by_int(
        self, command: int, *params: float, frame: int = 0, place: tuple[int, int, float] = (0, 0, 0.0)
    ) -> int:
        values = (*params, *(0.0,) * (4 - len(params)))
        return self._result(
            mavlink.MAVLink_command_int_message(1, 1, frame, command, 0, 0, *values, *place), command
        )

    def _result(self, message: Message, command: int, channel: int = 0) -> int:
        before = len(self.messages("COMMAND_ACK", channel))
        self.send(message, channel=channel)
        answers = self.messages("COMMAND_ACK", channel)[before:]
        if not answers:
            return -1
        (answer,) = answers
        assert answer.command == command
        assert (answer.target_system, answer.target_component) == GCS
        return int(answer.result)

    def set_parameter(self, name: bytes, value: float, kind: int = 9) -> None:
        self.send(mavlink.MAVLink_param_set_message(1, 1, name, value, kind))
