"""Addresses for aircraft that have none of ICAO, because ADSB_VEHICLE knows its aircraft by nothing else."""

from hashlib import blake2s
from typing import Final

from companion.model import Track

# ICAO Annex 10, Volume III, Part I, chapter 9, table 9-1: addresses that begin with 1011 are allocated to no
# State and no region. Other such blocks are in use all the same: FLARM has 1101, ICAO itself parts of 1111.
# ArduPilot ignores addresses of more than 24 bits, and PX4 the address 0.
_FIRST, _COUNT = 0xB0_0000, 0x10_0000
_MOST: Final = 1024


class MadeUpAddresses:
    """One address for each track without its own, made from its id: the same after a restart."""

    def __init__(self) -> None:
        self._tracks: dict[int, str] = {}  # by address; the one used last is the last

    def of(self, track: Track) -> int:
        """The address of a track: its own, or a made-up one, also for a second aircraft with its address."""
        is_first = "/" not in track.track_id
        return track.icao if track.icao and is_first else self.made_up(track.track_id)

    def made_up(self, track_id: str) -> int:
        """The made-up address of a track."""
        start = int.from_bytes(blake2s(track_id.encode(), digest_size=4).digest())
        address = _FIRST + start % _COUNT
        while self._tracks.get(address, track_id) != track_id:
            address = _FIRST + (address + 1 - _FIRST) % _COUNT
        self._tracks.pop(address, None)
        self._tracks[address] = track_id
        if len(self._tracks) > _MOST:
            del self._tracks[next(iter(self._tracks))]
        return address


def is_made_up(address: int) -> bool:
    """Whether an address is one that no aircraft has."""
    return _FIRST <= address < _FIRST + _COUNT
