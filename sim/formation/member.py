"""One member of a formation: an aircraft with its companion, its own clocks, and its address on the radio."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.engine import Effect, Engine, Transmit
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.facts import Fact, PressureAltitude, Traffic
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.intake import Intake
from sim.campaign.flight import as_report
from sim.campaign.plane import FRAME, Plane
from sim.encounters import Heard

_V2_EXTENSION = mavlink.MAVLINK_MSG_ID_V2_EXTENSION
_ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED | mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_MAVLINK_VERSION = 3
_COMPANION = mavlink.MAV_COMP_ID_OBSTACLE_AVOIDANCE
# The epochs of the members' clocks are this far apart, and those of their autopilots' boot clocks.
_EPOCH_S, _EPOCHS_APART_S = 1_700_000_000.0, 3671.3
_BOOT_S, _BOOTS_APART_S = 400.0, 57.9


@dataclass(frozen=True, slots=True)
class Clock:
    """A clock that began at `epoch_s` and runs fast by a share; no two members share one."""

    epoch_s: float = 0.0
    drift: float = 0.0

    def at(self, time_s: float) -> float:
        """What the clock shows at a time of the simulation [s]."""
        return self.epoch_s + time_s * (1.0 + self.drift)


@dataclass
class Member:
    """A member with the MAVLink system id of its aircraft; without an engine it only flies its mission."""

    system_id: int
    plane: Plane
    engine: Engine | None
    drift: float = 0.0
    shares_intent: bool = True
    decision_ms: list[float] = field(default_factory=list)
    intent_bytes: list[tuple[float, int]] = field(default_factory=list)  # time and size of what was sent

    def __post_init__(self) -> None:
        number = self.system_id
        self._clock = Clock(_EPOCH_S + number * _EPOCHS_APART_S, self.drift)
        self._boot_clock = Clock(_BOOT_S + number * _BOOTS_APART_S, -self.drift)
        self._encoder, self._splitter = Encoder(), FrameSplitter()
        self._intake = Intake(_COMPANION)

    def hear(self, raw: bytes, time_s: float) -> None:
        """Take in a datagram of another member."""
        if self.engine is None:
            return
        now_s = self._clock.at(time_s)
        for frame in self._splitter.feed_datagram(raw):
            received = self._intake.judge(frame, now_s)
            if received is not None:
                self.engine.receive(received.fact, now_s, received.true_s)

    def hear_traffic(self, heard: Heard, time_s: float) -> None:
        """Take in what the receiver on board heard of another aircraft."""
        now_s = self._clock.at(time_s)
        self._take(Traffic(self.plane.sender, as_report(heard, now_s)), now_s)

    def telemeter(self, time_s: float, *, heartbeat: bool, rare: bool) -> list[bytes]:
        """The autopilot's messages: to the companion as facts, and returned as datagrams for the radio."""
        now_s, plane = self._clock.at(time_s), self.plane
        facts: list[Fact] = list(plane.facts(now_s))
        messages = [self._position_message(time_s)]
        if heartbeat:
            facts[:0] = [plane.heartbeat(), PressureAltitude(plane.sender, -plane.position_m[2])]
            messages.insert(0, self._heartbeat_message())
        if rare:
            facts += plane.rare_facts()
        for fact in facts:
            self._take(fact, now_s)
        return [self._encoder.encode(message, *plane.sender) for message in messages]

    def decide(self, time_s: float) -> list[bytes]:
        """One tick of the companion; returns its datagrams for the other members."""
        if self.engine is None:
            return []
        now_s = self._clock.at(time_s)
        begun = time.perf_counter()
        effects = self.engine.tick(now_s)
        self.decision_ms.append((time.perf_counter() - begun) * 1e3)
        if self.plane.execute(_to_autopilot(effects)):
            # The autopilot reports a new mode at once.
            for fact in (self.plane.heartbeat(), *self.plane.facts(now_s)):
                self._take(fact, now_s)
            more = self.engine.tick(now_s)
            self.plane.execute(_to_autopilot(more))
            effects = [*effects, *more]
        return self._intents(effects, time_s)

    def _take(self, fact: Fact, now_s: float) -> None:
        if self.engine is not None:
            self.engine.receive(fact, now_s)

    def _intents(self, effects: Sequence[Effect], time_s: float) -> list[bytes]:
        """The frames of V2_EXTENSION that are for others than the ground station, if intents are shared."""
        raws = [
            self._encoder.encode(effect.message, *effect.sender)
            for effect in effects
            if isinstance(effect, Transmit)
            and effect.message.get_msgId() == _V2_EXTENSION
            and effect.to != "station"
        ]
        self.intent_bytes += [(time_s, len(raw)) for raw in raws]
        return raws if self.shares_intent else []

    def _heartbeat_message(self) -> Message:
        beat = self.plane.heartbeat()
        return mavlink.MAVLink_heartbeat_message(
            beat.vehicle_type, beat.autopilot, _ARMED, beat.custom_mode, beat.system_status, _MAVLINK_VERSION
        )

    def _position_message(self, time_s: float) -> Message:
        plane = self.plane
        place, (north_mps, east_mps, down_mps) = FRAME.to_geo(*plane.position_m), plane.velocity_mps
        height_mm = round(place.altitude_m * 1e3)
        return mavlink.MAVLink_global_position_int_message(
            round(self._boot_clock.at(time_s) * 1e3),
            round(place.lat_deg * 1e7),
            round(place.lon_deg * 1e7),
            height_mm,
            height_mm,
            round(north_mps * 100.0),
            round(east_mps * 100.0),
            round(down_mps * 100.0),
            round(math.degrees(math.atan2(east_mps, north_mps)) * 100.0) % 36000,
        )


def _to_autopilot(effects: Sequence[Effect]) -> list[Message]:
    return [effect.message for effect in effects if isinstance(effect, Transmit)]
