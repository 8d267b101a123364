"""Facts to tracks: our own autopilot's facts, reports, and other MAVLink systems."""

from dataclasses import replace

import pytest

from companion.geodesy import LocalFrame
from companion.mavlink.facts import (
    Fact,
    GeoidSeparation,
    OwnPosition,
    OwnTransponder,
    PressureAltitude,
    Sender,
)
from companion.model import AltitudeReference, TrafficReport, TrafficSource
from companion.traffic import TrafficParams, TrafficPicture

OWN, OTHER = Sender(1, 1), Sender(7, 1)
FRAME = LocalFrame(47.0, 8.0)


def own_position(time_s: float, altitude_m: float = 500.0) -> OwnPosition:
    return OwnPosition(OWN, time_s, 47.0, 8.0, altitude_m, 100.0, (20.0, 0.0, 0.0), 0.0)


def traffic(time_s: float, reference: AltitudeReference, icao: int = 0x4B1234) -> TrafficReport:
    return TrafficReport(
        TrafficSource.ADSB, f"{icao:06X}", time_s, 47.02, 8.0, 700.0, reference, 0.0, 60.0, 0.0, icao=icao
    )


@pytest.mark.parametrize(
    ("own", "reference", "altitude_m", "uncertainty_m"),
    [
        (PressureAltitude(OWN, 567.0), AltitudeReference.BAROMETRIC, 633.0, 0.0),
        (GeoidSeparation(OWN, 48.0), AltitudeReference.GEOMETRIC, 652.0, 0.0),
        (GeoidSeparation(OWN, 48.0), AltitudeReference.BAROMETRIC, 700.0, 60.0),
    ],
)
def test_altitudes_are_converted_with_our_own_offsets(
    own: Fact, reference: AltitudeReference, altitude_m: float, uncertainty_m: float
) -> None:
    picture = TrafficPicture(TrafficParams())
    picture.observe_ownship(own_position(0.0), 0.0)
    picture.observe_ownship(own, 0.0)
    assert picture.tracker.receive(traffic(0.0, reference), 0.0) == "4B1234"
    (track,) = picture.tracker.tracks(0.0, FRAME)
    assert (-track.position_m[2], track.vertical_uncertainty_m) == (altitude_m, uncertainty_m)


def test_the_address_of_our_own_transponder_is_not_traffic() -> None:
    picture = TrafficPicture(TrafficParams())
    picture.observe_ownship(OwnTransponder(OWN, 0x4B1234), 0.0)
    assert picture.tracker.receive(traffic(0.0, AltitudeReference.GEOMETRIC), 0.0) is None
    assert picture.tracker.receive(traffic(0.0, AltitudeReference.GEOMETRIC, icao=0x4B1235), 0.0) == "4B1235"


def test_the_position_of_another_system_updates_its_track() -> None:
    picture = TrafficPicture(TrafficParams())
    position = replace(own_position(0.0), sender=OTHER)
    assert picture.receive(position, 0.0) == "SYS-7"
    assert picture.receive(PressureAltitude(OTHER, 567.0), 0.0) is None
    assert [track.track_id for track in picture.tracker.tracks(0.0, FRAME)] == ["SYS-7"]
