"""What the operator reads is what is flown, on both autopilots: one message for each noticeable change."""

import math

import pytest

from companion.mavlink.dialect import Message
from companion.model import Guidance
from companion.output.notice import TEXT_BYTES
from companion.units import wrap_pi
from sim.scenario import Autopilot, load_scenario, scenario_names
from tests.support.autopilots import BOTH
from tests.support.monitored_loop import MonitoredLoop

MANEUVERS = ("CLIMB", "DESCEND", "RIGHT", "LEFT", "FASTER", "SLOWER", "HOLD")
# Changes of course and height that need no text, and the longest wait of a text in a row of many.
SMALL_RAD, SMALL_M, LATE_S = math.radians(20.1), 15.1, 3.1


@pytest.mark.parametrize("autopilot", BOTH)
@pytest.mark.parametrize("name", scenario_names())
def test_each_change_of_what_is_flown_is_announced_in_one_message(name: str, autopilot: Autopilot) -> None:
    loop = MonitoredLoop(load_scenario(name), autopilot=autopilot)
    sent: list[Message] = []
    transmit = loop._transmit

    def recording(time_us: int, effect: object) -> None:
        sent.append(effect.message)  # type: ignore[attr-defined]
        transmit(time_us, effect)  # type: ignore[arg-type]

    loop._transmit = recording  # type: ignore[method-assign]
    known: Guidance | None = None
    unannounced_s, count = 0.0, 0
    for _ in range(1800):
        sent.clear()
        loop.run(0.1)
        texts = [message for message in sent if message.get_type() == "STATUSTEXT"]
        maneuvers = [message for message in texts if message.text.split()[0].strip(",:") in MANEUVERS]
        assert all(message.id == 0 and len(message.text) <= TEXT_BYTES for message in maneuvers)
        count += len(maneuvers)
        guidance = loop.engine.decision.guidance
        if maneuvers and guidance is not None:
            known = guidance
        if not loop.engine.supervisor.flying or guidance is None:
            continue
        assert known is not None
        small = (
            abs(wrap_pi(guidance.course_rad - known.course_rad)) < SMALL_RAD
            and abs(guidance.altitude_m - known.altitude_m) < SMALL_M
        )
        unannounced_s = 0.0 if small else unannounced_s + 0.1
        assert unannounced_s < LATE_S, maneuvers
    assert count < 20
