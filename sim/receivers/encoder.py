"""The interface of all formats: what the receiver heard at one moment in, bytes to send out."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from companion.geodesy import GeoPoint
from companion.model import Vec3


@dataclass(frozen=True, slots=True)
class Transmission:
    """One aircraft as it is at the moment of its transmission, with what its transponder states.

    `place.altitude_m` is above the WGS 84 ellipsoid; `pressure_altitude_m` above the 1013.25 hPa level.
    `velocity_mps` is over ground, north-east-down. `category` is that of ADSB_VEHICLE.emitter_type.
    `nacp`, `nacv`, `nic` and `sil` are the accuracy and integrity codes of DO-260B. `age_s` is the time since
    the transmission; not every format says it.
    """

    icao: int
    callsign: str
    place: GeoPoint
    pressure_altitude_m: float
    velocity_mps: Vec3
    category: int = 1
    on_ground: bool = False
    nacp: int = 9
    nacv: int = 2
    nic: int = 8
    sil: int = 3
    age_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Reception:
    """What a receiver knows at `time_s` (Unix time): the aircraft heard now, and its own aircraft."""

    time_s: float
    heard: Sequence[Transmission]
    own: Transmission | None = None


class ReceiverEncoder(ABC):
    """Encodes what one receiver sends. `encode` is called once for each moment, a few times a second."""

    format: ClassVar[str]
    """The name in addresses, such as `gdl90`."""

    @abstractmethod
    def encode(self, reception: Reception) -> list[bytes]:
        """The datagrams, pieces of a stream, or the whole document to serve from now on."""
