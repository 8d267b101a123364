"""The fault table, what goes wrong on board: position, traffic, reboot, answers, its clock."""

import pytest

from companion.autopilots.commands import Outcome
from companion.control.state_machine import State
from companion.engine import EngineConfig
from companion.mavlink.dialect import mavlink
from companion.model import Layer
from companion.traffic import TrafficParams
from sim.scenario import Autopilot
from tests.support.autopilots import ARDUPILOT, BOTH, GUIDED_MODE, MISSION_MODE, PX4, in_turn, paired, ways
from tests.support.faulty_flight import CLIMBS, MEET_AT_S, FaultyFlight, faulty_flight
from tests.support.thorough import sample
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire

POSITION = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
SET_MODE, CHANGE_HEADING = mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_GUIDED_CHANGE_HEADING


def setpoints(flight: FaultyFlight, since_s: float) -> int:
    kind = "SET_POSITION_TARGET_GLOBAL_INT"
    return sum(message.get_type() == kind for message in flight.notes.commands(since_s))


@ways(ARDUPILOT, among=BOTH)
@in_virtual_time
async def test_with_an_old_position_nothing_is_taken_over(autopilot: Autopilot) -> None:
    async with faulty_flight(autopilot) as flight:
        flight.receiver.deaf = True
        await flight.until(lambda: flight.state is State.MONITOR)
        await flight.fly(2.0)
        flight.vehicle.withhold(POSITION, True)
        await flight.fly(0.6)
        flight.receiver.deaf = False
        await flight.until(lambda: flight.engine.decision.layer is Layer.OUTER, 1.3)
        assert flight.engine.hindrances(flight.now_s) == ["its position is old"]
        await flight.fly(2.0)
        assert flight.notes.commands() == []
        flight.vehicle.withhold(POSITION, False)
        await flight.until(lambda: flight.guided, 3.0)


@ways(PX4, among=BOTH)
@in_virtual_time
async def test_while_the_position_is_old_what_is_flown_goes_on(autopilot: Autopilot) -> None:
    async with faulty_flight(autopilot) as flight:
        await flight.engaged()
        flight.vehicle.withhold(POSITION, True)
        await flight.fly(2.3)
        stands = flight.engine.decision
        assert stands.layer is Layer.OUTER
        await flight.fly(2.2)
        assert flight.engine.decision is stands, "nothing is decided anew from a position of two seconds ago"
        assert flight.engine.supervisor.flying
        assert setpoints(flight, flight.now_s - 4.0) >= 16
        flight.vehicle.withhold(POSITION, False)
        await flight.fly(1.5)
        assert flight.engine.decision is not stands
        assert flight.modes == [MISSION_MODE[autopilot], GUIDED_MODE[autopilot]]


@paired("below_m", [0.0, 30.0], BOTH)
@in_virtual_time
async def test_without_a_position_the_aircraft_is_given_back(autopilot: Autopilot, below_m: float) -> None:
    async with faulty_flight(autopilot, below_m=below_m, engine=CLIMBS) as flight:
        await flight.engaged()
        await flight.fly(3.0)
        flight.vehicle.withhold(POSITION, True)
        await flight.until(lambda: flight.vehicle.truth.on_mission, 7.0)
        assert "Avoidance: own position lost" in flight.notes.texts()
        given_back_s = flight.now_s
        await flight.fly(5.0)
        assert flight.notes.commands(given_back_s + 1.0) == []
        flight.vehicle.withhold(POSITION, False)
        await flight.until(lambda: flight.guided, 5.0)


@ways(ARDUPILOT, among=BOTH)
@in_virtual_time
async def test_traffic_that_is_heard_no_more_is_forgotten_and_the_aircraft_given_back(
    autopilot: Autopilot,
) -> None:
    config = EngineConfig(traffic=TrafficParams(stale_s=8.0))
    async with faulty_flight(autopilot, engine=config) as flight:
        await flight.engaged()
        flight.receiver.deaf = True
        silent_s = flight.now_s
        await flight.fly(6.0)
        assert flight.engine.supervisor.flying
        await flight.resumed(200.0)
        # It is coasted past its meeting; ArduPlane repeats a report for five seconds; then the return.
        assert flight.now_s - silent_s < config.traffic.coast_s + 5.0 + 60.0
        assert flight.engagements == 1
        assert any("not heard for" in text for text in flight.notes.texts())


@ways(PX4, among=BOTH)
@in_virtual_time
async def test_an_autopilot_that_reboots_is_asked_everything_again(autopilot: Autopilot) -> None:
    async with faulty_flight(autopilot) as flight:
        flight.receiver.deaf = True
        await flight.until(lambda: flight.engine.queries.complete)
        await flight.fly(6.0)
        before = asked(flight)
        flight.vehicle.reboot(flight.vehicle.time_s)
        flight.receiver.deaf = False
        await flight.until(lambda: flight.guided, 20.0)
        await flight.fly(0.2)
        assert flight.vehicle.boots == 2
        assert flight.modes == [MISSION_MODE[autopilot], GUIDED_MODE[autopilot]]
        await flight.fly(12.0)
        again = asked(flight)
        for question in ("COMMAND_LONG 511", "PARAM_REQUEST_READ", "MISSION_REQUEST_LIST"):
            assert again.count(question) >= before.count(question) + 1
        assert flight.engine.rates_hz[POSITION] > 9.0
        await flight.resumed()
        assert not flight.nmac


def asked(flight: FaultyFlight) -> list[str]:
    """All that was asked, by kind."""
    return [
        f"{message.get_type()} {getattr(message, 'command', '')}".strip()
        for _, message in flight.notes.sent_messages
    ]


@in_virtual_time
async def test_arduplane_that_reboots_while_it_is_flown_is_flown_on() -> None:
    async with faulty_flight("ardupilot") as flight:
        await flight.engaged()
        flight.vehicle.reboot(flight.vehicle.time_s)
        await flight.fly(4.0)
        assert flight.engine.supervisor.flying
        assert flight.guided
        await flight.resumed()
        assert flight.modes == ["AUTO", "GUIDED", "AUTO"]
        assert not flight.nmac


@in_virtual_time
async def test_px4_that_reboots_while_it_is_flown_is_left_where_it_comes_up() -> None:
    async with faulty_flight("px4") as flight:
        await flight.engaged()
        flight.vehicle.reboot(flight.vehicle.time_s)
        await flight.until(lambda: flight.state is State.HANDS_OFF, 5.0)
        left_s = flight.now_s
        await flight.fly(8.0)
        assert flight.modes == ["MISSION", "OFFBOARD", "HOLD"]
        assert flight.notes.commands(left_s + 0.2) == []
        assert "Avoidance: hands off, mode changed, HOLD" in flight.notes.texts()
        flight.vehicle.set_mode("MISSION")
        await flight.until(lambda: flight.guided, 10.0)


@pytest.mark.parametrize("does", sample([False], [False, True]))
@in_virtual_time
async def test_a_heading_that_is_never_acknowledged_is_told_and_repeated(does: bool) -> None:
    async with faulty_flight("ardupilot") as flight:
        flight.vehicle.silence(CHANGE_HEADING, does=does)
        await flight.engaged()
        await flight.fly(4.0)
        assert "Avoidance: GUIDED_CHANGE_HEADING not answered" in flight.notes.texts()
        asked_lately = [getattr(m, "command", 0) for m in flight.notes.commands(flight.now_s - 3.0)]
        assert asked_lately.count(CHANGE_HEADING) >= 3
        adapter = flight.engine.aircraft.adapter
        assert adapter is not None
        assert adapter.commands.outcome(CHANGE_HEADING) in (Outcome.PENDING, Outcome.UNANSWERED)
        await flight.until(lambda: flight.now_s - flight.world.start_s > MEET_AT_S + 2.0, 90.0)
        assert not flight.nmac, "height and speed are still obeyed"
        assert setpoints(flight, flight.now_s - 2.0) >= 8


@ways(PX4, among=BOTH)
@in_virtual_time
async def test_a_mode_change_that_is_never_acknowledged_is_seen_in_the_heartbeat(
    autopilot: Autopilot,
) -> None:
    async with faulty_flight(autopilot) as flight:
        flight.vehicle.silence(SET_MODE, does=True)
        await flight.engaged()
        await flight.resumed()
        asked_for = [m for m in flight.notes.commands() if getattr(m, "command", 0) == SET_MODE]
        assert len(asked_for) == 2
        assert not flight.nmac


@ways(ARDUPILOT, among=BOTH)
@in_virtual_time
async def test_a_mode_change_that_is_never_done_is_told_and_asked_again(autopilot: Autopilot) -> None:
    async with faulty_flight(autopilot) as flight:
        flight.vehicle.silence(SET_MODE, does=False)
        await flight.until(lambda: "Avoidance: autopilot did not answer" in flight.notes.texts(), 10.0)
        told_s = flight.now_s
        await flight.fly(15.0)
        asked_for = [m for m in flight.notes.commands(told_s) if getattr(m, "command", 0) == SET_MODE]
        assert 3 <= len(asked_for) <= 12
        assert flight.modes == [MISSION_MODE[autopilot]]
        flight.vehicle.silence(SET_MODE, does=None)
        await flight.until(lambda: flight.guided, 15.0)


@in_turn("error_s", sample([-3600.0, 3600.0], [-3600.0, 3600.0]), first=1)
@in_virtual_time
async def test_a_step_of_the_autopilots_clock_changes_nothing(autopilot: Autopilot, error_s: float) -> None:
    async with faulty_flight(autopilot) as flight:
        await flight.engaged()
        flight.vehicle.set_clock(error_s)
        await flight.fly(10.0)
        assert flight.engine.aircraft.contact.clock_offset_s == pytest.approx(error_s, abs=0.5), "it was told"
        assert flight.engine.supervisor.flying
        assert flight.modes == [MISSION_MODE[autopilot], GUIDED_MODE[autopilot]]
