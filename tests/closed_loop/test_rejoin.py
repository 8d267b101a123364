"""After an avoidance the aircraft resumes its prior flight: mission, loiter, course or guided target."""

import math
from dataclasses import replace

import pytest

from companion.control.state_machine import State, SupervisorParams
from companion.engine import Engine, EngineConfig
from companion.mavlink.dialect import mavlink
from companion.units import WELL_CLEAR_HORIZONTAL_M, WELL_CLEAR_VERTICAL_M
from sim.closed_loop import ClosedLoop
from sim.scenario import Autopilot, load_scenario
from sim.traffic import Intruder, Maneuver
from sim.vehicle import Mode, Px4Mode
from tests.support.short_scenario import shorter
from tests.support.thorough import sample


class OtherModes(ClosedLoop):
    """A flight in other modes than the mission, with one intruder from the north."""

    def __init__(self, *modes: str, autopilot: Autopilot = "ardupilot") -> None:
        config = EngineConfig(supervisor=SupervisorParams(take_over_from=modes))
        # The mission is not flown, so a short duration is enough.
        scenario = replace(load_scenario("clear"), intruders=(), duration_s=1.0)
        super().__init__(scenario, Engine(config), autopilot=autopilot)
        self.run(5.0)

    def intrude(self, north_m: float, east_m: float, height_m: float, *, after_s: float) -> None:
        """Add a southbound intruder that passes a place in `after_s`."""
        now_s = self._now_us / 1e6
        self.world.receiver.add(
            Intruder(
                0xABCDEF,
                "SOUTH",
                now_s + after_s,
                (north_m, east_m, -height_m),
                (-50.0, 0.0, 0.0),
                appears_s=now_s + 1.0,
            )
        )

    def command_int(self, command: int, *params: float, place: tuple[int, int, float] = (0, 0, 0.0)) -> None:
        padded = [*params, *([0.0] * (4 - len(params)))]
        message = mavlink.MAVLink_command_int_message(1, 1, 0, command, 0, 0, *padded, *place)
        message.get_header().srcSystem = 255
        self.world.vehicle.receive(message, self._now_us / 1e6, 1)

    def states(self, seconds: float) -> list[State]:
        """The sequence of states, until MONITOR after an avoidance."""
        assert self.engine is not None
        seen = [self.engine.supervisor.state]
        for _ in range(round(seconds * 20)):
            self._now_us += 50_000
            self._step()
            if self.engine.supervisor.state is not seen[-1]:
                seen.append(self.engine.supervisor.state)
                if seen[-1] is State.MONITOR and State.OUTER in seen:
                    self.run(5.0)
                    break
        return seen


def test_a_loiter_is_resumed_around_its_centre() -> None:
    loop = OtherModes("LOITER")
    loop.world.vehicle.set_mode(Mode.LOITER)
    loop.run(5.0)
    north_m, east_m, down_m = loop.world.vehicle.truth.position_m
    centre = loop.world.vehicle.flight.target
    assert centre is not None
    centre_m = loop.world.frame.to_ned_m(centre)
    loop.intrude(north_m, east_m, -down_m, after_s=45.0)
    seen = loop.states(150.0)
    assert State.OUTER in seen
    assert State.RETURNING in seen
    assert seen[-1] is State.MONITOR
    truth = loop.world.vehicle.truth
    assert truth.mode == "LOITER"
    flown = loop.world.vehicle.flight.target
    assert flown is not None
    assert math.dist(loop.world.frame.to_ned_m(flown)[:2], centre_m[:2]) < 80.0
    assert abs(truth.position_m[2] - centre_m[2]) < 15.0


def test_a_course_is_resumed() -> None:
    loop = OtherModes("CRUISE")
    loop.world.vehicle.set_mode(Mode.CRUISE)
    loop.run(3.0)
    before = loop.world.vehicle.truth
    course_rad = math.atan2(before.velocity_mps[1], before.velocity_mps[0])
    ahead_m = 22.0 * 50.0
    loop.intrude(
        before.position_m[0] + ahead_m * math.cos(course_rad),
        before.position_m[1] + ahead_m * math.sin(course_rad),
        -before.position_m[2],
        after_s=50.0,
    )
    seen = loop.states(200.0)
    assert State.RETURNING in seen
    assert seen[-1] is State.MONITOR
    truth = loop.world.vehicle.truth
    assert truth.mode == "CRUISE"
    assert abs(math.atan2(truth.velocity_mps[1], truth.velocity_mps[0]) - course_rad) < math.radians(6.0)
    assert abs(truth.position_m[2] - before.position_m[2]) < 15.0


def guided(loop: OtherModes, north_m: float) -> tuple[int, int]:
    """Send DO_REPOSITION to a place in the north, as a ground station."""
    truth = loop.world.vehicle.truth
    place = loop.world.frame.to_geo(truth.position_m[0] + north_m, truth.position_m[1], truth.position_m[2])
    lat_e7, lon_e7 = round(place.lat_deg * 1e7), round(place.lon_deg * 1e7)
    loop.command_int(192, -1.0, 1.0, place=(lat_e7, lon_e7, place.altitude_m))
    return lat_e7, lon_e7


def test_a_guided_target_is_resumed() -> None:
    loop = OtherModes("GUIDED")
    lat_e7, lon_e7 = guided(loop, 4000.0)
    loop.run(3.0)
    truth = loop.world.vehicle.truth
    loop.intrude(truth.position_m[0] + 22.0 * 45.0, truth.position_m[1], -truth.position_m[2], after_s=45.0)
    seen = loop.states(150.0)
    assert State.OUTER in seen
    assert seen[-1] is State.MONITOR
    guided_targets = loop.world.vehicle.flight.guided
    assert loop.world.vehicle.truth.mode == "GUIDED"
    assert guided_targets.course_rad is None
    assert guided_targets.centre.lat_deg == pytest.approx(lat_e7 / 1e7, abs=1e-6)
    assert guided_targets.centre.lon_deg == pytest.approx(lon_e7 / 1e7, abs=1e-6)


def test_another_guided_target_overrides_the_avoidance() -> None:
    loop = OtherModes("GUIDED")
    guided(loop, 4000.0)
    loop.run(3.0)
    truth = loop.world.vehicle.truth
    loop.intrude(truth.position_m[0] + 22.0 * 45.0, truth.position_m[1], -truth.position_m[2], after_s=45.0)
    assert loop.engine is not None
    for _ in range(2000):
        loop.run(0.1)
        if loop.engine.supervisor.state is State.OUTER:
            break
    loop.run(4.0)
    lat_e7, _ = guided(loop, -3000.0)
    loop.run(1.5)
    assert loop.engine.supervisor.state is State.SUPPRESSED
    loop.run(3.0)
    assert loop.world.vehicle.flight.guided.centre.lat_deg == pytest.approx(lat_e7 / 1e7, abs=1e-6)


def test_a_mission_that_restarts_is_set_to_its_item() -> None:
    loop = ClosedLoop(shorter("head-on"), Engine())
    while loop.engine is not None and loop.engine.supervisor.state is not State.OUTER:
        loop.run(0.5)
    assert loop.world.vehicle.truth.mission_sequence == 2
    flight = loop.world.vehicle.flight
    start_or_resume = flight._start_or_resume

    def restart() -> None:
        flight.mission.select(1)  # as with MIS_RESTART 1
        start_or_resume()

    flight._start_or_resume = restart  # type: ignore[method-assign]
    while loop.engine.supervisor.state is not State.MONITOR:
        loop.run(0.5)
    flight._start_or_resume = start_or_resume  # type: ignore[method-assign]
    loop.run(5.0)
    assert loop.world.vehicle.truth.mission_sequence == 2


# --- PX4


def test_px4_resumes_its_hold_position() -> None:
    loop = OtherModes("HOLD", autopilot="px4")
    loop.world.vehicle.set_mode(Px4Mode.HOLD)
    loop.run(5.0)
    centre = loop.world.vehicle.flight.target
    assert centre is not None
    centre_m = loop.world.frame.to_ned_m(centre)
    loop.intrude(centre_m[0], centre_m[1], -centre_m[2], after_s=45.0)
    seen = loop.states(90.0)
    assert State.OUTER in seen
    assert seen[-1] is State.MONITOR
    truth = loop.world.vehicle.truth
    assert truth.mode == "HOLD"
    assert not loop.flight.uncontrolled
    circled = loop.world.vehicle.flight.target
    assert circled is not None
    assert math.dist(loop.world.frame.to_ned_m(circled)[:2], centre_m[:2]) < 1.0
    assert abs(circled.altitude_m + centre_m[2]) < 15.0


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_after_a_restart_in_a_conflict_the_mission_is_read_before_the_take_over(autopilot: Autopilot) -> None:
    loop = ClosedLoop(load_scenario("clear"), Engine(), autopilot=autopilot)
    truth = loop.world.vehicle.truth
    north_m, east_m, down_m = truth.position_m
    loop.world.receiver.add(
        Intruder(0xABCDEF, "SOUTH", truth.time_s, (north_m + 5000.0, east_m, down_m), (-60.0, 0.0, 0.0))
    )
    assert loop.engine is not None
    while loop.engine.supervisor.state is not State.OUTER:
        loop.run(0.1)
    assert loop.flight.modes[-1][0] < 10.0
    goal = loop.engine.snapshot(loop.world.vehicle.time_s).goal
    assert goal is not None
    assert goal.position_m is not None
    waypoint = loop.scenario.mission.waypoints[-1]
    to_go_m = waypoint.north_m - loop.world.vehicle.truth.position_m[0]
    assert goal.position_m[0] > 0.9 * to_go_m


# --- no return that leads back into the conflict


SIDES: list[tuple[Autopilot, float]] = [("px4", -1.0), ("ardupilot", 1.0)]


@pytest.mark.parametrize(("autopilot", "side"), sample(SIDES[:1], SIDES))
def test_no_release_while_an_intruder_stays_alongside(autopilot: Autopilot, side: float) -> None:
    """The intruder converges, turns onto our course, flies alongside, and then leaves."""
    loop = ClosedLoop(replace(load_scenario("clear"), intruders=()), Engine(), autopilot=autopilot)
    loop.run(4.0)  # its mission is read
    truth = loop.world.vehicle.truth
    (north_m, east_m, down_m), began_s = truth.position_m, truth.time_s
    turn_rps, turning_s = side * math.atan2(15.0, 20.0) / 5.0, 5.0
    intruder = Intruder(
        0xABCDEF,
        "BESIDE",
        began_s,
        (north_m + 200.0, east_m + side * 1100.0, down_m),
        (20.0, -15.0 * side, 0.0),
        maneuvers=(
            Maneuver(began_s + 60.0, turn_rate_rps=turn_rps),
            Maneuver(began_s + 60.0 + turning_s),
            Maneuver(began_s + 90.0, climb_mps=-30.0),
        ),
        appears_s=began_s,
    )
    loop.world.receiver.add(intruder)
    for _ in range(90):
        loop.run(1.0)
        assert separation(loop, intruder) >= 1.0
    assert loop.flight.engagements == 1
    assert loop.world.vehicle.truth.companion_flies
    loop.run(60.0)
    assert loop.world.vehicle.truth.on_mission
    assert loop.flight.engagements == 1
    assert not loop.flight.uncontrolled


def separation(loop: ClosedLoop, intruder: Intruder) -> float:
    """The present separation relative to well clear: 1 or more is clear."""
    here_m = loop.world.vehicle.truth.position_m
    there_m, _ = intruder.state_at(loop.world.vehicle.time_s)
    horizontal = math.dist(here_m[:2], there_m[:2]) / WELL_CLEAR_HORIZONTAL_M
    return max(horizontal, abs(here_m[2] - there_m[2]) / WELL_CLEAR_VERTICAL_M)
