"""A simulated receiver of Mode S that sends Beast binary: the format of `companion.sources.beast`."""

from dataclasses import dataclass
from typing import Final

from sim.receivers import mode_s
from sim.receivers.encoder import ReceiverEncoder, Reception, Transmission

_ESCAPE: Final = b"\x1a"
_TYPES: Final = {2: b"1", 7: b"2", 14: b"3"}
_CLOCK_HZ: Final = 12e6
_CLOCK_MASK: Final = 2**48 - 1
_SIGNAL: Final = 128
# Identification and operational status are sent at these intervals (DO-260B 2.2.3.3.1).
_IDENTIFICATION_S, _STATUS_S = 5.0, 2.5


@dataclass(slots=True)
class _Transponder:
    is_odd: bool = False
    identified_s: float = float("-inf")
    status_s: float = float("-inf")


class BeastEncoder(ReceiverEncoder):
    """Encodes squitters of ADS-B version 2: position and velocity each time, even and odd in turn."""

    format = "beast"

    def __init__(self) -> None:
        self._transponders: dict[int, _Transponder] = {}

    def encode(self, reception: Reception) -> list[bytes]:
        return [
            frame(mode_s.squitter(aircraft.icao, content), reception.time_s)
            for aircraft in reception.heard
            for content in self._contents(aircraft, reception.time_s)
        ]

    def _contents(self, aircraft: Transmission, time_s: float) -> list[int]:
        transponder = self._transponders.setdefault(aircraft.icao, _Transponder())
        contents = [mode_s.position(aircraft, is_odd=transponder.is_odd)]
        transponder.is_odd = not transponder.is_odd
        if not aircraft.on_ground:
            contents.insert(0, mode_s.velocity(aircraft))
        if time_s - transponder.status_s >= _STATUS_S:
            contents.insert(0, mode_s.operational_status(aircraft))
            transponder.status_s = time_s
        if time_s - transponder.identified_s >= _IDENTIFICATION_S:
            contents.insert(0, mode_s.identification(aircraft))
            transponder.identified_s = time_s
        return contents


def frame(message: bytes, time_s: float) -> bytes:
    """A message as a Beast frame, received at a time of the 12 MHz clock."""
    clock = int(time_s * _CLOCK_HZ) & _CLOCK_MASK
    content = clock.to_bytes(6, "big") + bytes((_SIGNAL,)) + message
    return _ESCAPE + _TYPES[len(message)] + content.replace(_ESCAPE, 2 * _ESCAPE)
