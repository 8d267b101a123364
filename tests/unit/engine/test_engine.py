"""The engine by itself: facts in, effects out."""

import json
import math
from dataclasses import replace

import pytest

from companion.avoidance import AvoidanceParams, Avoider
from companion.control.state_machine import State, SupervisorParams
from companion.engine import Engine, EngineConfig, EngineParams, Keep, Record, Stepper, Transmit
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    AirData,
    CommandResult,
    Fact,
    Heartbeat,
    LandedState,
    MissionCount,
    OwnPosition,
    OwnTransponder,
    Parameter,
    PressureAltitude,
    Sender,
    Traffic,
)
from companion.model import AltitudeReference, Decision, Guidance, Layer, Role, TrafficReport, TrafficSource
from companion.output.persisted_state import PersistedState
from tests.support.missions import empty_missions

AUTOPILOT, OTHER, GCS = Sender(1, 1), Sender(7, 1), Sender(255, 190)
T0 = 1_700_000_000.0


def new_engine(autopilot_system_id: int | str = 1, **changes: object) -> Engine:
    """An engine with a configured autopilot system, which adopts it without waiting for others."""
    params = EngineParams(autopilot_system_id=autopilot_system_id, **changes)  # type: ignore[arg-type]
    return Engine(EngineConfig(engine=params))


def heartbeat(
    sender: Sender = AUTOPILOT, *, mode: int = 10, armed: bool = True, autopilot: int = 3
) -> Heartbeat:
    return Heartbeat(sender, 1, autopilot, armed, mode, 4)


def position(time_s: float, sender: Sender = AUTOPILOT, *, height_m: float = 300.0) -> OwnPosition:
    lat_deg = -35.0 + (time_s - T0) * 22.0 / 110_940.0
    return OwnPosition(
        sender, time_s - T0 + 30.0, lat_deg, 149.0, 584.0 + height_m, height_m, (22.0, 0.0, 0.0), 0.0
    )


def traffic(
    time_s: float, *, icao: int = 0xA00001, meet_s: float = 40.0, sender: Sender = AUTOPILOT
) -> Traffic:
    north_m = 22.0 * meet_s + 60.0 * (meet_s - (time_s - T0))
    report = TrafficReport(
        TrafficSource.ADSB, f"{icao:06X}", time_s, -35.0 + north_m / 110_940.0, 149.0, 884.0,
        course_rad=math.pi, ground_speed_mps=60.0, climb_mps=0.0, callsign="TEST1", icao=icao,
    )  # fmt: skip
    return Traffic(sender, report)


def run(engine: Engine, facts: list[Fact], now_s: float) -> list[Message]:
    for fact in facts:
        engine.receive(fact, now_s)
    return messages(engine.tick(now_s))


def messages(effects: object) -> list[Message]:
    return [effect.message for effect in effects if isinstance(effect, Transmit)]  # type: ignore[attr-defined]


def of(sent: list[Message], kind: str) -> list[Message]:
    return [message for message in sent if message.get_type() == kind]


def fly(
    engine: Engine,
    seconds: float,
    *,
    meet_s: float = 40.0,
    mode: int = 10,
    armed: bool = True,
    answers_missions: bool = True,
) -> list[Message]:
    """Fly north in the mission with one intruder ahead; only the mission is answered: there is none."""
    sent: list[Message] = []
    answers: list[MissionCount] = []
    for tick in range(round(seconds * 10)):
        now_s = T0 + tick / 10
        facts: list[Fact] = [position(now_s), AirData(AUTOPILOT, 22.0)]
        if tick % 10 == 0:
            facts += [heartbeat(mode=mode, armed=armed), traffic(now_s, meet_s=meet_s)]
            facts.append(LandedState(AUTOPILOT, mavlink.MAV_LANDED_STATE_IN_AIR))
        sent += run(engine, [*answers, *facts], now_s)
        answers = empty_missions(sent[-9:] if answers_missions else (), AUTOPILOT, engine.sender)
    return sent


def test_own_heartbeat_has_the_autopilots_system_and_our_component() -> None:
    engine = new_engine(23)
    run(engine, [heartbeat(Sender(23, 1))], T0)
    assert engine.sender == Sender(23, 196)
    beats = [
        effect
        for tick in range(1, 31)
        for effect in engine.tick(T0 + tick / 10)
        if isinstance(effect, Transmit) and effect.message.get_type() == "HEARTBEAT"
    ]
    assert len(beats) == 3
    assert {(beat.message.type, beat.message.autopilot) for beat in beats} == {(18, 8)}
    assert {beat.sender for beat in beats} == {Sender(23, 196)}


def test_our_heartbeat_is_critical_without_an_autopilot_or_a_position() -> None:
    engine = new_engine()
    (alone,) = of(run(engine, [], T0), "HEARTBEAT")
    assert alone.system_status == mavlink.MAV_STATE_CRITICAL
    sent = run(engine, [heartbeat(), position(T0 + 1)], T0 + 1)
    assert of(sent, "HEARTBEAT")[0].system_status == mavlink.MAV_STATE_ACTIVE


def test_the_only_autopilot_is_adopted_after_a_moment() -> None:
    engine = new_engine("auto")
    run(engine, [heartbeat(GCS, autopilot=8), heartbeat()], T0)
    assert engine.aircraft.adapter is None
    run(engine, [heartbeat()], T0 + 1.6)
    assert engine.aircraft.sender == AUTOPILOT


def test_neither_of_two_autopilots_is_adopted_and_the_operator_is_warned_every_half_minute() -> None:
    engine = new_engine("auto")
    sent = []
    for second in range(60):
        sent += run(engine, [heartbeat(), heartbeat(OTHER)], T0 + second)
    assert engine.aircraft.adapter is None
    texts = [message.text for message in of(sent, "STATUSTEXT")]
    assert "".join(texts) == 2 * "several autopilots, set autopilot_system_id"
    assert [condition.key for condition in engine.conditions] == ["several autopilots"]


def low(engine: Engine, seconds: float, height_m: float, *, after_s: float = 0.0) -> list[str]:
    """The texts while the mission is flown at this height, without traffic."""
    sent: list[Message] = []
    for tick in range(round(after_s * 10), round((after_s + seconds) * 10)):
        now_s = T0 + tick / 10
        facts: list[Fact] = [position(now_s, height_m=height_m), AirData(AUTOPILOT, 22.0)]
        if tick % 10 == 0:
            facts += [heartbeat(), LandedState(AUTOPILOT, mavlink.MAV_LANDED_STATE_IN_AIR)]
            facts.append(CommandResult(AUTOPILOT, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, None))
        facts += empty_missions(sent[-9:], AUTOPILOT, engine.sender)
        sent += run(engine, facts, now_s)
    return [message.text for message in of(sent, "STATUSTEXT")]


@pytest.mark.parametrize("height_m", [20.0, -40.0])
def test_in_the_air_the_reason_why_it_would_not_fly_is_announced_until_it_ends(height_m: float) -> None:
    engine = new_engine(1)
    reason = f"Avoidance off: it is {height_m:.0f} m above home, below 30 m"
    assert low(engine, 75.0, height_m) == 3 * [reason]
    assert [condition.text for condition in engine.conditions] == [reason]
    assert low(engine, 10.0, 100.0, after_s=75.0) == ["Avoidance on again"]
    assert engine.conditions == ()


def test_a_climb_through_the_lowest_height_is_not_announced() -> None:
    engine = new_engine(1)
    assert low(engine, 8.0, 20.0) + low(engine, 20.0, 100.0, after_s=8.0) == []


def test_an_autopilot_that_answers_no_request_is_reported_every_half_minute() -> None:
    engine = new_engine(1)
    sent = fly(engine, 75.0, meet_s=1000.0, answers_missions=False)
    texts = [message.text for message in of(sent, "STATUSTEXT")]
    assert texts.count("Avoidance: autopilot answers no request") == 3


def test_a_later_second_autopilot_is_announced_and_ignored() -> None:
    engine = new_engine("auto")
    sent = run(engine, [heartbeat()], T0) + run(engine, [heartbeat()], T0 + 1.6)
    sent += run(engine, [heartbeat(OTHER, mode=15)], T0 + 2.0)
    assert engine.aircraft.sender == AUTOPILOT
    assert engine.aircraft.mode == "AUTO"
    assert [m.text for m in of(sent, "STATUSTEXT")] == ["Avoidance: another autopilot, system 7"]


def test_a_configured_autopilot_is_waited_for() -> None:
    engine = new_engine(7, system_id=42)
    run(engine, [heartbeat()], T0)
    assert engine.aircraft.adapter is None
    run(engine, [heartbeat(OTHER)], T0 + 1)
    assert engine.aircraft.sender == OTHER
    assert engine.sender == Sender(42, 196)
    assert Engine(EngineConfig(autopilot="px4")).receive(heartbeat(), T0) is False


def test_a_copter_is_not_taken_over_but_gets_advice() -> None:
    engine = new_engine()
    copter = Heartbeat(AUTOPILOT, 2, 3, True, 10, 4)
    sent = []
    for tick in range(50):
        now_s = T0 + tick / 10
        sent += run(engine, [copter, position(now_s), traffic(now_s)], now_s)
    assert engine.decision.layer is not Layer.CLEAR
    assert engine.supervisor.state is State.STANDBY
    assert [m for m in of(sent, "COMMAND_LONG") if m.command == 176] == []


def test_rates_and_own_icao_address_are_requested() -> None:
    sent = run(new_engine(), [heartbeat()], T0)
    requested = {int(m.param1): m.param2 for m in of(sent, "COMMAND_LONG") if m.command == 511}
    assert requested[33] == pytest.approx(100_000)
    assert requested[246] == pytest.approx(200_000)
    assert of(sent, "PARAM_REQUEST_READ")[0].param_id.startswith("ADSB_ICAO_ID")


def test_a_conflict_makes_the_engine_request_guided() -> None:
    engine = new_engine()
    sent = fly(engine, 3.0)
    modes = [m for m in of(sent, "COMMAND_LONG") if m.command == 176]
    assert modes
    assert (modes[0].param1, modes[0].param2) == (1, 15)
    assert engine.supervisor.state is State.ENGAGING
    first, second = (message.text for message in of(sent, "STATUSTEXT")[:2])
    assert first == "Advise RIGHT 060: TEST1 12 o'clock 3.3 km level", "its mission is not read yet"
    assert second.startswith("RIGHT 060: TEST1 12 o'clock 3.")
    assert not of(sent, "SET_POSITION_TARGET_GLOBAL_INT"), "no setpoints before the mode is confirmed"


def test_once_the_mode_is_confirmed_commands_and_collisions_are_sent() -> None:
    engine = new_engine()
    fly(engine, 3.0)
    sent = run(engine, [heartbeat(mode=15), position(T0 + 3.1)], T0 + 3.1)
    assert engine.supervisor.flying
    assert len(of(sent, "COMMAND_INT")) == 2, "course and height; the speed stays"
    assert len(of(sent, "SET_POSITION_TARGET_GLOBAL_INT")) == 1
    later = [m for tick in range(32, 60) for m in run(engine, [position(T0 + tick / 10)], T0 + tick / 10)]
    collisions = of(later, "COLLISION")
    assert 2 <= len(collisions) <= 3, "once a second"
    assert collisions[0].id == 0xA00001


@pytest.mark.parametrize(
    ("mode", "armed", "height_m"), [(10, False, 300.0), (5, True, 300.0), (10, True, 20.0)]
)
def test_no_take_over_when_disarmed_in_another_mode_or_low(mode: int, armed: bool, height_m: float) -> None:
    engine = new_engine()
    sent = []
    for tick in range(100):
        now_s = T0 + tick / 10
        facts: list[Fact] = [
            heartbeat(mode=mode, armed=armed),
            position(now_s, height_m=height_m),
            traffic(now_s),
        ]
        sent += run(engine, facts, now_s)
    assert engine.supervisor.state is State.STANDBY
    assert [m for m in of(sent, "COMMAND_LONG") if m.command == 176] == []


@pytest.mark.parametrize(("role", "computed"), [("advise", True), ("off", False)])
def test_in_the_roles_advise_and_off_nothing_is_commanded(role: str, computed: bool) -> None:
    engine = Engine(
        EngineConfig(engine=EngineParams(autopilot_system_id=1), supervisor=SupervisorParams(role=role))  # type: ignore[arg-type]
    )
    sent = fly(engine, 12.0, meet_s=40.0)
    assert (engine.decision.layer is not Layer.CLEAR) == computed
    assert engine.supervisor.state is State.STANDBY
    assert {m.command for m in of(sent, "COMMAND_LONG")} <= {511, 512}
    assert of(sent, "SET_POSITION_TARGET_GLOBAL_INT") == []
    assert bool(of(sent, "COLLISION")) == computed
    assert any("TEST1" in str(m.text) for m in of(sent, "STATUSTEXT")) == computed
    assert {m.custom_mode for m in of(sent, "HEARTBEAT")} == {int(Role[role.upper()])}


OWN_ADDRESS_FACTS = (
    OwnTransponder(AUTOPILOT, 0xA00001),
    Parameter(AUTOPILOT, "ADSB_ICAO_ID", float(0xA00001)),
)


@pytest.mark.parametrize("fact", OWN_ADDRESS_FACTS)
def test_own_transponder_is_no_traffic(fact: Fact) -> None:
    engine = new_engine()
    run(engine, [heartbeat(), fact], T0)
    for tick in range(30):
        now_s = T0 + tick / 10.0
        own = position(now_s)
        # 400 m behind: too far for an echo of another address.
        there = replace(traffic(now_s).report, lat_deg=own.lat_deg - 400.0 / 110_940.0, lon_deg=own.lon_deg)
        run(engine, [heartbeat(), own, Traffic(AUTOPILOT, there)], now_s)
        assert engine.snapshot(now_s).tracks == ()


@pytest.mark.parametrize("facts", [[one] for one in OWN_ADDRESS_FACTS] + [list(OWN_ADDRESS_FACTS)])
def test_an_address_that_is_said_to_be_ours_and_flies_elsewhere_is_traffic(facts: list[Fact]) -> None:
    engine = new_engine()
    run(engine, [heartbeat(), *facts], T0)
    sent = fly(engine, 5.0)
    assert [track.track_id for track in engine.snapshot(T0 + 4.9).tracks] == ["A00001"]
    texts = [str(message.text) for message in of(sent, "STATUSTEXT")]
    assert texts.count("A00001 is not our address, flies elsewhere") == 1


def test_barometric_heights_are_compared_by_pressure() -> None:
    """The altimeter setting is 100 m off: both aircraft read 100 m low, and are at the same height."""
    heights = []
    for fact in (None, PressureAltitude(AUTOPILOT, 784.0)):
        engine = new_engine()
        run(engine, [heartbeat(), position(T0)], T0)
        if fact is not None:
            engine.receive(fact, T0)
        low = traffic(T0)
        report = replace(low.report, altitude_m=784.0, altitude_reference=AltitudeReference.BAROMETRIC)
        run(engine, [Traffic(AUTOPILOT, report)], T0 + 0.1)
        (track,) = engine.snapshot(T0 + 0.1).tracks
        heights.append(-track.position_m[2])
    assert heights == [pytest.approx(784.0), pytest.approx(884.0)]


def test_without_a_position_there_is_no_decision_and_old_threats_are_not_repeated() -> None:
    engine = new_engine()
    fly(engine, 3.0)
    late = [m for tick in range(600) for m in run(engine, [heartbeat()], T0 + 3.0 + tick / 10)]
    assert engine.decision.layer is Layer.CLEAR
    assert len(of(late, "COLLISION")) <= 6
    assert engine.snapshot(T0 + 63.0).ownship is None


def test_facts_from_other_systems_and_from_ourselves_change_nothing() -> None:
    engine = new_engine()
    run(engine, [heartbeat(), position(T0)], T0)
    before = engine.snapshot(T0).ownship
    run(
        engine,
        [position(T0 + 60.0, OTHER), position(T0 + 60.0, Sender(1, 196)), position(T0 + 60, GCS)],
        T0 + 0.1,
    )
    after = engine.snapshot(T0).ownship
    assert engine.foreign == 2, "what we sent ourselves is not foreign"
    assert before is not None
    assert after is not None
    assert after.position_m == before.position_m


def test_the_local_frame_follows_the_aircraft() -> None:
    engine = new_engine()
    for kilometre in range(0, 60, 2):
        now_s = T0 + kilometre * 1000.0 / 22.0
        run(engine, [heartbeat(), position(now_s)], now_s)
    own = engine.snapshot(now_s).ownship
    assert own is not None
    assert math.hypot(*own.position_m[:2]) <= 5_000.0


def test_each_tick_with_a_known_position_gives_one_record() -> None:
    engine = new_engine()
    assert not any(isinstance(effect, Record) for effect in engine.tick(T0))
    engine.receive(heartbeat(), T0)
    engine.receive(position(T0), T0)
    (record,) = [effect for effect in engine.tick(T0 + 0.1) if isinstance(effect, Record)]
    line = json.loads(record.line)
    assert line["layer"] == "clear"
    assert line["time_us"] == round((T0 + 0.1) * 1e6)
    assert line["own"]["altitude_m"] == 884.0


def test_effects_formatted_later_show_the_state_of_their_own_tick() -> None:
    engine = new_engine()
    engine.receive(heartbeat(), T0)
    engine.receive(position(T0), T0)
    engine.operator.role = Role.ADVISE
    effects = engine.tick(T0 + 0.1)
    (record,) = [effect for effect in effects if isinstance(effect, Record)]
    (keep,) = [effect for effect in effects if isinstance(effect, Keep)]
    line, text = record.line, keep.text
    engine.operator.role = Role.OFF
    run(engine, [heartbeat(), position(T0 + 5.0)], T0 + 5.0)
    assert record.line == line
    assert keep.text == text
    assert text is not None
    saved = PersistedState.from_text(text)
    assert saved is not None
    assert (saved.time_s, saved.role) == (T0 + 0.1, Role.ADVISE)


@pytest.mark.parametrize("bad", [(math.nan, 22.0, 884.0), (0.0, math.inf, 884.0), (0.0, 22.0, math.nan)])
def test_guidance_that_is_not_finite_is_never_sent(bad: tuple[float, float, float]) -> None:
    class Broken(Avoider):
        def decide(self, *_: object) -> Decision:
            return Decision(Layer.OUTER, Guidance(*bad))

    engine = Engine(avoider=Broken(AvoidanceParams()))
    with pytest.raises(ValueError, match="guidance is not finite"):
        fly(engine, 20.0)


def test_stepper_ticks_on_tenths_of_a_second_before_later_facts() -> None:
    ticks: list[int] = []
    stepper = Stepper(new_engine(), lambda time_us, _: ticks.append(time_us))
    stepper.receive(heartbeat(), 1_050_000)
    stepper.receive(position(1.0), 1_250_000)
    assert ticks == [1_100_000, 1_200_000] or ticks == [1_050_000, 1_100_000, 1_200_000]
    stepper.advance(1_300_000)
    assert ticks[-1] == 1_300_000
    stepper.advance(1_300_000)
    assert ticks.count(1_300_000) == 1


def test_stepper_skips_ticks_after_a_long_stall() -> None:
    ticks: list[int] = []
    stepper = Stepper(new_engine(), lambda time_us, _: ticks.append(time_us), longest_stall_us=500_000)
    stepper.advance(1_000_000)
    stepper.advance(1_500_000)
    assert ticks == [1_000_000 + 100_000 * tick for tick in range(6)]
    stepper.advance(60_000_000)
    assert ticks[6:] == [60_000_000], "the gap is announced, and facts that arrived meanwhile come first"
    assert stepper.ticks == 6
    assert stepper.skipped_ticks == 585
    stepper.advance(60_100_000)
    assert ticks[-1] == 60_100_000
