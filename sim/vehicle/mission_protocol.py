"""The mission protocol: upload, download and clear of the mission and the fence; set current."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from companion.mavlink.dialect import Message, mavlink
from sim.vehicle import fence
from sim.vehicle.mission import GLOBAL_FRAMES, SUPPORTED, MissionItem, is_sane
from sim.vehicle.mission_flight import MissionFlight
from sim.vehicle.outputs import WARNING, Text

Address = tuple[int, int]
Send = Callable[[int, Message], None]

MISSION, FENCE = 0, 1
_ALL_TYPES = 255
_STORED = frozenset({MISSION, FENCE})
_MOST_ITEMS = 700
_REPEAT_S = 1.0
_TIMEOUT_S = 8.0
_INTEGER_FRAMES = {5: 0, 6: 3, 11: 10}  # stored as their float equivalents
_REFUSALS = {
    "invalid": mavlink.MAV_MISSION_INVALID,
    "unsupported": mavlink.MAV_MISSION_UNSUPPORTED,
    "frame": mavlink.MAV_MISSION_UNSUPPORTED_FRAME,
}


@dataclass(slots=True)
class _Upload:
    kind: int
    partner: Address
    channel: int
    count: int
    heard_s: float
    asked_s: float
    items: list[MissionItem] = field(default_factory=list)


class MissionProtocol:
    """Serves one flight's mission and fence; one upload at a time."""

    def __init__(
        self, flight: MissionFlight, send: Send, loaded: Callable[[int], None], *, asks_for_int: bool
    ) -> None:
        """`send(channel, message)` answers; `loaded(mission type)` is called for each list that changed.

        `asks_for_int`: items are requested by MISSION_REQUEST_INT; both kinds of item are accepted.
        """
        self._flight = flight
        self._send = send
        self._loaded = loaded
        self._asks_for_int = asks_for_int
        self._upload: _Upload | None = None

    def receive(self, message: Message, sender: Address, channel: int, now_s: float) -> bool:
        """Handle a mission message; False for any other message."""
        kind = message.get_type()
        mission_type = getattr(message, "mission_type", MISSION)
        if kind == "MISSION_COUNT":
            self._begin(message.count, mission_type, sender, channel, now_s)
        elif kind in ("MISSION_ITEM_INT", "MISSION_ITEM"):
            self._receive_item(message, mission_type, sender, channel, now_s)
        elif kind == "MISSION_REQUEST_LIST":
            self._send_count(mission_type, sender, channel)
        elif kind in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            self._send_item(message, mission_type, sender, channel)
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
        """Repeat the request for an item that did not arrive; cancel the upload after a timeout."""
        upload = self._upload
        if upload is None:
            return
        if now_s - upload.heard_s > _TIMEOUT_S:
            self._refuse(upload, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            self._flight.events.append(Text(WARNING, "Mission upload timeout"))
        elif now_s - upload.asked_s > _REPEAT_S:
            self._ask(upload, now_s)

    def cancel(self) -> None:
        """Drop an upload in progress, as a reboot does."""
        self._upload = None

    def _begin(self, count: int, mission_type: int, sender: Address, channel: int, now_s: float) -> None:
        if mission_type not in _STORED:  # no rally points: only an empty list is accepted
            accepted = mavlink.MAV_MISSION_ACCEPTED if count == 0 else mavlink.MAV_MISSION_UNSUPPORTED
            self._ack(accepted, mission_type, sender, channel)
        elif self._upload is not None and self._upload.partner != sender:
            self._ack(mavlink.MAV_MISSION_DENIED, mission_type, sender, channel)
        elif count > _MOST_ITEMS:
            self._ack(mavlink.MAV_MISSION_NO_SPACE, mission_type, sender, channel)
        elif count == 0:
            self._clear(mission_type, sender, channel)
        else:
            self._upload = _Upload(mission_type, sender, channel, count, now_s, now_s)
            self._ask(self._upload, now_s)

    def _ask(self, upload: _Upload, now_s: float) -> None:
        upload.asked_s = now_s
        build = mavlink.MAVLink_mission_request_message
        if self._asks_for_int:
            build = mavlink.MAVLink_mission_request_int_message
        self._send(upload.channel, build(*upload.partner, seq=len(upload.items), mission_type=upload.kind))

    def _receive_item(
        self, message: Message, mission_type: int, sender: Address, channel: int, now_s: float
    ) -> None:
        upload = self._upload
        if upload is None or upload.partner != sender or upload.kind != mission_type:
            return
        if message.seq != len(upload.items):
            # A repeated request brings an item twice.
            if message.seq > len(upload.items):
                self._ack(mavlink.MAV_MISSION_INVALID_SEQUENCE, upload.kind, sender, channel)
            return
        item = item_from(message)
        if item is None:
            self._refuse(upload, mavlink.MAV_MISSION_INVALID)
            return
        why = _refusal(item, upload.kind)
        if why is not None:
            self._refuse(upload, why)
            return
        upload.heard_s = now_s
        upload.items.append(item)
        if len(upload.items) < upload.count:
            self._ask(upload, now_s)
        else:
            self._finish(upload)

    def _refuse(self, upload: _Upload, why: int) -> None:
        self._upload = None
        self._ack(why, upload.kind, upload.partner, upload.channel)

    def _finish(self, upload: _Upload) -> None:
        self._upload = None
        if upload.kind == MISSION:
            self._flight.load_mission(upload.items)
        elif not self._flight.fence.replace(upload.items):
            self._refuse(upload, mavlink.MAV_MISSION_INVALID)
            return
        self._ack(mavlink.MAV_MISSION_ACCEPTED, upload.kind, upload.partner, upload.channel)
        self._loaded(upload.kind)

    def _clear(self, mission_type: int, sender: Address, channel: int) -> None:
        if mission_type in (MISSION, _ALL_TYPES):
            self._flight.load_mission([])
            self._loaded(MISSION)
        if mission_type in (FENCE, _ALL_TYPES):
            self._flight.fence.replace([])
            self._loaded(FENCE)
        if self._upload is not None and mission_type in (self._upload.kind, _ALL_TYPES):
            self._upload = None
        self._ack(mavlink.MAV_MISSION_ACCEPTED, mission_type, sender, channel)

    def _stored(self, mission_type: int) -> Sequence[MissionItem]:
        if mission_type == MISSION:
            return self._flight.mission.items
        return self._flight.fence.items if mission_type == FENCE else ()

    def _send_count(self, mission_type: int, sender: Address, channel: int) -> None:
        count = len(self._stored(mission_type))
        self._send(
            channel, mavlink.MAVLink_mission_count_message(*sender, count=count, mission_type=mission_type)
        )

    def _send_item(self, message: Message, mission_type: int, sender: Address, channel: int) -> None:
        item = None
        if mission_type in _STORED:
            items = self._flight.mission if mission_type == MISSION else self._flight.fence
            item = items.item_at(message.seq)
        if item is None:
            self._ack(mavlink.MAV_MISSION_INVALID_SEQUENCE, mission_type, sender, channel)
            return
        current = mission_type == MISSION and message.seq == self._flight.mission.current
        as_int = message.get_type() == "MISSION_REQUEST_INT"
        self._send(channel, _item_message(item, sender, message.seq, mission_type, current, as_int))

    def _ack(self, result: int, mission_type: int, sender: Address, channel: int) -> None:
        self._send(
            channel, mavlink.MAVLink_mission_ack_message(*sender, type=result, mission_type=mission_type)
        )


def _refusal(item: MissionItem, mission_type: int) -> int | None:
    """The MAV_MISSION_RESULT for an item that is refused; None if it is accepted."""
    if mission_type == FENCE:
        why = fence.refusal(item)
        return None if why is None else _REFUSALS[why]
    if not is_sane(item):
        return int(mavlink.MAV_MISSION_INVALID)
    if item.command not in SUPPORTED:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    if item.frame not in GLOBAL_FRAMES | {2}:  # MAV_FRAME_MISSION: an item without a place
        return int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    return None


def _item_message(
    item: MissionItem, target: Address, sequence: int, mission_type: int, current: bool, as_int: bool
) -> Message:
    place: tuple[float, float] = (item.lat_e7, item.lon_e7)
    build = mavlink.MAVLink_mission_item_int_message
    if not as_int:
        place = (item.lat_e7 / 1e7, item.lon_e7 / 1e7)
        build = mavlink.MAVLink_mission_item_message
    return build(
        *target,
        seq=sequence,
        frame=item.frame,
        command=item.command,
        current=int(current),
        autocontinue=item.autocontinue,
        param1=item.params[0],
        param2=item.params[1],
        param3=item.params[2],
        param4=item.params[3],
        x=place[0],
        y=place[1],
        z=item.altitude_m,
        mission_type=mission_type,
    )


def item_from(message: Message) -> MissionItem | None:
    """The item in a MISSION_ITEM_INT or MISSION_ITEM; None if its place is not finite."""
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        if not (math.isfinite(x) and math.isfinite(y)):
            return None
        x, y = round(x * 1e7), round(y * 1e7)
    # An unset parameter (NaN) is stored as 0, as in the autopilots.
    first, second, third, fourth = (
        0.0 if math.isnan(p) else p for p in (message.param1, message.param2, message.param3, message.param4)
    )
    params = (first, second, third, fourth)
    frame = _INTEGER_FRAMES.get(message.frame, message.frame)
    return MissionItem(message.command, params, x, y, message.z, frame, message.autocontinue)
