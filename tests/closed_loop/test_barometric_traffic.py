"""Barometric traffic in weather 8 hPa off the standard is passed at the correct true distance."""

import json
from dataclasses import replace

import pytest

from companion.engine import Engine, EngineConfig
from companion.mavlink.dialect import Message
from companion.model import Track
from companion.traffic import HeightParams, TrafficParams
from sim.closed_loop import ClosedLoop
from sim.scenario import Scenario
from tests.support.monitored_loop import SOON
from tests.support.thorough import sample

QNH_HPA, STANDARD_HPA = 1005.25, 1013.25
# When the intruder has passed, and how long after that the aircraft is surely given back.
PASSED_S, GIVEN_BACK_S = 80.0, 50.0
_LAPSE_PER_M, _EXPONENT = 2.25577e-5, 5.25588  # of the fake vehicle's atmosphere


def pressure_altitude_m(altitude_m: float) -> float:
    """The reading of a standard altimeter in this weather, about 67 m too high."""
    ratio = (QNH_HPA / STANDARD_HPA) ** (1.0 / _EXPONENT)
    return (1.0 - ratio * (1.0 - _LAPSE_PER_M * altitude_m)) / _LAPSE_PER_M


class LowPressure(ClosedLoop):
    """A scenario in that weather: barometric traffic, and our own pressure received or not."""

    def __init__(self, scenario: Scenario, engine: Engine, *, own_pressure: bool) -> None:
        super().__init__(scenario, engine)
        self._own_pressure = own_pressure
        self.tracks: list[Track] = []

    def _hear(self, message: Message) -> None:
        kind = message.get_type()
        if kind == "SCALED_PRESSURE":
            if not self._own_pressure:
                return
            message.press_abs *= QNH_HPA / STANDARD_HPA
        elif kind == "ADSB_VEHICLE":
            message.altitude = round(pressure_altitude_m(message.altitude / 1000.0) * 1000.0)
            message.altitude_type = 0
        super()._hear(message)
        assert self.engine is not None
        if kind != "ADSB_VEHICLE" or self._now_us - self.start_us < 5_000_000:
            return  # until all messages were received once
        self.tracks += self.engine.snapshot(self._now_us / 1e6).tracks


def above_us(miss_height_m: float) -> Scenario:
    """A head-on intruder with this true height above us."""
    (conflict,) = SOON.intruders
    return replace(SOON, intruders=(replace(conflict, miss_height_m=miss_height_m),))


def fly(own_pressure: bool, pressure_unknown_m: float = 60.0, miss_height_m: float = 33.0) -> LowPressure:
    params = TrafficParams(heights=HeightParams(pressure_unknown_m=pressure_unknown_m))
    loop = LowPressure(
        above_us(miss_height_m), Engine(EngineConfig(traffic=params)), own_pressure=own_pressure
    )
    loop.run(PASSED_S)
    if loop.flight.engagements:
        loop.run(GIVEN_BACK_S)
    return loop


def test_with_our_own_pressure_the_intruders_height_is_correct() -> None:
    loop = fly(own_pressure=True)
    (intruder,) = loop.world.intruders
    heights_m = [-track.position_m[2] for track in loop.tracks]
    assert {track.vertical_uncertainty_m for track in loop.tracks} == {0.0}
    # The tolerance covers the different temperature lapse and the rounding in the messages.
    assert max(abs(height_m + intruder.position_m[2]) for height_m in heights_m) < 3.0
    (encounter,) = loop.flight.score.encounters.values()
    # 250 ft plus a quarter, the usual vertical margin.
    assert encounter.vertical_m == pytest.approx(1.25 * 76.2, abs=5.0)
    assert loop.flight.resumed


def test_without_it_the_volume_grows_by_the_uncertainty() -> None:
    loop = fly(own_pressure=False)
    assert {track.vertical_uncertainty_m for track in loop.tracks} == {60.0}
    (encounter,) = loop.flight.score.encounters.values()
    # It seems 67 m too high and is passed below.
    apparent_m = encounter.vertical_m + 67.0
    assert apparent_m == pytest.approx(1.25 * (76.2 + 60.0), abs=8.0)
    assert not encounter.lowc
    assert loop.flight.resumed


def test_without_the_uncertainty_well_clear_would_be_lost() -> None:
    """It seems to pass 100 m above, outside the volume, but passes 33 m above."""
    loop = fly(own_pressure=False, pressure_unknown_m=0.0)
    (encounter,) = loop.flight.score.encounters.values()
    assert encounter.lowc
    assert loop.flight.engagements == 0


@pytest.mark.parametrize("own_pressure", sample([False], [False, True]))
def test_an_intruder_far_enough_above_is_not_avoided(own_pressure: bool) -> None:
    loop = fly(own_pressure=own_pressure, miss_height_m=115.0)
    layers = {json.loads(line)["layer"] for line in loop.flight.decisions}
    assert layers == {"clear"}
    assert loop.flight.engagements == 0
