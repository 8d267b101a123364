"""The mission protocol as ArduPilot speaks it: upload, download, clear, set current."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.events import INFO, WARNING, Text
from sim.vehicle.flight import Flight
from sim.vehicle.mission import GLOBAL_FRAMES, SUPPORTED, MissionItem, is_sane
from sim.vehicle.parameters import Parameter

Address = tuple[int, int]
Send = Callable[[int, Message], None]

_MISSION, _ALL_TYPES = 0, 255
_MOST_ITEMS = 700
_REPEAT_S = 1.0
_TIMEOUT_S = 8.0
_INTEGER_FRAMES = {5: 0, 6: 3, 11: 10}  # ArduPilot gives frames back in their older form


@dataclass(slots=True)
class _Upload:
    partner: Address
    channel: int
    count: int
    heard_s: float
    asked_s: float
    items: list[MissionItem] = field(default_factory=list)


class MissionProtocol:
    """Talks about one flight's mission; one upload at a time."""

    def __init__(self, flight: Flight, send: Send, told: Callable[[Parameter], None]) -> None:
        """`send(channel, message)` answers; `told(parameter)` announces a parameter that changed."""
        self._flight = flight
        self._send = send
        self._told = told
        self._upload: _Upload | None = None

    def receive(self, message: Message, sender: Address, channel: int, now_s: float) -> bool:
        """Handle a mission message; False when it is none."""
        kind = message.get_type()
        mission_type = getattr(message, "mission_type", _MISSION)
        if kind == "MISSION_COUNT":
            self._begin(message.count, mission_type, sender, channel, now_s)
        elif kind in ("MISSION_ITEM_INT", "MISSION_ITEM"):
            self._take(message, sender, channel, now_s)
        elif kind == "MISSION_REQUEST_LIST":
            self._tell_count(mission_type, sender, channel)
        elif kind in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            self._tell_item(message, mission_type, sender, channel)
        elif kind == "MISSION_CLEAR_ALL":
            self._clear(mission_type, sender, channel)
        elif kind == "MISSION_SET_CURRENT":
            self._flight.select_item(message.seq)
        elif kind == "MISSION_ACK":
            pass  # the end of a download
        else:
            return False
        return True

    def step(self, now_s: float) -> None:
        """Ask again for an item that did not come; give up after a while."""
        upload = self._upload
        if upload is None:
            return
        if now_s - upload.heard_s > _TIMEOUT_S:
            self._upload = None
            self._ack(mavlink.MAV_MISSION_OPERATION_CANCELLED, _MISSION, upload.partner, upload.channel)
            self._flight.events.append(Text(WARNING, "Mission upload timeout"))
        elif now_s - upload.asked_s > _REPEAT_S:
            self._ask(upload, now_s)

    def _begin(self, count: int, mission_type: int, sender: Address, channel: int, now_s: float) -> None:
        if mission_type != _MISSION:  # no fence, no rally points: only an empty list can be taken
            accepted = mavlink.MAV_MISSION_ACCEPTED if count == 0 else mavlink.MAV_MISSION_UNSUPPORTED
            self._ack(accepted, mission_type, sender, channel)
        elif self._upload is not None and self._upload.partner != sender:
            self._ack(mavlink.MAV_MISSION_DENIED, mission_type, sender, channel)
        elif count > _MOST_ITEMS:
            self._ack(mavlink.MAV_MISSION_NO_SPACE, mission_type, sender, channel)
        elif count == 0:
            self._clear(mission_type, sender, channel)
        else:
            self._upload = _Upload(sender, channel, count, now_s, now_s)
            self._ask(self._upload, now_s)

    def _ask(self, upload: _Upload, now_s: float) -> None:
        upload.asked_s = now_s
        # The real one asks with MISSION_REQUEST and takes either kind of item.
        request = mavlink.MAVLink_mission_request_message(
            *upload.partner, seq=len(upload.items), mission_type=_MISSION
        )
        self._send(upload.channel, request)

    def _take(self, message: Message, sender: Address, channel: int, now_s: float) -> None:
        upload = self._upload
        if upload is None or upload.partner != sender:
            return
        if message.seq != len(upload.items):
            # An item twice is the answer to a question asked twice.
            if message.seq > len(upload.items):
                self._ack(mavlink.MAV_MISSION_INVALID_SEQUENCE, _MISSION, sender, channel)
            return
        item = _item_from(message)
        if item is None or not is_sane(item):
            self._refuse(mavlink.MAV_MISSION_INVALID, sender, channel)
        elif item.command not in SUPPORTED:
            self._refuse(mavlink.MAV_MISSION_UNSUPPORTED, sender, channel)
        elif item.frame not in GLOBAL_FRAMES | {2}:  # MAV_FRAME_MISSION: an item without a place
            self._refuse(mavlink.MAV_MISSION_UNSUPPORTED_FRAME, sender, channel)
        else:
            upload.heard_s = now_s
            upload.items.append(item)
            if len(upload.items) < upload.count:
                self._ask(upload, now_s)
            else:
                self._finish(upload)

    def _refuse(self, why: int, sender: Address, channel: int) -> None:
        self._upload = None
        self._ack(why, _MISSION, sender, channel)

    def _finish(self, upload: _Upload) -> None:
        self._upload = None
        self._flight.load_mission(upload.items)
        self._ack(mavlink.MAV_MISSION_ACCEPTED, _MISSION, upload.partner, upload.channel)
        self._told(self._flight.parameters.record("MIS_TOTAL", len(upload.items)))
        self._flight.events.append(Text(INFO, "Flight plan received"))

    def _clear(self, mission_type: int, sender: Address, channel: int) -> None:
        if mission_type in (_MISSION, _ALL_TYPES):
            self._upload = None
            self._flight.load_mission([])
            self._told(self._flight.parameters.record("MIS_TOTAL", 0))
        self._ack(mavlink.MAV_MISSION_ACCEPTED, mission_type, sender, channel)

    def _tell_count(self, mission_type: int, sender: Address, channel: int) -> None:
        count = len(self._flight.mission.items) if mission_type == _MISSION else 0
        self._send(
            channel, mavlink.MAVLink_mission_count_message(*sender, count=count, mission_type=mission_type)
        )

    def _tell_item(self, message: Message, mission_type: int, sender: Address, channel: int) -> None:
        item = self._flight.mission.item_at(message.seq) if mission_type == _MISSION else None
        if item is None:
            self._ack(mavlink.MAV_MISSION_INVALID_SEQUENCE, mission_type, sender, channel)
            return
        place: tuple[float, float] = (item.lat_e7, item.lon_e7)
        build = mavlink.MAVLink_mission_item_int_message
        if message.get_type() == "MISSION_REQUEST":
            place = (item.lat_e7 / 1e7, item.lon_e7 / 1e7)
            build = mavlink.MAVLink_mission_item_message
        answer = build(
            *sender,
            seq=message.seq,
            frame=item.frame,
            command=item.command,
            current=int(message.seq == self._flight.mission.current),
            autocontinue=item.autocontinue,
            param1=item.params[0],
            param2=item.params[1],
            param3=item.params[2],
            param4=item.params[3],
            x=place[0],
            y=place[1],
            z=item.altitude_m,
        )
        self._send(channel, answer)

    def _ack(self, result: int, mission_type: int, sender: Address, channel: int) -> None:
        self._send(
            channel, mavlink.MAVLink_mission_ack_message(*sender, type=result, mission_type=mission_type)
        )


def _item_from(message: Message) -> MissionItem | None:
    """The item in a MISSION_ITEM_INT or MISSION_ITEM; None when its place is no number."""
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        if not (math.isfinite(x) and math.isfinite(y)):
            return None
        x, y = round(x * 1e7), round(y * 1e7)
    # "Not given" is kept as 0, as in ArduPilot's storage.
    first, second, third, fourth = (
        0.0 if math.isnan(p) else p for p in (message.param1, message.param2, message.param3, message.param4)
    )
    params = (first, second, third, fourth)
    frame = _INTEGER_FRAMES.get(message.frame, message.frame)
    return MissionItem(message.command, params, x, y, message.z, frame, message.autocontinue)
