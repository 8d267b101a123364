"""The vehicle's time between its messages."""

import math

import pytest

from sim.flight_test.vehicle_time import VehicleTime


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def followed(rate: float, seconds: float = 10.0) -> tuple[VehicleTime, Clock]:
    clock = Clock()
    time = VehicleTime(clock)
    for step in range(round(seconds * 5) + 1):
        clock.now_s = 100.0 + step / 5
        time.observe(30.0 + rate * step / 5)
    return time, clock


def test_nothing_is_known_before_the_first_message() -> None:
    time = VehicleTime(Clock())
    assert math.isnan(time.now_s())
    assert not time.known
    assert time.silent_s == math.inf


@pytest.mark.parametrize("rate", [0.5, 1.0, 5.0])
def test_it_goes_on_between_messages_at_the_vehicles_own_rate(rate: float) -> None:
    time, clock = followed(rate)
    assert time.rate == pytest.approx(rate)
    before_s = time.now_s()
    clock.now_s += 0.1
    assert time.now_s() == pytest.approx(before_s + 0.1 * rate)


def test_it_stands_still_when_the_vehicle_is_silent() -> None:
    time, clock = followed(1.0)
    clock.now_s += 1.0
    after_a_second_s = time.now_s()
    clock.now_s += 100.0
    assert time.now_s() == after_a_second_s
    assert time.silent_s == pytest.approx(101.0)


def test_it_never_runs_backwards() -> None:
    time, clock = followed(1.0)
    clock.now_s += 0.5
    ahead_s = time.now_s()
    time.observe(40.2)  # late: the vehicle has slowed down
    assert time.now_s() >= ahead_s


def test_a_restart_begins_again() -> None:
    time, clock = followed(1.0)
    clock.now_s += 3.0
    time.observe(2.0)
    assert time.restarts == 1
    assert time.now_s() == pytest.approx(2.0)
