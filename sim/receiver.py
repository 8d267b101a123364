"""A receiver of any format on an aircraft: the traffic that it hears as the bytes that it sends. No I/O."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from companion.geodesy import GeoPoint
from companion.model import Vec3
from sim.receivers import FORMATS, Reception, Transmission
from sim.traffic import Heard, ReceiverModel, TrafficReceiver
from sim.vehicle import Truth

_OWN_ICAO = 0x7CFFFF
# Categories of DO-260B by the largest 95 % radius that they bound: position [m] and velocity [m/s].
_RADIAL_95 = 2.448
_NACP = ((9, 30.0), (8, 92.6), (7, 185.2), (6, 555.6), (5, 926.0))
_NACV = ((2, 3.0), (1, 10.0))


@dataclass(frozen=True, slots=True)
class Carrier:
    """The aircraft that carries the receiver; its altitude is above mean sea level."""

    place: GeoPoint
    velocity_mps: Vec3
    on_ground: bool = False


@dataclass(frozen=True, slots=True)
class Datums:
    """Offsets of the two other altitudes from that above mean sea level: by pressure, above the ellipsoid."""

    pressure_m: float = 0.0
    ellipsoid_m: float = 0.0


class SimulatedReceiver:
    """One receiver. Its own position and its heartbeat, if the format has them, go out once a second."""

    def __init__(self, name: str, traffic: TrafficReceiver, datums: Datums | None = None) -> None:
        """`name` is that of the format."""
        self.name = name
        self._format = FORMATS[name]
        self._encoder = self._format.encoder()
        self._traffic = traffic
        self._datums = datums or Datums()
        self._unsent: list[Heard] = []
        self._second: int | None = None

    def pieces(self, now_s: float, carrier: Carrier) -> list[bytes]:
        """What it sends now: datagrams, pieces of a stream, documents or frames."""
        self._unsent += self._hear(now_s, carrier)
        is_new_second = int(now_s) != self._second
        if not (is_new_second or (self._unsent and not self._format.gathers)):
            return []
        self._second = int(now_s)
        heard, self._unsent = self._unsent, []
        own = self._own(carrier) if is_new_second else None
        return self._encoder.encode(Reception(now_s, list(self._transmissions(heard, now_s)), own))

    def skip_to(self, now_s: float, carrier: Carrier) -> None:
        """Forget what was heard before: the receiver is switched on at `now_s`."""
        self._hear(now_s, carrier)

    def _hear(self, now_s: float, carrier: Carrier) -> list[Heard]:
        return self._traffic.heard(now_s, self._traffic.frame.to_ned_m(carrier.place))

    def _transmissions(self, heard: list[Heard], now_s: float) -> Iterator[Transmission]:
        """The aircraft heard, each once, as it was heard last or as the receiver predicts it."""
        model = self._traffic.model
        for one in {each.intruder.icao: each for each in heard}.values():
            age_s = now_s - one.sent_s
            predicted_s = age_s if self._format.predicts else 0.0
            (north_m, east_m, down_m), (north_mps, east_mps, down_mps) = one.position_m, one.velocity_mps
            place = self._traffic.frame.to_geo(
                north_m + north_mps * predicted_s,
                east_m + east_mps * predicted_s,
                down_m + down_mps * predicted_s,
            )
            yield Transmission(
                one.intruder.icao,
                one.intruder.callsign,
                self._above_ellipsoid(place),
                place.altitude_m + self._datums.pressure_m + model.altitude_offset_m,
                one.velocity_mps,
                category=one.intruder.emitter_type,
                nacp=_code(_NACP, model.horizontal_sigma_m),
                nacv=_code(_NACV, model.speed_sigma_mps),
                age_s=age_s - predicted_s,
            )

    def _own(self, carrier: Carrier) -> Transmission:
        return Transmission(
            _OWN_ICAO,
            "OWNSHIP",
            self._above_ellipsoid(carrier.place),
            carrier.place.altitude_m + self._datums.pressure_m,
            carrier.velocity_mps,
            on_ground=carrier.on_ground,
        )

    def _above_ellipsoid(self, place: GeoPoint) -> GeoPoint:
        return GeoPoint(place.lat_deg, place.lon_deg, place.altitude_m + self._datums.ellipsoid_m)


def carrier_of(truth: Truth) -> Carrier:
    """A vehicle as the carrier of its receivers."""
    return Carrier(truth.place, truth.velocity_mps, truth.on_ground)


def limited(model: ReceiverModel, name: str) -> ReceiverModel:
    """The errors of a receiver of this format, whose radio may not reach as far."""
    return replace(model, range_m=min(model.range_m, FORMATS[name].range_m))


def _code(categories: tuple[tuple[int, float], ...], sigma: float) -> int:
    """The best category whose bound holds for an error of `sigma` on each axis; 0 if there is none."""
    return next((code for code, bound in categories if _RADIAL_95 * sigma <= bound), 0)
