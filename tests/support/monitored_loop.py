"""A closed loop that records all commands, and whose links can drop or change messages."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from companion.control.state_machine import State
from companion.engine import Effect, Engine, EngineConfig, Transmit
from companion.mavlink.dialect import Message
from companion.mavlink.facts import Fact
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.translate import frame_to_fact
from sim.closed_loop import ClosedLoop
from sim.scenario import Autopilot, Scenario, load_scenario
from sim.traffic import Intruder, Maneuver
from sim.vehicle import Mode

COMMANDS = {
    "COMMAND_LONG",
    "COMMAND_INT",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_POSITION_TARGET_LOCAL_NED",
    "SET_MODE",
}
DO_SET_MODE, SET_INTERVAL, REQUEST_MESSAGE = 176, 511, 512
_STEP_US = 50_000
_HEAD_ON = load_scenario("head-on")
# The conflict begins after a quarter of a minute, when the autopilot has answered what is asked at the start.
SOON = replace(_HEAD_ON, intruders=tuple(replace(one, meet_at_s=72.0) for one in _HEAD_ON.intruders))
_OPERATOR, _OPERATOR_COMPONENT = 255, 190


class MonitoredLoop(ClosedLoop):
    """Records every flight command that is sent, and can drop commands before the vehicle gets them.

    `sent` are (time [us], message type and command); `states` are (time [us], state, number of commands sent
    before) at every change. `drops` selects the messages that do not reach the vehicle. `alter` may change a
    message of the vehicle before the engine receives it; `None` drops it.
    """

    def __init__(
        self,
        scenario: Scenario | str = SOON,
        *,
        drops: Callable[[Transmit], bool] = lambda _: False,
        config: EngineConfig | None = None,
        autopilot: Autopilot = "ardupilot",
        parameters: dict[str, float] | None = None,
    ) -> None:
        self.sent: list[tuple[int, str]] = []
        self.states: list[tuple[int, State, int]] = []
        self.drops = drops
        self.alter: Callable[[Message], Message | None] = lambda message: message
        self._awaited: Callable[[Fact], bool] | None = None
        self._reported_us: int | None = None
        if isinstance(scenario, str):
            scenario = load_scenario(scenario)
        self._engine = Engine(config)
        super().__init__(scenario, self._engine, autopilot=autopilot)
        for name, value in (parameters or {}).items():
            self.world.vehicle.parameters.record(name, value)
        self.world.vehicle.flight.apply_parameters()

    @property
    def now_us(self) -> int:
        return self._now_us

    @property
    def now_s(self) -> float:
        return self._now_us / 1e6

    @property
    def state(self) -> State:
        return self._engine.supervisor.state

    def _transmit(self, time_us: int, effect: Transmit) -> None:
        message = effect.message
        is_query = getattr(message, "command", None) in (SET_INTERVAL, REQUEST_MESSAGE)
        if message.get_type() in COMMANDS and not is_query:
            self.sent.append((time_us, f"{message.get_type()} {getattr(message, 'command', '')}".strip()))
        if not self.drops(effect):
            super()._transmit(time_us, effect)

    def _perform(self, time_us: int, effects: Sequence[Effect]) -> None:
        if not self.states or self.states[-1][1] is not self.state:
            self.states.append((time_us, self.state, len(self.sent)))
        super()._perform(time_us, effects)

    def _hear(self, message: Message) -> None:
        changed = self.alter(message)
        if changed is None:
            return
        if self._awaited is not None and self._awaited(self._fact(changed)):
            self._awaited, self._reported_us = None, self._now_us
        super()._hear(changed)

    def _fact(self, message: Message) -> Fact | None:
        """The fact that the engine makes of a message."""
        vehicle = self.world.vehicle
        raw = self._encoder.encode(message, vehicle.system_id, vehicle.component_id)
        (frame,) = FrameSplitter().feed_datagram(raw)
        return frame_to_fact(frame, self.now_s)

    def step(self) -> None:
        """Fly for the smallest time step."""
        self._now_us += _STEP_US
        self._step()

    def until(self, *states: State, limit_s: float = 120.0) -> None:
        """Fly until the supervisor is in one of the states."""
        self.until_true(lambda: self.state in states, limit_s)

    def until_true(self, condition: Callable[[], bool], limit_s: float = 120.0) -> None:
        """Fly until a condition is true."""
        for _ in range(round(limit_s * 20)):
            if condition():
                return
            self.step()
        raise AssertionError(f"timeout in {self.state}, {self.mode_name}")

    def until_reported(self, shows: Callable[[Fact], bool], limit_s: float = 2.0) -> int:
        """Fly until the vehicle has sent a certain fact, before the next tick; its time [us]."""
        self._awaited, self._reported_us = shows, None
        self.until_true(lambda: self._reported_us is not None, limit_s)
        assert self._reported_us is not None
        return self._reported_us

    def entered_us(self, state: State) -> int:
        """Time of the last entry into a state [us]."""
        return next(at_us for at_us, entered, _ in reversed(self.states) if entered is state)

    def sent_since(self, state: State) -> list[str]:
        """All commands since the last entry into a state, those of that tick included."""
        before = next(before for _, entered, before in reversed(self.states) if entered is state)
        return [sent for _, sent in self.sent[before:]]

    @property
    def mode_name(self) -> str:
        return self.world.vehicle.truth.mode

    def mode(self) -> Mode:
        return Mode[self.mode_name]

    def stop(self) -> list[Effect]:
        effects = self._engine.request_stop(self.now_s)
        self._perform(self._now_us, effects)
        return effects

    def send_to_companion(self, message: Message) -> None:
        """Send a message from a ground station to the companion."""
        raw = self._encoder.encode(message, _OPERATOR, _OPERATOR_COMPONENT)
        (frame,) = FrameSplitter().feed_datagram(raw)
        fact = frame_to_fact(frame, self.now_s)
        assert fact is not None
        assert self._stepper is not None
        self._stepper.receive(fact, self._now_us)

    def intrude(
        self,
        ahead_m: float,
        *,
        speed_mps: float = 60.0,
        right_m: float = 0.0,
        above_m: float = 0.0,
        goes_s: float | None = None,
        named: tuple[int, str] = (0xABCDEF, "SUDDEN"),
    ) -> Intruder:
        """Add an intruder that appears ahead and closes head-on; after `goes_s` it climbs away steeply."""
        truth = self.world.vehicle.truth
        north_mps, east_mps, _ = truth.velocity_mps
        course_rad = truth.heading_rad if truth.on_ground else math.atan2(east_mps, north_mps)
        ahead = math.cos(course_rad), math.sin(course_rad)
        north_m, east_m, down_m = truth.position_m
        away = () if goes_s is None else (Maneuver(self.now_s + goes_s, climb_mps=80.0),)
        intruder = Intruder(
            *named,
            self.now_s,
            (
                north_m + ahead_m * ahead[0] - right_m * ahead[1],
                east_m + ahead_m * ahead[1] + right_m * ahead[0],
                down_m - above_m,
            ),
            (-speed_mps * ahead[0], -speed_mps * ahead[1], 0.0),
            maneuvers=away,
            appears_s=self.now_s,
        )
        self.world.receiver.add(intruder)
        return intruder


def without_traffic(name: str = "head-on", duration_s: float = 60.0) -> Scenario:
    """A scenario without its intruders."""
    return replace(load_scenario(name), intruders=(), duration_s=duration_s)


def is_mode_request(effect: Transmit) -> bool:
    return getattr(effect.message, "command", None) == DO_SET_MODE
