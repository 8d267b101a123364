"""The hub passes messages on as a MAVLink router does."""

from pathlib import Path

from companion.links import memory_pair
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import Frame, FrameSplitter
from companion.mavlink.tlog import read_tlog
from sim.flight_test.hub import Hub

VEHICLE, STATION, COMPANION = (1, 1), (255, 190), (1, 196)


class Ends:
    """A hub with three ends; what arrives at each is collected."""

    def __init__(self, tlog: Path | None = None) -> None:
        self.seen: list[int] = []
        self.encoders = {name: Encoder() for name in ("vehicle", "station", "companion")}
        pairs = {name: memory_pair() for name in self.encoders}
        self.far = {name: far for name, (_, far) in pairs.items()}
        self.near = {name: near for name, (near, _) in pairs.items()}
        self.hub = Hub(self.near, self._observe, tlog)
        self.arrived: dict[str, list[int]] = {name: [] for name in self.encoders}

    def _observe(self, frame: Frame) -> None:
        self.seen.append(frame.message_id)

    def send(self, end: str, message: Message, sender: tuple[int, int]) -> None:
        raw = self.encoders[end].encode(message, *sender)
        sent_before = {name: link.counters.sent_frames for name, link in self.near.items()}
        self.hub._forward(end, FrameSplitter().feed_datagram(raw), self.far[end])
        for name, link in self.near.items():
            if link.counters.sent_frames > sent_before[name]:
                self.arrived[name].append(message.get_msgId())


def heartbeat() -> Message:
    return mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)


def command(component: int) -> Message:
    set_mode = mavlink.MAV_CMD_DO_SET_MODE
    return mavlink.MAVLink_command_long_message(1, component, set_mode, 0, 1, 2, 0, 0, 0, 0, 0)


def all_heard(ends: Ends) -> None:
    ends.send("vehicle", heartbeat(), VEHICLE)
    ends.send("companion", heartbeat(), COMPANION)
    ends.send("station", heartbeat(), STATION)
    for name in ends.arrived:
        ends.arrived[name].clear()


def test_what_is_for_all_goes_to_all_others() -> None:
    ends = Ends()
    ends.send("vehicle", heartbeat(), VEHICLE)
    assert ends.arrived == {"vehicle": [], "station": [0], "companion": [0]}
    assert ends.seen == [0]


def test_a_command_goes_only_to_its_target() -> None:
    # ArduPilot takes a command for a component that it cannot reach as its own: a role would become a mode.
    ends = Ends()
    all_heard(ends)
    ends.send("station", command(196), STATION)
    assert ends.arrived == {"vehicle": [], "station": [], "companion": [76]}
    ends.send("companion", command(1), COMPANION)
    assert ends.arrived["vehicle"] == [76]
    assert ends.arrived["station"] == []


def test_a_command_for_someone_unknown_goes_to_all() -> None:
    ends = Ends()
    all_heard(ends)
    ends.send("station", command(77), STATION)
    assert ends.arrived == {"vehicle": [76], "station": [], "companion": [76]}


def test_everything_is_recorded_once(tmp_path: Path) -> None:
    ends = Ends(tmp_path / "flight.tlog")
    all_heard(ends)
    ends.hub.send(heartbeat(), (1, 156))
    ends.hub.close()
    senders = [(frame.system_id, frame.component_id) for _, frame in read_tlog(tmp_path / "flight.tlog")]
    assert senders == [VEHICLE, COMPANION, STATION, (1, 156)]
