"""The mission's item is restored also when the autopilot refuses the next take-over meanwhile."""

import math

from companion.control.state_machine import State
from companion.mavlink.facts import MissionProgress, Parameter, Traffic
from companion.model import TrafficReport, TrafficSource
from tests.support.pilots_seat import AUTOPILOT, SELECT_ITEM, SET_MODE, T0, Seat


def report(seat: Seat, meet_s: float) -> None:
    """Another aircraft, head-on."""
    north_m = 22.0 * (meet_s - T0) + 60.0 * (meet_s - seat.now_s)
    seen = TrafficReport(
        TrafficSource.ADSB, "A00002", seat.now_s, -35.0 + north_m / 110_940.0, 149.0, 884.0,
        course_rad=math.pi, ground_speed_mps=60.0, climb_mps=0.0, icao=0xA00002,
    )  # fmt: skip
    seat.receive(Traffic(AUTOPILOT, seen))


def test_a_mission_that_was_restarted_before_a_refused_take_over_is_sent_to_its_item() -> None:
    seat = Seat()
    seat.meet_s = T0 + 15.0
    seat.fly(0.5)
    seat.receive(Parameter(AUTOPILOT, "MIS_RESTART", 1.0))
    seat.receive(MissionProgress(AUTOPILOT, 4))
    seat.until(State.OUTER, State.INNER)
    seat.until(State.MONITOR, limit_s=120.0)
    seat.intruder = False
    seat.obeys = lambda message: getattr(message, "command", None) != SET_MODE
    meet_s, first = seat.now_s + 25.0, len(seat.sent)
    while seat.state is not State.ENGAGING:
        report(seat, meet_s)
        seat.fly(0.1)
    seat.receive(MissionProgress(AUTOPILOT, 0))
    seat.answer(SET_MODE, 4)
    for _ in range(30):
        report(seat, meet_s)
        seat.fly(0.1)
    items = [round(m.param1) for m in seat.sent[first:] if getattr(m, "command", None) == SELECT_ITEM]
    assert items == [4]
