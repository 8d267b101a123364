"""An override ends the avoidance within one tick and is respected, on both autopilots."""

import pytest

from companion.avoidance import AvoidanceParams
from companion.control.state_machine import State, SupervisorParams
from companion.engine import EngineConfig
from companion.mavlink.dialect import mavlink
from sim.scenario import Autopilot
from tests.support.autopilots import ALL, ARDUPILOT, GUIDED_MODE, MISSION_MODE, PX4, PX4_1_18, every
from tests.support.monitored_loop import MonitoredLoop, without_traffic
from tests.support.overrides import (
    COMMON,
    FAILSAFE,
    HOLDS,
    OVERRIDES,
    STATES,
    STICKS,
    TICK_US,
    Override,
    in_state,
    mode_change,
)
from tests.support.thorough import THOROUGH, sample


def override(loop: MonitoredLoop, way: Override, during_s: float) -> None:
    """Override; check that the avoidance ends with the next tick and no command follows."""
    way.act(loop)
    reported_us = loop.until_reported(way.shows)
    loop.step()
    loop.step()
    ended = loop.state
    assert ended in (State.HANDS_OFF, State.SUPPRESSED)
    ended_us = loop.entered_us(ended)
    assert ended_us - reported_us <= TICK_US
    assert any("hands off" in text for text in loop.flight.texts[-3:])
    loop.run(during_s)
    assert loop.state is ended
    assert loop.sent_since(ended) == []


def _flown(autopilot: Autopilot, place: int) -> bool:
    """Each override is flown in one of the four states in each way of flying."""
    return autopilot == (ARDUPILOT, PX4, None, PX4_1_18)[place % 4]


CASES = [
    pytest.param(autopilot, state, way, id=f"{autopilot}-{state}-{way}")
    for autopilot in ALL
    for state in STATES
    for place, way in enumerate(OVERRIDES[autopilot])
    if THOROUGH or str(way) == MISSION_MODE[autopilot] or _flown(autopilot, place + list(STATES).index(state))
    # The mission mode is no override while we request it or it is still the present mode.
    if not (str(way) == MISSION_MODE[autopilot] and state in (State.ENGAGING, State.RELEASING))
]


@pytest.mark.parametrize(("autopilot", "state", "way"), CASES)
def test_an_override_ends_the_avoidance_within_one_tick(
    autopilot: Autopilot, state: State, way: Override
) -> None:
    override(in_state(autopilot, state), way, during_s=2.0)


RETURN_ENDED_BY = [*COMMON, *map(mode_change, ("MANUAL", "LOITER", "RTL"))]


@pytest.mark.parametrize("way", sample(RETURN_ENDED_BY[::2], RETURN_ENDED_BY), ids=str)
def test_an_override_ends_the_return_to_a_loiter(way: Override) -> None:
    override(returning(), way, during_s=2.0)


def returning() -> MonitoredLoop:
    """A flight on its return to the loiter before the avoidance."""
    config = EngineConfig(supervisor=SupervisorParams(take_over_from=("LOITER",)))
    loop = MonitoredLoop(without_traffic(), config=config)
    loop.world.vehicle.set_mode("LOITER")
    loop.run(2.5)
    loop.intrude(1500.0, goes_s=10.0)
    loop.until(State.RETURNING, limit_s=40.0)
    loop.run(0.3)
    return loop


OTHER_MODE = {ARDUPILOT: "FBWA", PX4: "ALTCTL", PX4_1_18: "ALTCTL"}


@every
def test_avoidance_resumes_only_after_settling_in_an_allowed_mode(autopilot: Autopilot) -> None:
    settle_s = 2.0
    config = EngineConfig(supervisor=SupervisorParams(settle_s=settle_s))
    loop = in_state(autopilot, State.OUTER, config)
    override(loop, mode_change(OTHER_MODE[autopilot]), during_s=3.0 * settle_s)
    back = mode_change(MISSION_MODE[autopilot])
    back.act(loop)
    back_us = loop.until_reported(back.shows)
    loop.until(State.ENGAGING, limit_s=settle_s + 1.0)
    assert loop.entered_us(State.ENGAGING) - back_us >= settle_s * 1e6
    loop.until(State.OUTER, limit_s=2.0)


@every
def test_a_short_mode_change_restarts_the_settling_time(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(settle_s=2.0))
    loop = in_state(autopilot, State.OUTER, config)
    override(loop, mode_change(OTHER_MODE[autopilot]), during_s=1.0)
    for _ in range(3):
        loop.world.vehicle.set_mode(MISSION_MODE[autopilot])
        loop.run(1.5)
        loop.world.vehicle.set_mode(OTHER_MODE[autopilot])
        loop.run(1.5)
    assert loop.state is State.HANDS_OFF
    assert loop.sent_since(State.HANDS_OFF) == []


@pytest.mark.parametrize("way", [STICKS, FAILSAFE], ids=str)
def test_unattended_guided_is_released(way: Override) -> None:
    abandoned_s = 2.0
    config = EngineConfig(supervisor=SupervisorParams(abandoned_s=abandoned_s, settle_s=60.0))
    loop = in_state(ARDUPILOT, State.OUTER, config)
    override(loop, way, during_s=1.0)
    if way is STICKS:
        loop.run(2.0 * abandoned_s)
        assert loop.mode_name == GUIDED_MODE[ARDUPILOT], "overridden while the stick is deflected"
        loop.world.vehicle.move_sticks()
    else:
        loop.world.vehicle.fail_safe(False)
    let_go_us = loop.now_us
    loop.until_true(lambda: loop.mode_name == MISSION_MODE[ARDUPILOT], limit_s=2.0 * abandoned_s)
    if way is STICKS:
        assert loop.now_us - let_go_us >= abandoned_s * 1e6
    loop.run(1.0)
    assert not loop.engine.supervisor.flying


@every
def test_after_released_sticks_guided_is_not_left_unattended(autopilot: Autopilot) -> None:
    """PX4 leaves OFFBOARD by itself when our stream ends, without a release; GUIDED_COURSE stays."""
    loop = in_state(autopilot, State.OUTER, EngineConfig(supervisor=SupervisorParams(settle_s=60.0)))
    override(loop, STICKS, during_s=1.0)
    loop.world.vehicle.move_sticks()
    loop.run(8.0)
    assert loop.mode_name == {ARDUPILOT: "AUTO", PX4: "HOLD", PX4_1_18: "MISSION"}[autopilot]
    if autopilot == PX4:
        assert loop.sent_since(State.HANDS_OFF) == []


def test_a_height_by_the_ground_station_in_guided_course_is_left_alone() -> None:
    """It leaves the mode; only the reported target shows it."""
    loop = in_state(PX4_1_18, State.OUTER)
    loop.run(4.0)
    vehicle = loop.world.vehicle
    theirs_m = vehicle.truth.place.altitude_m + 33.0
    order = mavlink.MAVLink_command_long_message(
        1, 1, mavlink.MAV_CMD_DO_CHANGE_ALTITUDE, 0, theirs_m, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )
    order.get_header().srcSystem, order.get_header().srcComponent = 255, 190
    vehicle.receive(order, loop.now_s, 0)
    loop.until(State.HANDS_OFF, limit_s=2.0)
    loop.run(20.0)
    assert loop.sent_since(State.HANDS_OFF) == []
    assert loop.mode_name == "GUIDED_COURSE"
    assert any("hands off, another target" in text for text in loop.flight.texts)
    assert vehicle.truth.place.altitude_m == pytest.approx(theirs_m, abs=6.0)


# --- the autopilot's own avoidance

NEAR = {
    ARDUPILOT: {"AVD_ENABLE": 1.0, "AVD_F_ACTION": 2.0, "AVD_F_DIST_XY": 2500.0},
    PX4: {"NAV_TRAFF_AVOID": 2.0, "NAV_TRAFF_A_HOR": 2500.0, **HOLDS},
    PX4_1_18: {"DAA_LVL_HIGH_ACT": 2.0, "DAA_LVL_HIGH_RAD": 1250.0},
}
FOUND = {
    ARDUPILOT: "AVD_ENABLE with AVD_F_ACTION 2",
    PX4: "NAV_TRAFF_AVOID 2",
    PX4_1_18: "DAA_LVL_HIGH_ACT 2",
}
ACTS = {ARDUPILOT: "AVOID_ADSB", PX4: "RETURN", PX4_1_18: "RETURN"}


@every
def test_beside_another_avoider_it_only_advises_and_reports_that_once(autopilot: Autopilot) -> None:
    loop = MonitoredLoop(without_traffic(), autopilot=autopilot, parameters=NEAR[autopilot])
    loop.run(12.0)
    loop.intrude(3500.0, goes_s=12.0)
    loop.run(15.0)
    assert loop.sent == []
    texts = loop.flight.texts
    assert sum("avoids too" in text for text in texts) == 1
    assert any(FOUND[autopilot] in "".join(texts) for _ in texts)
    assert any("Advise " in text and "SUDDEN" in text for text in texts), "still announced"


@every
def test_configured_to_fly_beside_it_avoidance_ends_when_it_acts(autopilot: Autopilot) -> None:
    config = EngineConfig(
        supervisor=SupervisorParams(beside_other_avoider="fly"), avoidance=AvoidanceParams(reserve_s=60.0)
    )
    loop = MonitoredLoop(without_traffic(), autopilot=autopilot, parameters=NEAR[autopilot], config=config)
    loop.run(8.0)
    loop.intrude(3500.0)
    loop.until(State.OUTER, limit_s=5.0)
    action = mode_change(ACTS[autopilot])
    reported_us = loop.until_reported(action.shows, limit_s=30.0)
    loop.step()
    loop.step()
    assert loop.state is State.HANDS_OFF
    assert loop.entered_us(State.HANDS_OFF) - reported_us <= TICK_US
    loop.run(5.0)
    assert loop.sent_since(State.HANDS_OFF) == []
