"""The engine among hostile facts: it never raises, and commands no aircraft that is not its to command."""

import random
from collections import Counter

import pytest

from companion.control.state_machine import FLYING, WATCHING, State
from companion.engine import Effect, Engine, EngineConfig, EngineParams, Transmit
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.facts import ParameterSet
from companion.model import Role
from tests.support.junk_facts import GCS, T0, US, Junk
from tests.support.random_aircraft import ARDUPILOT, PX4, QUERIES, RandomAircraft
from tests.support.thorough import sample

GUIDING = {
    mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
    mavlink.MAV_CMD_GUIDED_CHANGE_SPEED,
    mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
    mavlink.MAV_CMD_DO_REPOSITION,
}
ASKING = {State.ENGAGING, State.RELEASING, State.STOPPING}
# What may be sent at any time: it asks, answers or tells, and changes nothing.
HARMLESS = {
    "HEARTBEAT", "STATUSTEXT", "TIMESYNC", "COLLISION", "COMMAND_ACK", "PARAM_VALUE", "PARAM_REQUEST_READ",
    "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK",
}  # fmt: skip


def sent_by(effects: list[Effect]) -> list[Message]:
    return [effect.message for effect in effects if isinstance(effect, Transmit)]


def acts(message: Message) -> bool:
    """Whether a message changes what the aircraft does."""
    kind = message.get_type()
    return kind not in HARMLESS and getattr(message, "command", None) not in QUERIES


def changes_mode(message: Message) -> bool:
    """Whether a message asks for a mode; a reposition without this flag is guidance like others."""
    command = getattr(message, "command", None)
    if command == mavlink.MAV_CMD_DO_REPOSITION:
        return int(message.param2) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE != 0
    return command == mavlink.MAV_CMD_DO_SET_MODE


class Referee:
    """Watches every tick."""

    def __init__(self, engine: Engine, aeroplane: RandomAircraft) -> None:
        self.engine = engine
        self.aeroplane = aeroplane
        self.states: Counter[State] = Counter()
        self.beats_s: list[float] = []
        self.allowed_take_over = True

    def tick(self, now_s: float) -> list[Message]:
        engine = self.engine
        before = engine.supervisor.state
        ready = not engine.hindrances(now_s)
        messages = sent_by(engine.tick(now_s))
        after = engine.supervisor.state
        self.states[after] += 1
        self.beats_s += [now_s for message in messages if message.get_type() == "HEARTBEAT"]
        for message in messages:
            if acts(message):
                self._judge(message, after)
        assert after not in FLYING | {State.ENGAGING} or engine.operator.role is Role.FLY
        if before in WATCHING and after is State.ENGAGING:
            assert ready
        if before is State.HANDS_OFF:
            assert after in (State.HANDS_OFF, State.MONITOR, State.ENGAGING, State.RELEASING)
        if (
            not engine.aircraft.flight_state.armed
            or engine.aircraft.flight_state.failsafe
            or engine.aircraft.flight_state.landing
        ):
            assert after not in FLYING | {State.ENGAGING}, "somebody else has it within the tick"
        return messages

    def _judge(self, message: Message, state: State) -> None:
        kind, command = message.get_type(), getattr(message, "command", None)
        aircraft = self.engine.aircraft
        if kind == "SET_POSITION_TARGET_GLOBAL_INT":
            entering = state is State.ENGAGING and self.aeroplane.autopilot == PX4
            leaving = state in (State.RELEASING, State.STOPPING) and aircraft.guided
            assert state in FLYING or entering or leaving
        elif changes_mode(message):
            assert state in ASKING
        elif command in GUIDING:
            assert state in FLYING
        elif kind == "PARAM_SET":
            assert message.param_id == "FW_AIRSPD_TRIM"
            # Given back, its own speed is put back; another one is asked for while flying only.
            assert state in FLYING or message.param_value == pytest.approx(20.0)
        else:
            assert command == mavlink.MAV_CMD_DO_SET_MISSION_CURRENT
            assert state is State.MONITOR
        if not aircraft.flight_state.armed:
            assert kind == "PARAM_SET", "nothing on the ground"


# Two seconds a flight, so that the rules are judged in flights that went both ways. Single flights may have
# none; of the first twelve seeds, any four in a row have together four times as much.
FLIGHTS, LEAST_TICKS = sample(2, 16), 20


def new_engine(autopilot: int) -> Engine:
    name = "px4" if autopilot == PX4 else "ardupilot"
    return Engine(EngineConfig(autopilot=name, engine=EngineParams(autopilot_system_id=1)))  # type: ignore[arg-type]


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_an_aircraft_with_a_will_of_its_own_is_never_commanded_against_it(autopilot: int) -> None:
    states = sum((fly_at_random(autopilot, seed) for seed in range(FLIGHTS)), Counter[State]())
    assert states[State.OUTER] + states[State.INNER] > FLIGHTS * LEAST_TICKS, "it has been flown"
    assert states[State.HANDS_OFF] > FLIGHTS * LEAST_TICKS, "and taken away"


def fly_at_random(autopilot: int, seed: int) -> Counter[State]:
    """Fly for 150 s; returns how often each state was seen."""
    chance = random.Random(1000 * autopilot + seed)
    engine, aeroplane = new_engine(autopilot), RandomAircraft(chance, autopilot)
    referee = Referee(engine, aeroplane)
    for tick in range(1500):
        now_s = T0 + tick / 10
        aeroplane.advance(now_s)
        for fact in aeroplane.facts(now_s, tick):
            if engine.receive(fact, now_s):
                for message in referee.tick(now_s):
                    aeroplane.receive(message)
        if chance.random() < 0.01:
            role = chance.choice((0.0, 1.0, 2.0, 2.0, 2.0))
            engine.receive(ParameterSet(GCS, US, "CA_ROLE", role), now_s)
        for message in referee.tick(now_s):
            aeroplane.receive(message)
    gaps_s = [b - a for a, b in zip(referee.beats_s, referee.beats_s[1:], strict=False)]
    assert max(gaps_s) < 1.05
    assert min(gaps_s) > 0.95
    return Counter(referee.states)


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
@pytest.mark.parametrize("seed", range(sample(1, 4)))
def test_no_fact_makes_it_raise(autopilot: int, seed: int) -> None:
    chance = random.Random(7000 * autopilot + seed)
    engine, aeroplane, junk = new_engine(autopilot), RandomAircraft(chance, autopilot), Junk(chance)
    encoder, now_s = Encoder(), T0
    for tick in range(1000):
        now_s += chance.choice((0.0, 3.0)) if chance.random() < 0.02 else 0.1
        facts = aeroplane.facts(now_s, tick) if tick % 300 < 200 else []
        facts += [junk.fact(now_s) for _ in range(chance.choice((0, 0, 1, 5)))]
        chance.shuffle(facts)
        effects = [e for fact in facts if engine.receive(fact, now_s) for e in engine.tick(now_s)]
        for message in sent_by([*effects, *engine.tick(now_s)]):
            encoder.encode(message, 1, 196)
            aeroplane.receive(message)
