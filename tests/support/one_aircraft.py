"""One aircraft heard by four receivers at once: the error of its track against the truth."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import (
    Fact,
    GeoidSeparation,
    OwnPosition,
    PressureAltitude,
    ReceiverOwnship,
    Sender,
    Traffic,
)
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.translate import frame_to_fact
from companion.model import Track, Vec3
from companion.sources.receiver import Piece, Receiver
from companion.sources.registry import FORMATS as DECODED
from companion.traffic import TrafficParams
from companion.traffic.picture import TrafficPicture
from sim.receiver import Carrier, Datums, SimulatedReceiver
from sim.traffic import Intruder, Maneuver, ReceiverModel, TrafficReceiver

HOME = GeoPoint(47.0, 8.0, 0.0)
FRAME = LocalFrame(HOME.lat_deg, HOME.lon_deg)
START_S = 1_700_000_000.0
# The standard atmosphere is 60 m off, and the geoid is 40 m above the ellipsoid.
DATUMS = Datums(pressure_m=60.0, ellipsoid_m=40.0)
LASTS_S, SETTLED_S, STEP_S = 180.0, 20.0, 0.2
AUTOPILOT = Sender(1, 1)

# We fly north.
OWN = Intruder(0x7CFFFF, "OWNSHIP", START_S, (0.0, 0.0, -600.0), (22.0, 0.0, 0.0))


def _other(speed_mps: float, *maneuvers: tuple[float, float, float]) -> Intruder:
    """It crosses in front of us; from a time on it turns [deg/s] and climbs [m/s]."""
    flown = tuple(Maneuver(START_S + at_s, math.radians(turn), climb) for at_s, turn, climb in maneuvers)
    return Intruder(0xA00001, "OTHER", START_S, (3000.0, 2500.0, -650.0), (0.0, -speed_mps, 0.0), flown)


PATHS: dict[str, Intruder] = {
    "mixed": _other(55.0, (60.0, 3.0, 0.0), (90.0, 0.0, 2.5), (120.0, 0.0, 0.0)),
    "straight": _other(80.0),
    "turning": _other(40.0, (30.0, 4.0, 0.0), (70.0, -3.0, 0.0), (130.0, 0.0, 0.0)),
    "climbing": _other(65.0, (40.0, 0.0, 5.0), (80.0, 0.0, 0.0), (110.0, 0.0, -4.0), (150.0, 0.0, 0.0)),
}
# By format: errors as their senders state them, and how late each is. ADSB_VEHICLE states whole seconds of
# its age, GDL 90 none, aircraft.json all of it; FLARM predicts.
_TRANSPONDER = {"vertical_sigma_m": 3.0, "speed_sigma_mps": 1.0, "climb_sigma_mps": 0.5}
RECEIVERS: dict[str, ReceiverModel] = {
    "mavlink": ReceiverModel(delay_s=1.4, horizontal_sigma_m=10.0, **_TRANSPONDER),
    "gdl90": ReceiverModel(delay_s=0.5, horizontal_sigma_m=10.0, **_TRANSPONDER),
    "readsb": ReceiverModel(delay_s=1.5, horizontal_sigma_m=10.0, **_TRANSPONDER),
    "flarm": ReceiverModel(delay_s=0.2, horizontal_sigma_m=4.0, vertical_sigma_m=4.0, speed_sigma_mps=0.5),
}


@dataclass
class Errors:
    """Errors of a track at many moments, and how many tracks there were at each."""

    horizontal_m: list[float] = field(default_factory=list)
    vertical_m: list[float] = field(default_factory=list)
    velocity_mps: list[float] = field(default_factory=list)
    tracks: list[int] = field(default_factory=list)

    def figures(self) -> dict[str, tuple[float, float]]:
        """RMS and 95 % of each error."""
        columns = {
            "horizontal_m": self.horizontal_m,
            "vertical_m": self.vertical_m,
            "velocity_mps": self.velocity_mps,
        }
        return {
            name: (float(np.sqrt(np.mean(np.square(values)))), float(np.quantile(values, 0.95)))
            for name, values in columns.items()
        }


class _Source:
    """A simulated receiver, and what Companion makes of what it sends."""

    def __init__(self, name: str, seed: int, other: Intruder) -> None:
        traffic = TrafficReceiver([other], FRAME, START_S, model=RECEIVERS[name], seed=seed)
        self._simulated = SimulatedReceiver(name, traffic, DATUMS)
        self._decoding = Receiver.of(name, name) if name in DECODED else None
        self._splitter = FrameSplitter()

    def heard(self, now_s: float, carrier: Carrier) -> Iterator[Fact]:
        """The facts that arrive now."""
        for data in self._simulated.pieces(now_s, carrier):
            if self._decoding is not None:
                yield from self._decoding.take(Piece(self._decoding.address, data), now_s)
                continue
            for frame in self._splitter.feed_datagram(data):
                fact = frame_to_fact(frame, now_s)
                if fact is not None:
                    yield fact


def errors_of(names: Sequence[str], seeds: Sequence[int] = (0,), path: str = "mixed") -> Errors:
    """The errors with receivers of these formats, over the flights of all seeds on one of `PATHS`."""
    errors, other = Errors(), PATHS[path]
    for seed in seeds:
        picture = TrafficPicture(TrafficParams())
        # Each receiver has errors of its own.
        sources = [_Source(name, 100 * seed + list(RECEIVERS).index(name), other) for name in names]
        for step in range(round(LASTS_S / STEP_S)):
            now_s = START_S + step * STEP_S
            _fly(picture, sources, step, now_s)
            if step * STEP_S >= SETTLED_S:
                _compare(errors, picture.tracker.tracks(now_s, FRAME), other.state_at(now_s))
    return errors


def _fly(picture: TrafficPicture, sources: Sequence[_Source], step: int, now_s: float) -> None:
    position_m, velocity_mps = OWN.state_at(now_s)
    place = FRAME.to_geo(*position_m)
    position = OwnPosition(
        AUTOPILOT, now_s - START_S, place.lat_deg, place.lon_deg, place.altitude_m, 100.0, velocity_mps, 0.0
    )
    picture.observe_ownship(position, now_s)
    if step % 5 == 0:
        picture.observe_ownship(PressureAltitude(AUTOPILOT, place.altitude_m + DATUMS.pressure_m), now_s)
        picture.observe_ownship(GeoidSeparation(AUTOPILOT, DATUMS.ellipsoid_m), now_s)
    for source in sources:
        for fact in source.heard(now_s, Carrier(place, velocity_mps)):
            if isinstance(fact, ReceiverOwnship):
                picture.observe_receiver(fact, now_s)
            elif isinstance(fact, Traffic):
                picture.tracker.receive(fact.report, now_s, fact.sender)
            else:
                picture.receive(fact, now_s)


def _compare(errors: Errors, tracks: Sequence[Track], truth: tuple[Vec3, Vec3]) -> None:
    """Add the errors of the track that is nearest to the truth."""
    true_m, true_mps = truth
    errors.tracks.append(len(tracks))
    if tracks:
        nearest = min(tracks, key=lambda track: math.dist(track.position_m, true_m))
        errors.horizontal_m.append(math.dist(nearest.position_m[:2], true_m[:2]))
        errors.vertical_m.append(abs(nearest.position_m[2] - true_m[2]))
        errors.velocity_mps.append(math.dist(nearest.velocity_mps[:2], true_mps[:2]))
