"""ArduPlane's manners around modes: the failsafe of the radio control, and heartbeats at once.

As the real one, by its source (`failsafe_short_on_event`) and by the recorded flights of 4.8-dev.
"""

import pytest

from companion.mavlink.dialect import mavlink
from sim.vehicle import Mode
from tests.support.arduplane_bench import SET_MODE, PlaneBench, airborne

CIRCLE_ALWAYS = {"FS_SHORT_ACTN": 1.0}


def lost_in(mode: Mode, seconds: float, parameters: dict[str, float]) -> PlaneBench:
    bench = airborne(parameters=parameters)
    bench.vehicle.set_mode(mode)
    bench.vehicle.lose_radio(True)
    bench.fly(seconds)
    return bench


@pytest.mark.parametrize("mode", [Mode.AUTO, Mode.GUIDED, Mode.LOITER, Mode.FBWA])
def test_a_short_loss_circles_and_restores_the_mode(mode: Mode) -> None:
    bench = lost_in(mode, 3.0, CIRCLE_ALWAYS)
    assert bench.vehicle.truth.mode == "CIRCLE"
    assert bench.messages("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL
    bench.vehicle.lose_radio(False)
    bench.fly(1.1)
    assert bench.vehicle.truth.mode == mode.name
    assert bench.messages("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_ACTIVE


def test_a_mode_chosen_meanwhile_stays() -> None:
    bench = lost_in(Mode.GUIDED, 3.0, CIRCLE_ALWAYS)
    bench.vehicle.set_mode(Mode.LOITER)
    bench.vehicle.lose_radio(False)
    bench.fly(1.0)
    assert bench.vehicle.truth.mode == "LOITER"


def test_by_default_a_mode_that_navigates_goes_on() -> None:
    bench = lost_in(Mode.GUIDED, 10.0, {})
    assert bench.vehicle.truth.mode == "GUIDED"
    assert lost_in(Mode.FBWA, 3.0, {}).vehicle.truth.mode == "CIRCLE"


def test_a_long_loss_returns_home_and_stays_there() -> None:
    bench = lost_in(Mode.GUIDED, 6.0, CIRCLE_ALWAYS)
    assert bench.vehicle.truth.mode == "RTL"
    bench.vehicle.lose_radio(False)
    bench.fly(1.0)
    assert bench.vehicle.truth.mode == "RTL"


def test_a_loss_shorter_than_the_timeout_does_nothing() -> None:
    bench = lost_in(Mode.GUIDED, 1.0, CIRCLE_ALWAYS)
    bench.vehicle.lose_radio(False)
    bench.fly(10.0)
    assert bench.vehicle.truth.mode == "GUIDED"


def test_a_mode_change_sends_a_heartbeat_at_once() -> None:
    """Recorded 0 to 40 ms after the acknowledgement."""
    bench = airborne(rate_hz=0.0)
    bench.fly(0.3)
    for mode in (Mode.GUIDED, Mode.AUTO):
        bench.received.clear()
        assert bench.by_long(SET_MODE, 1, mode) == 0
        bench.fly(0.05)
        assert [beat.custom_mode for beat in bench.messages("HEARTBEAT")] == [mode]
