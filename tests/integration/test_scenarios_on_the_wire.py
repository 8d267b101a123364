"""A scenario of `sim/scenarios` over real UDP, flown by GUIDED_COURSE.

Vehicle, link and runtime; the lockstep tests fly each scenario. `make thorough`: all, in every way.
"""

import asyncio

import pytest

from companion.engine import Engine
from companion.links import open_link
from companion.links.udp import UdpInLink
from companion.runtime import Runtime
from sim.clock import ScaledClock
from sim.metrics import score_of
from sim.scenario import Autopilot, scenario_names
from sim.server import VehicleServer
from sim.vehicle import Truth
from sim.world import build_world
from tests.support.autopilots import GUIDED_MODE, MISSION_MODE, in_turn
from tests.support.faulty_flight import START_S, Notes, free_ports
from tests.support.scenario_flight import flown_scenario
from tests.support.thorough import sample
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire

# Time after the last meeting; the lockstep tests fly the rest of the mission.
SETTLED_S = 10.0


@in_turn("name", sample(["head-on"], scenario_names()), first=2)
@in_virtual_time
async def test_a_scenario_over_udp(name: str, autopilot: Autopilot) -> None:
    scenario = flown_scenario(name)
    loop = asyncio.get_running_loop()
    clock = ScaledClock(1.0, start_s=START_S, monotonic_s=loop.time)
    world = build_world(scenario, START_S, autopilot=autopilot)
    score = score_of(scenario, world)
    modes: list[str] = []
    uncontrolled: set[bool] = set()

    def observe(truth: Truth) -> None:
        score.update(truth.time_s, truth.position_m)
        uncontrolled.add(truth.uncontrolled)
        if not modes or modes[-1] != truth.mode:
            modes.append(truth.mode)

    (port,) = free_ports(1)
    notes = Notes()
    link = UdpInLink(f"udpin:127.0.0.1:{port}", "127.0.0.1", port, loop.time)
    runtime = Runtime(Engine(), [link], recorder=notes, clock=clock)
    server = VehicleServer(
        world.vehicle,
        [open_link(f"udpout:127.0.0.1:{port}")],
        clock,
        receiver=world.receiver,
        observe=observe,
    )
    running, flying = asyncio.create_task(runtime.run()), asyncio.create_task(server.run())
    last_s = max(conflict.meet_at_s for conflict in scenario.intruders) + SETTLED_S
    try:
        await asyncio.sleep(last_s)
        async with asyncio.timeout(scenario.duration_s):
            while not world.vehicle.truth.on_mission:  # noqa: ASYNC110 - a simulated vehicle sets no events
                await asyncio.sleep(0.5)
        await asyncio.sleep(SETTLED_S)
        runtime.stop()
        await running
    finally:
        server.close()
        running.cancel()
        await asyncio.gather(running, flying, return_exceptions=True)

    assert not any(encounter.nmac or encounter.lowc for encounter in score.encounters.values())
    assert uncontrolled == {False}
    taken = [mode for mode in modes if mode in (GUIDED_MODE[autopilot], MISSION_MODE[autopilot])]
    conflicts = 0 if name == "clear" else len(scenario.intruders)
    if name == "two-intruders" and autopilot != "ardupilot":
        conflicts = 1  # back from the first one so late that the second one passes clear
    assert taken == [MISSION_MODE[autopilot]] + conflicts * [GUIDED_MODE[autopilot], MISSION_MODE[autopilot]]
    if conflicts:
        assert notes.texts()[-1] == f"Clear of traffic, back to {MISSION_MODE[autopilot]}"
    else:
        assert not notes.commands()
