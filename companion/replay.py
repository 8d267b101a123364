"""Replays a log through the engine of the flight, by the log's clock."""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from companion.address import parse_receiver_address
from companion.engine import LONGEST_GAP_IN_LOG_US, Effect, Engine, Record, Say, Stepper
from companion.errors import ConfigError, LinkError
from companion.mavlink.dialect import is_vehicle
from companion.mavlink.facts import Heartbeat
from companion.mavlink.framing import Frame
from companion.mavlink.intake import Intake
from companion.mavlink.log_clock import LogClock
from companion.mavlink.tlog import read_tlog
from companion.mavlink.translate import WANTED
from companion.model import Layer
from companion.recording.pieces import NOTES, TUNNEL, HeardElsewhere, PieceReader, is_piece
from companion.sightings import Sightings
from companion.sources.decoder import Heard
from companion.sources.receiver import Receiver

_MAX_RECEIVERS = 64


@dataclass
class Replay:
    """The result. `layers` counts decisions; `events` are (time since start [s], layer, words).

    `vehicles` are the system ids of the autopilots heard. `by_boot_time`: the time stamps made no clock, and
    the time is the autopilot's; `jumps` counts the steps of the stamps that were not followed. `forwarded`
    counts the reports of traffic that were sent on.
    """

    messages: int = 0
    bad_bytes: int = 0
    unknown: int = 0
    unusable: int = 0
    receivers: list[Receiver] = field(default_factory=list)
    sightings: Sightings = field(default_factory=Sightings)
    lost_pieces: int = 0
    vehicles: set[int] = field(default_factory=set)
    jumps: int = 0
    by_boot_time: bool = False
    forwarded: int = 0
    duration_s: float = 0.0
    elapsed_s: float = 0.0
    layers: Counter[Layer] = field(default_factory=Counter)
    events: list[tuple[float, Layer, str]] = field(default_factory=list)

    @property
    def messages_per_s(self) -> float:
        """Speed of the replay [messages/s]."""
        return self.messages / self.elapsed_s if self.elapsed_s > 0.0 else 0.0

    def report(self) -> dict[str, object]:
        """The machine-readable report."""
        return {
            "messages": self.messages,
            "bad_bytes": self.bad_bytes,
            "unknown": self.unknown,
            "unusable": self.unusable,
            "receivers": [_counts(receiver) for receiver in self.receivers],
            "lost_pieces": self.lost_pieces,
            "vehicles": sorted(self.vehicles),
            "clock": "time_boot_ms" if self.by_boot_time else "time stamps",
            "jumps": self.jumps,
            "aircraft": self.sightings.values(),
            "aircraft_left_out": self.sightings.left_out,
            "reports_sent_on": self.forwarded,
            "duration_s": round(self.duration_s, 3),
            "elapsed_s": round(self.elapsed_s, 3),
            "messages_per_s": round(self.messages_per_s),
            "decisions": sum(self.layers.values()),
            "layers": {str(layer): self.layers[layer] for layer in Layer},
        }


def _counts(receiver: Receiver) -> dict[str, object]:
    counters = receiver.counters
    return {
        "address": receiver.address,
        "messages": counters.messages,
        "reports": counters.reports,
        "bad": dict(sorted(counters.bad.items())),
    }


class RecordedReceivers:
    """The receivers of a log: what they sent, through the decoders of their formats.

    `elsewhere` is the newest note about which traffic was heard on which links.
    """

    def __init__(self) -> None:
        self.by_address: dict[str, Receiver] = {}
        self.elsewhere: HeardElsewhere | None = None
        self.unknown = 0  # pieces of formats that cannot be decoded here
        self._reader = PieceReader()

    @property
    def lost(self) -> int:
        """The number of pieces that are damaged, missing in part or of an unknown format."""
        return self._reader.lost + self.unknown

    def take(self, frame: Frame, now_s: float) -> list[Heard]:
        """The facts in the piece that this frame completes."""
        piece = self._reader.add(frame)
        if piece is None:
            return []
        if piece.address == NOTES:
            self.elsewhere = HeardElsewhere.of_piece(piece) or self.elsewhere
            return []
        receiver = self._receiver(piece.address)
        if receiver is None:
            self.unknown += 1
            return []
        return receiver.take(piece, now_s)

    def _receiver(self, address: str) -> Receiver | None:
        if address not in self.by_address and len(self.by_address) < _MAX_RECEIVERS:
            try:
                name = parse_receiver_address(address).format
                self.by_address[address] = Receiver.of(address, name)
            except (LinkError, ConfigError):
                return None
        return self.by_address.get(address)


def replay(
    path: Path,
    engine: Engine,
    *,
    later_parts: Sequence[Path] = (),
    on_decision: Callable[[str], object] | None = None,
    on_moment: Callable[[float, float], object] = lambda _since_s, _now_s: None,
    on_told: Callable[[int, Say], object] = lambda _time_us, _said: None,
    on_progress: Callable[[int], object] = lambda _bytes: None,
    receivers: RecordedReceivers | None = None,
) -> Replay:
    """Drive the engine by a log; LogError when it cannot be read.

    Messages that the companion itself sent while it recorded the log only move the clock: the engine ignores
    its own address. `later_parts` are logs that continue the first one. `on_progress` receives the number of
    bytes read of all logs, `on_told` each text for the operator with its time, and `on_moment`, after every
    tick with a position, the time since the start and the engine's time [s]. `receivers` decodes what the log
    has of receivers, for a caller that shows them.
    """
    result = Replay()
    started_s = time.perf_counter()
    last: tuple[Layer, str] = (Layer.CLEAR, "")
    first_us: int | None = None

    def perform(time_us: int, effects: Sequence[Effect]) -> None:
        nonlocal last
        since_s = 0.0 if first_us is None else (time_us - first_us) / 1e6
        for effect in effects:
            if isinstance(effect, Say):
                on_told(time_us, effect)
            if not isinstance(effect, Record):
                continue
            result.sightings.take(since_s, effect)
            if on_decision is not None:
                on_decision(effect.line)
            decision = engine.decision
            result.layers[decision.layer] += 1
            on_moment(since_s, time_us / 1e6)
            announced = engine.snapshot(time_us / 1e6).maneuver_text
            if (decision.layer, announced) != last:
                result.events.append((since_s, decision.layer, announced or decision.because))
                last = decision.layer, announced

    logs = [read_tlog(each, only=WANTED | {TUNNEL}) for each in (path, *later_parts)]
    clock = LogClock()
    stepper = Stepper(engine, perform, longest_stall_us=LONGEST_GAP_IN_LOG_US)
    intake = Intake(engine.sender.component_id)
    receivers = receivers or RecordedReceivers()
    now_us = 0
    for count, (stamp_us, frame) in enumerate(chain.from_iterable(logs)):
        now_us = clock.at(stamp_us, frame)
        if first_us is None:
            first_us = now_us
        if count % 256 == 0:
            on_progress(sum(log.read_bytes for log in logs))
        stepper.advance(now_us)
        if frame.message_id == TUNNEL:
            if is_piece(frame):
                stepper.receive_together(receivers.take(frame, now_us / 1e6), now_us)
                if receivers.elsewhere is not None:
                    elsewhere, works = receivers.elsewhere
                    engine.forwarding.note_sources(receiver_works=works, elsewhere=elsewhere)
            continue
        received = intake.judge(frame, now_us / 1e6)
        if received is not None:
            fact = received.fact
            if isinstance(fact, Heartbeat) and is_vehicle(fact.vehicle_type, fact.autopilot):
                result.vehicles.add(fact.sender.system_id)
            stepper.receive(fact, now_us, received.true_s)
    result.jumps, result.by_boot_time = clock.jumps, clock.by_boot_time
    result.unusable, result.forwarded = intake.unusable, engine.forwarding.sent
    result.receivers = list(receivers.by_address.values())
    result.lost_pieces = receivers.lost
    result.messages = sum(log.messages for log in logs)
    result.bad_bytes = sum(log.bad_bytes for log in logs)
    result.unknown = sum(log.unknown for log in logs)
    result.duration_s = (now_us - (first_us or 0)) / 1e6
    result.elapsed_s = time.perf_counter() - started_s
    return result
