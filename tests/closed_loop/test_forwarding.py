"""Traffic that only our receiver hears, sent on to an autopilot: its own avoidance, and ours."""

from collections.abc import Sequence
from dataclasses import replace

from companion.engine import Engine, EngineConfig
from companion.mavlink.dialect import Message
from companion.mavlink.facts import RECEIVER, Traffic
from companion.mavlink.translate import to_fact
from companion.model import Vec3
from companion.traffic import TrafficParams
from companion.traffic.params import Forward
from sim.closed_loop import ClosedLoop, Flight
from sim.scenario import Autopilot, load_scenario
from tests.support.autopilots import ARDUPILOT, BOTH, ways


def fly(
    forward: Forward,
    parameters: dict[str, float],
    *,
    autopilot: Autopilot = "ardupilot",
) -> tuple[Flight, Engine, set[str]]:
    """Fly head-on traffic that our receiver alone hears; also all tracks seen."""
    engine = Engine(EngineConfig(traffic=TrafficParams(forward=forward)))
    loop = ClosedLoop(load_scenario("head-on"), engine, autopilot=autopilot)
    for name, value in parameters.items():
        loop.world.vehicle.parameters.set(name, value)
    reports = loop.world.receiver.reports
    seen: set[str] = set()

    def heard_by_us(now_s: float, own_m: Vec3) -> Sequence[Message]:
        for message in reports(now_s, own_m):
            fact = to_fact(message, now_s)
            assert isinstance(fact, Traffic)
            engine.receive(Traffic(RECEIVER, replace(fact.report, heard_by="sbs:x")), now_s)
        return []

    loop.world.receiver.reports = heard_by_us  # type: ignore[method-assign, assignment]

    def look(_loop: ClosedLoop, at_s: float) -> None:
        seen.update(track.track_id for track in engine.snapshot(at_s).tracks)

    return loop.run(110.0, on_step=look), engine, seen


ACTS = {"AVD_ENABLE": 1.0, "AVD_F_ACTION": 3.0}


def test_the_autopilots_own_avoidance_sees_it_and_is_not_fought() -> None:
    flight, engine, seen = fly("autopilot", ACTS)
    modes = [mode for _, mode in flight.modes]
    assert "AVOID_ADSB" in modes
    assert flight.engagements == engine.engagements == 0
    assert flight.setpoints_sent == 0
    assert set(modes) <= {"AUTO", "AVOID_ADSB"}
    assert seen == {"A00001"}


def test_without_it_the_autopilots_own_avoidance_sees_nothing() -> None:
    flight, engine, _ = fly("station", ACTS)
    assert [mode for _, mode in flight.modes] == ["AUTO"]
    assert engine.engagements == 0


@ways(ARDUPILOT, among=BOTH)
def test_we_fly_as_without_and_see_one_aircraft(autopilot: Autopilot) -> None:
    flight, engine, seen = fly("autopilot", {}, autopilot=autopilot)
    alone, _, _ = fly("off", {}, autopilot=autopilot)
    assert engine.forwarding.sent > 60
    assert seen == {"A00001"}
    assert engine.engagements == 1
    assert flight.decisions == alone.decisions
