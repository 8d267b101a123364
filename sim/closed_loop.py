"""Closed loop: engine and fake vehicle in lockstep, without sockets or waiting, with the bytes of the wire.

All messages are packed, framed, decoded and translated as in flight, and so is what receivers of traffic
send; only the sockets are left out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from companion.autopilots import is_setpoint
from companion.engine import Effect, Engine, Record, Stepper, Transmit
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import FrameSplitter, decode
from companion.mavlink.intake import Intake
from companion.model import Layer
from companion.sources.receiver import Piece, Receiver
from companion.sources.registry import FORMATS as DECODED
from sim.metrics import FlightScore, score_of
from sim.receiver import carrier_of
from sim.scenario import Autopilot, Scenario
from sim.vehicle import Truth
from sim.world import World, build_world

_STEP_US = 50_000
COMPANION_CHANNEL, RECEIVER_CHANNEL = 0, 1


@dataclass
class Flight:
    """The record of a flight. `layers` are (time since start, layer) at each change, `texts` STATUSTEXTs."""

    score: FlightScore
    truth: Truth
    engagements: int = 0
    resumed: bool = False
    uncontrolled: bool = False
    completed_s: float | None = None
    layers: list[tuple[float, Layer]] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    records: list[Record] = field(default_factory=list, repr=False)
    setpoints_sent: int = 0
    modes: list[tuple[float, str]] = field(default_factory=list)

    @property
    def decisions(self) -> list[str]:
        """The record of the decisions so far as lines of JSON, formatted when they are read."""
        return [record.line for record in self.records]

    @property
    def mission_completed(self) -> bool:
        """True if the last waypoint was reached."""
        return self.completed_s is not None


class ClosedLoop:
    """One scenario flown by one engine (`None`: without avoidance).

    Traffic is heard by the ADS-B receiver beside the autopilot, or by `receivers` (names of formats) beside
    the companion instead.
    """

    def __init__(
        self,
        scenario: Scenario,
        engine: Engine | None,
        *,
        start_us: int = 1_700_000_000_000_000,
        seed: int = 0,
        autopilot: Autopilot = "ardupilot",
        receivers: Sequence[str] = (),
        world: World | None = None,
        score: FlightScore | None = None,
    ) -> None:
        """`world` and `score` are made from the scenario unless given."""
        self.start_us = start_us
        self.scenario = scenario
        self.engine = engine
        self.world: World = world or build_world(scenario, start_us / 1e6, seed=seed, autopilot=autopilot)
        self.world.vehicle.add_channel(COMPANION_CHANNEL)
        self.world.vehicle.add_channel(RECEIVER_CHANNEL, stream_rate_hz=0.0)  # no listener
        self.flight = Flight(score or score_of(scenario, self.world), self.world.vehicle.truth)
        self._encoder, self._boots, self._own_encoder = Encoder(), self.world.vehicle.boots, Encoder()
        self._intake = Intake(mavlink.MAV_COMP_ID_OBSTACLE_AVOIDANCE)
        self._up, self._down = FrameSplitter(), FrameSplitter()
        self.receivers = [_ReceiverAtCompanion(self.world, name, seed) for name in receivers]
        self._stepper = None if engine is None else Stepper(engine, self._perform)
        self._now_us = start_us

    def run(
        self, seconds: float | None = None, *, on_step: Callable[["ClosedLoop", float], None] | None = None
    ) -> Flight:
        """Fly for `seconds` (default: the scenario's duration, or until its mission is completed)."""
        until_us = self._now_us + round((self.scenario.duration_s if seconds is None else seconds) * 1e6)
        while self._now_us < until_us:
            self.step()
            if on_step is not None:
                on_step(self, (self._now_us - self.start_us) / 1e6)
            if seconds is None and self.flight.mission_completed:
                break
        return self.flight

    def step(self) -> None:
        """Fly for one step of 50 ms."""
        self._now_us += _STEP_US
        self._step()

    def _step(self) -> None:
        now_s = self._now_us / 1e6
        world, flight = self.world, self.flight
        if self.receivers:
            self._hear_receivers(now_s)
        else:
            for message in world.receiver.reports(now_s, world.vehicle.flight.aircraft.position_m):
                world.vehicle.receive(message, now_s, RECEIVER_CHANNEL)
        for outgoing in world.vehicle.step(now_s):
            if outgoing.channel == COMPANION_CHANNEL and self._stepper is not None:
                self._hear(outgoing.message)
            elif outgoing.channel not in (COMPANION_CHANNEL, RECEIVER_CHANNEL):
                self.pass_on(outgoing.message)
        if self._stepper is not None:
            self._stepper.advance(self._now_us)
        truth = world.vehicle.truth
        flight.score.update(now_s, truth.position_m)
        if not flight.modes or flight.modes[-1][1] != truth.mode:
            flight.modes.append((now_s - self.start_us / 1e6, truth.mode))
            flight.engagements += truth.companion_flies
            flight.resumed |= truth.on_mission and flight.engagements > 0
        flight.uncontrolled |= truth.uncontrolled
        if truth.mission_completed and flight.completed_s is None:
            flight.completed_s = now_s - self.start_us / 1e6
        flight.truth = truth

    def pass_on(self, message: Message) -> None:
        """Called with what the vehicle sends on further channels; nothing listens to them here."""

    def transmitted(self, effect: Transmit) -> None:
        """Called with each message that the companion sends; nothing but the autopilot listens here."""

    def _hear(self, message: Message) -> None:
        assert self._stepper is not None
        vehicle = self.world.vehicle
        if vehicle.boots != self._boots:  # sequence numbers restart
            self._encoder, self._boots = Encoder(), vehicle.boots
        self._take_in(self._up, self._encoder.encode(message, vehicle.system_id, vehicle.component_id))

    def _take_in(self, splitter: FrameSplitter, datagram: bytes) -> None:
        assert self._stepper is not None
        for frame in splitter.feed_datagram(datagram):
            received = self._intake.judge(frame, self._now_us / 1e6)
            if received is not None:
                self._stepper.receive(received.fact, self._now_us, received.true_s)

    def _hear_receivers(self, now_s: float) -> None:
        carrier = carrier_of(self.flight.truth)
        for receiver in self.receivers:
            for data in receiver.simulated.pieces(now_s, carrier):
                if self._stepper is None:
                    continue
                if receiver.decoding is None:
                    self._take_in(receiver.splitter, data)
                else:
                    piece = Piece(receiver.decoding.address, data)
                    self._stepper.receive_together(receiver.decoding.take(piece, now_s), self._now_us)

    def _perform(self, time_us: int, effects: Sequence[Effect]) -> None:
        engine, flight = self.engine, self.flight
        assert engine is not None
        for effect in effects:
            if isinstance(effect, Record):
                flight.records.append(effect)
            elif isinstance(effect, Transmit) and effect.to != "station":
                self._transmit(time_us, effect)
        layer = engine.decision.layer
        if (flight.layers[-1][1] if flight.layers else Layer.CLEAR) is not layer:
            flight.layers.append(((time_us - self.start_us) / 1e6, layer))
        if engine.supervisor.flying:
            flight.score.note_action(time_us / 1e6, engine.decision.threats)

    def _transmit(self, time_us: int, effect: Transmit) -> None:
        raw = self._own_encoder.encode(effect.message, effect.sender.system_id, effect.sender.component_id)
        kind = effect.message.get_type()
        self.flight.setpoints_sent += is_setpoint(effect.message)
        if kind == "STATUSTEXT":
            self.flight.texts.append(str(effect.message.text))
        self.transmitted(effect)
        for frame in self._down.feed_datagram(raw):
            message = decode(frame)
            if message is not None:
                self.world.vehicle.receive(message, time_us / 1e6, COMPANION_CHANNEL)


class _ReceiverAtCompanion:
    """A simulated receiver, and the decoder or the frames at the other end of its link."""

    def __init__(self, world: World, name: str, seed: int) -> None:
        self.simulated = world.receiver_of(name, seed=seed)
        self.decoding = Receiver.of(name, name) if name in DECODED else None
        self.splitter = FrameSplitter()


def fly(
    scenario: Scenario,
    engine: Engine | None,
    *,
    seed: int = 0,
    autopilot: Autopilot = "ardupilot",
    receivers: Sequence[str] = (),
) -> Flight:
    """Fly a scenario to its end."""
    return ClosedLoop(scenario, engine, seed=seed, autopilot=autopilot, receivers=receivers).run()
