"""Whoever takes the aircraft from us has it within one tick, and keeps it: on both autopilots."""

import pytest

from companion.control.state_machine import State, SupervisorParams
from companion.engine import EngineConfig
from sim.scenario import Autopilot
from tests.support.takings import (
    ARDUPILOT,
    BOTH,
    COMMON,
    FAILSAFE,
    GUIDED_MODE,
    HOLDS,
    MISSION_MODE,
    PX4,
    STATES,
    STICKS,
    TICK_US,
    WAYS,
    Taking,
    begun,
    mode,
)
from tests.support.watched import Watched, alone

both = pytest.mark.parametrize("autopilot", BOTH)


def taken(loop: Watched, way: Taking, during_s: float) -> None:
    """Somebody takes it: ours ends with the next tick, and nothing is commanded from then on."""
    way.does(loop)
    said_us = loop.until_said(way.says)
    loop.step()
    loop.step()
    ended = loop.state
    assert ended in (State.HANDS_OFF, State.SUPPRESSED)
    ended_us = loop.entered_us(ended)
    assert ended_us - said_us <= TICK_US
    assert "hands off" in loop.flight.texts[-1]
    loop.run(during_s)
    assert loop.state is ended
    assert loop.sent_since(ended) == []


CASES = [
    pytest.param(autopilot, state, way, id=f"{autopilot}-{state}-{way}")
    for autopilot in BOTH
    for state in STATES
    for way in WAYS[autopilot]
    # What we asked for ourselves is nobody else's choice; nor is what it still is.
    if not (str(way) == MISSION_MODE[autopilot] and state in (State.ENGAGING, State.RELEASING))
]


@pytest.mark.parametrize(("autopilot", "state", "way"), CASES)
def test_whoever_takes_the_aircraft_has_it_within_one_tick(
    autopilot: Autopilot, state: State, way: Taking
) -> None:
    taken(begun(autopilot, state), way, during_s=2.0)


@pytest.mark.parametrize("way", [*COMMON, *map(mode, ("MANUAL", "LOITER", "RTL"))], ids=str)
def test_nor_is_it_flown_back_for_its_circle_when_somebody_takes_it(way: Taking) -> None:
    taken(returning(), way, during_s=2.0)


def returning() -> Watched:
    """On the way back to the circle that was flown before."""
    config = EngineConfig(supervisor=SupervisorParams(take_over_from=("LOITER",)))
    loop = Watched(alone(), config=config)
    loop.world.vehicle.set_mode("LOITER")
    loop.run(2.5)
    loop.intrude(1500.0, goes_s=10.0)
    loop.until(State.RETURNING, limit_s=40.0)
    loop.run(0.3)
    return loop


OTHER_MODE = {ARDUPILOT: "FBWA", PX4: "ALTCTL"}


@both
def test_taken_up_again_only_after_it_settled_in_an_allowed_mode(autopilot: Autopilot) -> None:
    settle_s = 2.0
    config = EngineConfig(supervisor=SupervisorParams(settle_s=settle_s))
    loop = begun(autopilot, State.OUTER, config)
    taken(loop, mode(OTHER_MODE[autopilot]), during_s=3.0 * settle_s)
    back = mode(MISSION_MODE[autopilot])
    back.does(loop)
    back_us = loop.until_said(back.says)
    loop.until(State.ENGAGING, limit_s=settle_s + 1.0)
    assert loop.entered_us(State.ENGAGING) - back_us >= settle_s * 1e6
    loop.until(State.OUTER, limit_s=2.0)


@both
def test_out_of_the_allowed_mode_for_a_moment_it_has_to_settle_anew(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(settle_s=2.0))
    loop = begun(autopilot, State.OUTER, config)
    taken(loop, mode(OTHER_MODE[autopilot]), during_s=1.0)
    for _ in range(3):
        loop.world.vehicle.set_mode(MISSION_MODE[autopilot])
        loop.run(1.5)
        loop.world.vehicle.set_mode(OTHER_MODE[autopilot])
        loop.run(1.5)
    assert loop.state is State.HANDS_OFF
    assert loop.sent_since(State.HANDS_OFF) == []


@pytest.mark.parametrize("way", [STICKS, FAILSAFE], ids=str)
def test_guided_that_was_abandoned_is_given_back(way: Taking) -> None:
    abandoned_s = 2.0
    config = EngineConfig(supervisor=SupervisorParams(abandoned_s=abandoned_s, settle_s=60.0))
    loop = begun(ARDUPILOT, State.OUTER, config)
    taken(loop, way, during_s=1.0)
    if way is STICKS:
        loop.run(2.0 * abandoned_s)
        assert loop.mode_name == GUIDED_MODE[ARDUPILOT], "his as long as he holds the stick"
        loop.world.vehicle.move_sticks()
    else:
        loop.world.vehicle.fail_safe(False)
    let_go_us = loop.now_us
    loop.until_so(lambda: loop.mode_name == MISSION_MODE[ARDUPILOT], limit_s=2.0 * abandoned_s)
    if way is STICKS:
        assert loop.now_us - let_go_us >= abandoned_s * 1e6
    loop.run(1.0)
    assert not loop.engine.supervisor.flying


@both
def test_sticks_let_go_leave_nobody_in_a_mode_that_nobody_flies(autopilot: Autopilot) -> None:
    """PX4 leaves it by itself, as our stream has ended: then nothing is to be given back."""
    loop = begun(autopilot, State.OUTER, EngineConfig(supervisor=SupervisorParams(settle_s=60.0)))
    taken(loop, STICKS, during_s=1.0)
    loop.world.vehicle.move_sticks()
    loop.run(8.0)
    assert loop.mode_name == {ARDUPILOT: "AUTO", PX4: "HOLD"}[autopilot]
    if autopilot == PX4:
        assert loop.sent_since(State.HANDS_OFF) == []


# --- the autopilot's own avoidance

NEAR = {
    ARDUPILOT: {"AVD_ENABLE": 1.0, "AVD_F_ACTION": 2.0, "AVD_F_DIST_XY": 2500.0},
    PX4: {"NAV_TRAFF_AVOID": 2.0, "NAV_TRAFF_A_HOR": 2500.0, **HOLDS},
}
FOUND = {ARDUPILOT: "AVD_ENABLE with AVD_F_ACTION 2", PX4: "NAV_TRAFF_AVOID 2"}
ACTS = {ARDUPILOT: "AVOID_ADSB", PX4: "RETURN"}


@both
def test_beside_another_avoider_we_only_advise_and_say_so_once(autopilot: Autopilot) -> None:
    loop = Watched(alone(), autopilot=autopilot, parameters=NEAR[autopilot])
    loop.run(12.0)
    loop.intrude(3500.0, goes_s=12.0)
    loop.run(15.0)
    assert loop.sent == []
    texts = loop.flight.texts
    assert sum("avoids too" in text for text in texts) == 1
    assert any(FOUND[autopilot] in "".join(texts) for _ in texts)
    assert any(text.startswith("Traffic SUDDEN") for text in texts), "announced all the same"


@both
def test_told_to_fly_beside_it_we_do_until_it_acts(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(beside_other_avoider="fly"))
    loop = Watched(alone(), autopilot=autopilot, parameters=NEAR[autopilot], config=config)
    loop.run(8.0)
    loop.intrude(3500.0)
    loop.until(State.OUTER, limit_s=5.0)
    acts = mode(ACTS[autopilot])
    said_us = loop.until_said(acts.says, limit_s=30.0)
    loop.step()
    loop.step()
    assert loop.state is State.HANDS_OFF
    assert loop.entered_us(State.HANDS_OFF) - said_us <= TICK_US
    loop.run(5.0)
    assert loop.sent_since(State.HANDS_OFF) == []
