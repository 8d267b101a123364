"""The link, from a tlog: messages per second, gaps, lost messages, and the autopilot's texts and mission."""

from collections import Counter
from dataclasses import dataclass, field, replace

from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Heartbeat, MissionItem
from companion.mavlink.framing import Frame, LossMeter, decode
from companion.mavlink.translate import frame_to_fact
from companion.recording.pieces import is_piece
from companion.report.flight import OperatorText

# The slowest message of an autopilot is its heartbeat, once a second.
GAP_S = 1.5
_LAST_NAV_COMMAND = mavlink.MAV_CMD_NAV_LAST
_LONGEST_TEXT = 1000
_LONGEST_S = 7 * 24 * 3600


@dataclass
class Sender:
    """A sender of messages, and how many of them arrived."""

    address: tuple[int, int]
    messages: int = 0
    lost: int = 0
    last_s: float | None = None
    autopilot: bool = False
    per_second: Counter[int] = field(default_factory=Counter)
    gaps: list[tuple[float, float]] = field(default_factory=list)

    @property
    def lost_share(self) -> float:
        """The share of its messages that were lost."""
        return self.lost / (self.messages + self.lost) if self.messages else 0.0


class LinkLog:
    """Statistics of the frames of a log, added in file order; times are seconds since its first record."""

    def __init__(self) -> None:
        self.senders: dict[tuple[int, int], Sender] = {}
        self._texts: dict[tuple[int, int], list[OperatorText]] = {}
        self._mission: dict[int, tuple[float, float]] = {}  # positions by sequence number
        self._losses = LossMeter()

    def add(self, time_s: float, frame: Frame) -> None:
        """Add a frame; what receivers sent was on no link."""
        if is_piece(frame):
            return
        address = frame.system_id, frame.component_id
        sender = self.senders.get(address)
        if sender is None:
            sender = self.senders[address] = Sender(address)
        sender.messages += 1
        sender.lost += self._losses.lost_before(frame.system_id, frame.component_id, frame.sequence)
        if 0.0 <= time_s < _LONGEST_S:
            sender.per_second[int(time_s)] += 1
        if sender.last_s is not None and time_s - sender.last_s > GAP_S:
            sender.gaps.append((sender.last_s, time_s))
        sender.last_s = time_s
        match frame.message_id:
            case mavlink.MAVLINK_MSG_ID_HEARTBEAT | mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT:
                self._add_fact(sender, frame, time_s)
            case mavlink.MAVLINK_MSG_ID_STATUSTEXT:
                self._add_text(sender, frame, time_s)
            case _:
                pass

    @property
    def autopilot(self) -> Sender | None:
        """The autopilot with the most messages."""
        found = [sender for sender in self.senders.values() if sender.autopilot]
        return max(found, key=lambda sender: sender.messages, default=None)

    @property
    def texts(self) -> list[OperatorText]:
        """The texts of the autopilot to the operator."""
        autopilot = self.autopilot
        return [] if autopilot is None else self._texts.get(autopilot.address, [])

    @property
    def mission(self) -> list[tuple[float, float]]:
        """The positions of the mission, latitude and longitude [deg]."""
        return [self._mission[sequence] for sequence in sorted(self._mission)]

    def _add_fact(self, sender: Sender, frame: Frame, time_s: float) -> None:
        fact = frame_to_fact(frame, time_s)
        if isinstance(fact, Heartbeat):
            sender.autopilot |= fact.autopilot != mavlink.MAV_AUTOPILOT_INVALID
        elif isinstance(fact, MissionItem) and fact.mission_type == mavlink.MAV_MISSION_TYPE_MISSION:
            if fact.lat_deg is not None and fact.lon_deg is not None and fact.command <= _LAST_NAV_COMMAND:
                self._mission[fact.sequence] = fact.lat_deg, fact.lon_deg
            else:
                self._mission.pop(fact.sequence, None)

    def _add_text(self, sender: Sender, frame: Frame, time_s: float) -> None:
        """Add a text, or append a further chunk to the last one."""
        message = decode(frame)
        if message is None:
            return
        texts = self._texts.setdefault(sender.address, [])
        text = message.text if isinstance(message.text, str) else message.text.decode("latin-1")
        if getattr(message, "id", 0) and getattr(message, "chunk_seq", 0) and texts:
            texts[-1] = replace(texts[-1], text=(texts[-1].text + text)[:_LONGEST_TEXT])
        else:
            texts.append(OperatorText(time_s, message.severity, text, "autopilot"))
