"""The aircraft goes back to what it did before: a mission, a circle, a course, a place to fly to."""

import math

import pytest

from companion.engine import Engine, EngineConfig
from companion.mavlink.dialect import mavlink
from companion.supervisor import State, SupervisorParams
from sim.closed_loop import ClosedLoop
from sim.scenario import load_scenario
from sim.traffic import Intruder
from sim.vehicle import Mode


class Standing(ClosedLoop):
    """No mission traffic: the aircraft does something else, and one intruder comes from the north."""

    def __init__(self, *modes: str) -> None:
        config = EngineConfig(supervisor=SupervisorParams(take_over_from=modes))
        super().__init__(load_scenario("clear"), Engine(config))
        self.run(5.0)

    def intrude(self, north_m: float, east_m: float, height_m: float, *, after_s: float) -> None:
        """Somebody flies south through that place, so many seconds from now."""
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
        """The states one after the other."""
        assert self.engine is not None
        seen = [self.engine.supervisor.state]
        for _ in range(round(seconds * 20)):
            self._now_us += 50_000
            self._step()
            if self.engine.supervisor.state is not seen[-1]:
                seen.append(self.engine.supervisor.state)
        return seen


def test_a_circle_is_flown_again_around_its_centre() -> None:
    loop = Standing("LOITER")
    loop.world.vehicle.set_mode(Mode.LOITER)
    loop.run(5.0)
    north_m, east_m, down_m = loop.world.vehicle.truth.position_m
    centre = loop.world.vehicle.flight.target
    assert centre is not None
    centre_m = loop.world.frame.to_ned_m(centre)
    loop.intrude(north_m, east_m, -down_m, after_s=60.0)
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


def test_a_course_is_flown_again() -> None:
    loop = Standing("CRUISE")
    loop.world.vehicle.set_mode(Mode.CRUISE)
    loop.run(3.0)
    before = loop.world.vehicle.truth
    course_rad = math.atan2(before.velocity_mps[1], before.velocity_mps[0])
    ahead_m = 22.0 * 70.0
    loop.intrude(
        before.position_m[0] + ahead_m * math.cos(course_rad),
        before.position_m[1] + ahead_m * math.sin(course_rad),
        -before.position_m[2],
        after_s=70.0,
    )
    seen = loop.states(200.0)
    assert State.RETURNING in seen
    assert seen[-1] is State.MONITOR
    truth = loop.world.vehicle.truth
    assert truth.mode == "CRUISE"
    assert abs(math.atan2(truth.velocity_mps[1], truth.velocity_mps[0]) - course_rad) < math.radians(6.0)
    assert abs(truth.position_m[2] - before.position_m[2]) < 15.0


def guided(loop: Standing, north_m: float) -> tuple[int, int]:
    """A ground station sends the aircraft to a place in the north, as DO_REPOSITION does."""
    truth = loop.world.vehicle.truth
    place = loop.world.frame.to_geo(truth.position_m[0] + north_m, truth.position_m[1], truth.position_m[2])
    lat_e7, lon_e7 = round(place.lat_deg * 1e7), round(place.lon_deg * 1e7)
    loop.command_int(192, -1.0, 1.0, place=(lat_e7, lon_e7, place.altitude_m))
    return lat_e7, lon_e7


def test_the_target_of_guided_is_flown_to_again() -> None:
    loop = Standing("GUIDED")
    lat_e7, lon_e7 = guided(loop, 4000.0)
    loop.run(3.0)
    truth = loop.world.vehicle.truth
    loop.intrude(truth.position_m[0] + 22.0 * 60.0, truth.position_m[1], -truth.position_m[2], after_s=60.0)
    seen = loop.states(150.0)
    assert State.OUTER in seen
    assert seen[-1] is State.MONITOR
    guided_targets = loop.world.vehicle.flight.guided
    assert loop.world.vehicle.truth.mode == "GUIDED"
    assert guided_targets.course_rad is None
    assert guided_targets.centre.lat_deg == pytest.approx(lat_e7 / 1e7, abs=1e-6)
    assert guided_targets.centre.lon_deg == pytest.approx(lon_e7 / 1e7, abs=1e-6)


def test_another_target_in_guided_is_somebody_elses_word() -> None:
    loop = Standing("GUIDED")
    guided(loop, 4000.0)
    loop.run(3.0)
    truth = loop.world.vehicle.truth
    loop.intrude(truth.position_m[0] + 22.0 * 60.0, truth.position_m[1], -truth.position_m[2], after_s=60.0)
    assert loop.engine is not None
    for _ in range(2000):
        loop.run(0.1)
        if loop.engine.supervisor.state is State.OUTER:
            break
    loop.run(4.0)
    lat_e7, _ = guided(loop, -3000.0)
    loop.run(1.5)
    assert loop.engine.supervisor.state is State.HANDS_OFF
    loop.run(3.0)
    assert loop.world.vehicle.flight.guided.centre.lat_deg == pytest.approx(lat_e7 / 1e7, abs=1e-6)


def test_a_mission_that_starts_anew_is_sent_to_its_item() -> None:
    loop = ClosedLoop(load_scenario("head-on"), Engine())
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
