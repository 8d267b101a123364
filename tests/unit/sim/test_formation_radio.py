"""The radio between members: loss, delay and order of the datagrams."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.formation.radio import Radio, RadioQuality

LOSSES, DELAYS_S = st.floats(0.0, 0.9), st.floats(0.0, 3.0)


def flown(radio: Radio, seconds: int = 40) -> list[list[tuple[float, bytes]]]:
    """What each member received when each sends ten datagrams a second."""
    received: list[list[tuple[float, bytes]]] = [[] for _ in range(radio.members)]
    for step in range(10 * (seconds + 5)):
        for member in range(radio.members):
            received[member] += radio.arrived(member, step * 0.1)
        if step < 10 * seconds:
            for member in range(radio.members):
                radio.send(member, f"{member} {step}".encode(), step * 0.1)
    return received


@given(st.integers(2, 4), DELAYS_S, st.integers(0, 99))
def test_without_loss_each_datagram_reaches_each_other_member_once_in_time(
    members: int, delay_s: float, seed: int
) -> None:
    received = flown(Radio(members, RadioQuality(0.0, delay_s), seed), 10)
    for member, arrived in enumerate(received):
        assert sorted(raw for _, raw in arrived) == sorted(
            f"{other} {step}".encode() for other in range(members) if other != member for step in range(100)
        )
        for at_s, raw in arrived:
            late_s = at_s - int(raw.split()[1]) * 0.1
            assert 0.5 * delay_s - 1e-9 <= late_s <= delay_s + 1e-9
        assert [at_s for at_s, _ in arrived] == sorted(at_s for at_s, _ in arrived)


@given(LOSSES, DELAYS_S, st.integers(0, 99))
def test_so_many_are_lost_as_configured(loss: float, delay_s: float, seed: int) -> None:
    radio = Radio(3, RadioQuality(loss, delay_s), seed)
    share = sum(map(len, flown(radio))) / (3 * 2 * 400)
    assert share == pytest.approx(1.0 - loss, abs=0.06)


@given(LOSSES, DELAYS_S, st.integers(0, 99))
def test_the_same_seed_draws_the_same(loss: float, delay_s: float, seed: int) -> None:
    first, again = (flown(Radio(3, RadioQuality(loss, delay_s), seed), 5) for _ in range(2))
    assert first == again


@given(LOSSES, st.integers(0, 99))
def test_what_one_member_sends_does_not_change_the_losses_of_another(loss: float, seed: int) -> None:
    """Comparisons with and without intents have the same losses of telemetry in the same order."""
    alone, beside = (Radio(3, RadioQuality(loss, 0.0), seed) for _ in range(2))
    for step in range(100):
        alone.send(0, bytes([step]), step * 0.1)
        beside.send(0, bytes([step]), step * 0.1)
        beside.send(1, b"more", step * 0.1)
    of_the_first = [raw for _, raw in beside.arrived(2, 10.0) if raw != b"more"]
    assert of_the_first == [raw for _, raw in alone.arrived(2, 10.0)]


def test_delayed_datagrams_overtake_each_other() -> None:
    received = flown(Radio(2, RadioQuality(0.0, 1.0), 3))[0]
    order = [int(raw.split()[1]) for _, raw in received]
    assert order != sorted(order)
    assert np.mean(np.diff(order) < 0) > 0.2
