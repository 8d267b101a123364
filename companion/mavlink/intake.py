"""From frames to the facts of the present: what arrives late, or from another vehicle, goes no further."""

from dataclasses import replace
from typing import NamedTuple

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    CommandRequest,
    Fact,
    LinkAnswer,
    OtherVehicle,
    ParameterRequest,
    ParameterSet,
    Sender,
    TimeSync,
    Traffic,
)
from companion.mavlink.framing import Frame
from companion.mavlink.recent_frames import RecentFrames
from companion.mavlink.translate import WANTED, frame_to_fact
from companion.mavlink.vehicle_clock import Origin, VehicleClocks

_STAMP_DIGITS = 1000
# What ground stations, which have no boot clock, request of us.
_REQUESTS = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_COMMAND_INT,
        mavlink.MAVLINK_MSG_ID_PARAM_SET,
    }
)


class Received(NamedTuple):
    """A fact, and when it was true on our clock [s]."""

    fact: Fact
    true_s: float


class Intake:
    """One for all links, as each vehicle has one clock; `judge` is called for every frame, in their order.

    `unusable` counts messages of a wanted kind without valid content, `past` those that came too late,
    `repeated` requests that were received before, byte for byte, and `of_others` messages of another vehicle
    with the address of one that is known.
    """

    def __init__(self, component_id: int) -> None:
        """`component_id` is ours: it marks the TIMESYNC requests that are answered."""
        self._component_id = component_id
        self.unusable = 0
        self.past = 0
        self.repeated = 0
        self.of_others = 0
        self._clocks = VehicleClocks()
        self._requests: RecentFrames[tuple[int, int, int]] = RecentFrames()

    def judge(self, frame: Frame, received_s: float) -> Received | None:
        """The fact in a frame that was received at `received_s` on our clock; `None` if it is of no use."""
        if frame.message_id not in WANTED:
            return None
        true_s, origin = self._clocks.judge(frame, received_s)
        if origin is Origin.OTHER:
            self.of_others += 1
            return Received(OtherVehicle(Sender(frame.system_id, frame.component_id)), received_s)
        fact = frame_to_fact(frame, true_s)
        if fact is None:
            self.unusable += 1
        elif isinstance(fact, TimeSync):
            return self._synchronize(fact, frame, received_s)
        elif origin is Origin.PRESENT and frame.message_id in _REQUESTS:
            return self._request(fact, frame, received_s)
        # Reports of traffic carry their age and are judged by it.
        elif origin is Origin.PRESENT or isinstance(fact, Traffic):
            return Received(fact, true_s)
        else:
            self.past += 1
        return None

    def _request(self, fact: Fact, frame: Frame, received_s: float) -> Received | None:
        """A request, unless it is a copy: obeyed again, it would undo what was requested since.

        A station that repeats a request gives it a new sequence number. Of a station whose frames all have
        the same number, a request counts again once another one came in between. A script that counts from 0
        whenever it is run sends the same bytes as a late copy: within 15 s they count as one.

        A copy is answered, as its sender may wait: that of a setting with the present value, that of a
        command as the command itself was.
        """
        key = frame.system_id, frame.component_id, frame.sequence
        if not self._requests.holds(key, frame.raw, received_s):
            self._requests.put(key, frame.raw, received_s)
            return Received(fact, received_s)
        self.repeated += 1
        if isinstance(fact, ParameterSet):
            return Received(ParameterRequest(fact.sender, fact.target, fact.name, None), received_s)
        if isinstance(fact, CommandRequest):
            return Received(replace(fact, is_copy=True), received_s)
        return None

    def _synchronize(self, fact: TimeSync, frame: Frame, received_s: float) -> Received | None:
        """Use an answer to our own request; all others are of no use."""
        if fact.answer_ns == 0 or fact.stamp_ns % _STAMP_DIGITS != self._component_id:
            return None
        asked_s = fact.stamp_ns // _STAMP_DIGITS / 1e6
        if asked_s > received_s:
            return None
        self._clocks.answered(frame, asked_s, received_s)
        return Received(LinkAnswer(fact.sender, asked_s), received_s)


def time_sync_request(component_id: int, now_s: float) -> Message:
    """A TIMESYNC request; the last three digits of its stamp, our component, mark the answer as ours."""
    return mavlink.MAVLink_timesync_message(0, round(now_s * 1e6) * _STAMP_DIGITS + component_id)
