"""Transmissions for simulated receivers, and damage to what they send: for the tests of all formats."""

from collections.abc import Iterable, Iterator
from typing import Any

from hypothesis import strategies as st

from companion.geodesy import GeoPoint
from companion.sources.decoder import Decoder, Heard
from sim.receivers import Transmission

RECEIVED_S = 1000.0
PLACE = GeoPoint(47.3, 8.5, 850.0)


def transmission(**changes: Any) -> Transmission:
    """An aircraft on a course of 090, 60 m/s, climbing 5 m/s."""
    fields: dict[str, Any] = {
        "icao": 0x4B1234,
        "callsign": "HBABC",
        "place": PLACE,
        "pressure_altitude_m": 800.0,
        "velocity_mps": (0.0, 60.0, -5.0),
    }
    return Transmission(**{**fields, **changes})


def transmissions(reach_deg: float = 90.0, speed_mps: float = 300.0) -> st.SearchStrategy[Transmission]:
    """Any aircraft within `reach_deg` of the equator's first meridian."""
    speeds = st.floats(-speed_mps, speed_mps)
    return st.builds(
        Transmission,
        icao=st.integers(8, 0xFFFFFF),
        callsign=st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", max_size=8),
        place=st.builds(
            GeoPoint,
            st.floats(-min(reach_deg, 89.0), min(reach_deg, 89.0)),
            st.floats(-2.0 * reach_deg, 2.0 * reach_deg, exclude_min=True),
            st.floats(-300.0, 15_000.0),
        ),
        pressure_altitude_m=st.floats(-300.0, 15_000.0),
        velocity_mps=st.tuples(speeds, speeds, st.floats(-100.0, 100.0)),
        category=st.sampled_from([0, 1, 3, 7, 9, 14, 17, 19]),
        on_ground=st.booleans(),
        nacp=st.integers(0, 11),
        nic=st.integers(0, 11),
    )


def heard(decoder: Decoder, pieces: Iterable[bytes]) -> list[Heard]:
    """All that a decoder makes of pieces that arrive together."""
    return [fact for piece in pieces for fact in decoder.feed(piece, RECEIVED_S)]


def flipped(data: bytes) -> Iterator[bytes]:
    """The data with each of its bits changed in turn."""
    for bit in range(8 * len(data)):
        changed = data[bit // 8] ^ 1 << bit % 8
        yield data[: bit // 8] + bytes((changed,)) + data[bit // 8 + 1 :]
