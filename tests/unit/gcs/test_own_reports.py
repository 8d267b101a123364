"""Reports that we made up an address for are recognized, also by a replay, which sends nothing."""

import pytest

from companion.gcs.forwarding import Forwarding, Received
from companion.gcs.made_up_addresses import MadeUpAddresses
from companion.mavlink.facts import OwnPosition, Sender, Traffic
from companion.model import AltitudeReference, Track, TrafficReport, TrafficSource

OURS, OTHER, RECEIVER = Sender(1, 1), Sender(8, 1), Sender(1, 156)
NOW_S = 1000.0


def position() -> OwnPosition:
    """The position of system 8, as its autopilot reports it."""
    return OwnPosition(OTHER, 0.0, 47.0, 8.0, 500.0, 100.0, (0.0, 20.0, 0.0), None)


def made_up(track_id: str) -> int:
    return MadeUpAddresses().of(Track(track_id, NOW_S, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))


def report(icao: int) -> Traffic:
    """A report as a receiver on our aircraft sends it."""
    seen = TrafficReport(
        TrafficSource.ADSB, f"{icao:06X}", NOW_S, 47.0, 8.0, 500.0, AltitudeReference.GEOMETRIC, icao=icao
    )
    return Traffic(RECEIVER, seen)


@pytest.mark.parametrize("elsewhere", [frozenset(), frozenset({(8, 1)})])
def test_a_system_that_we_know_is_not_a_second_aircraft(elsewhere: frozenset[tuple[int, int]]) -> None:
    forwarding = Forwarding("autopilot")
    forwarding.elsewhere = elsewhere  # a replay does not know it
    assert not forwarding.is_echo(report(made_up("SYS-8")), NOW_S)
    forwarding.received.append(Received(position(), "SYS-8", OURS, NOW_S))
    forwarding.note_received()
    assert forwarding.is_echo(report(made_up("SYS-8")), NOW_S + 1.0)
    assert not forwarding.is_echo(report(made_up("SYS-9")), NOW_S + 1.0)
    assert not forwarding.is_echo(report(0xA00001), NOW_S + 1.0)


def test_a_system_that_is_silent_is_heard_through_others() -> None:
    forwarding = Forwarding("autopilot")
    forwarding.received.append(Received(position(), "SYS-8", OURS, NOW_S))
    forwarding.note_received()
    assert not forwarding.is_echo(report(made_up("SYS-8")), NOW_S + 20.0)
