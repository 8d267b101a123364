"""Intruders on scripted paths, and how a receiver hears them: with noise, delay and loss."""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message
from companion.model import Vec3
from sim.receivers.mavlink import ALL_VALID, adsb_vehicle

_PHASE_S = 0.1  # offset between the transponders


@dataclass(frozen=True, slots=True)
class Maneuver:
    """From `at_s` on: a turn rate (positive to the right) and a climb rate."""

    at_s: float
    turn_rate_rps: float = 0.0
    climb_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class Intruder:
    """An aircraft whose position is a function of time.

    At `anchor_s` it is at `position_m` with `velocity_mps` (north-east-down, over ground). It flies straight
    before that, and after that until its first maneuver; each maneuver lasts until the next. It transmits
    from `appears_s` until `disappears_s`.
    """

    icao: int
    callsign: str
    anchor_s: float
    position_m: Vec3
    velocity_mps: Vec3
    maneuvers: Sequence[Maneuver] = ()
    appears_s: float = -math.inf
    disappears_s: float = math.inf
    emitter_type: int = 1

    def state_at(self, time_s: float) -> tuple[Vec3, Vec3]:
        """Position [m] and velocity [m/s] at a time, north-east-down."""
        position_m, velocity_mps, from_s = self.position_m, self.velocity_mps, self.anchor_s
        turn_rate_rps = 0.0
        for maneuver in self.maneuvers:
            if time_s <= maneuver.at_s:
                break
            position_m, velocity_mps = _moved(position_m, velocity_mps, turn_rate_rps, maneuver.at_s - from_s)
            velocity_mps = (velocity_mps[0], velocity_mps[1], -maneuver.climb_mps)
            from_s, turn_rate_rps = maneuver.at_s, maneuver.turn_rate_rps
        return _moved(position_m, velocity_mps, turn_rate_rps, time_s - from_s)


def _moved(position_m: Vec3, velocity_mps: Vec3, turn_rate_rps: float, dt_s: float) -> tuple[Vec3, Vec3]:
    """The state after `dt_s` straight or on a circle, exact."""
    north_mps, east_mps, down_mps = velocity_mps
    angle_rad = turn_rate_rps * dt_s
    if abs(angle_rad) < 1e-9:
        moved = (
            position_m[0] + north_mps * dt_s,
            position_m[1] + east_mps * dt_s,
            position_m[2] + down_mps * dt_s,
        )
        return moved, velocity_mps
    along = math.sin(angle_rad) / turn_rate_rps
    aside = (1.0 - math.cos(angle_rad)) / turn_rate_rps
    moved = (
        position_m[0] + north_mps * along - east_mps * aside,
        position_m[1] + east_mps * along + north_mps * aside,
        position_m[2] + down_mps * dt_s,
    )
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return moved, (north_mps * cos - east_mps * sin, east_mps * cos + north_mps * sin, down_mps)


@dataclass(frozen=True, slots=True)
class ReceiverModel:
    """The errors of a receiver. Sigmas are standard deviations per axis, drawn for each report."""

    period_s: float = 1.0
    horizontal_sigma_m: float = 0.0
    vertical_sigma_m: float = 0.0
    speed_sigma_mps: float = 0.0
    climb_sigma_mps: float = 0.0
    delay_s: float = 0.0
    loss: float = 0.0
    range_m: float = 20_000.0
    flags: int = ALL_VALID
    barometric: bool = False
    altitude_offset_m: float = 0.0


class Heard(NamedTuple):
    """What a receiver heard of an intruder: its state at `sent_s`, with the receiver's errors."""

    intruder: Intruder
    sent_s: float
    position_m: Vec3
    velocity_mps: Vec3


class TrafficReceiver:
    """Hears every intruder once a period. The same seed repeats what is heard.

    The altitude offset of the model is not in what is heard: it is that of the intruders' altimeters.
    """

    def __init__(
        self,
        intruders: Sequence[Intruder],
        frame: LocalFrame,
        start_s: float,
        *,
        model: ReceiverModel | None = None,
        seed: int = 0,
    ) -> None:
        """Start at `start_s`; the intruders move in `frame`."""
        self.frame = frame
        self.model = model or ReceiverModel()
        self._seed = seed
        self._start_s = start_s
        self._order = count()
        # (time of arrival, tie-breaker, time of transmission, intruder, its random numbers)
        self._coming: list[tuple[float, int, float, Intruder, random.Random]] = []
        for intruder in intruders:
            self.add(intruder)

    def add(self, intruder: Intruder) -> None:
        """Receive one more aircraft."""
        place = next(self._order)
        first_s = max(self._start_s, intruder.appears_s) + place * _PHASE_S % self.model.period_s
        chance = random.Random(f"{self._seed} {intruder.icao:06x}")
        self._expect(first_s, intruder, chance)

    def heard(self, now_s: float, own_m: Vec3 | None = None) -> list[Heard]:
        """What arrived since the last call, in order.

        `own_m` is the receiver's position; intruders out of its range are not heard.
        """
        arrived: list[Heard] = []
        while self._coming and self._coming[0][0] <= now_s:
            _, _, sent_s, intruder, chance = heappop(self._coming)
            lost = chance.random() < self.model.loss
            heard = self._hear(intruder, sent_s, chance, own_m)
            if heard is not None and not lost:
                arrived.append(heard)
            self._expect(sent_s + self.model.period_s, intruder, chance)
        return arrived

    def _expect(self, sent_s: float, intruder: Intruder, chance: random.Random) -> None:
        if sent_s <= intruder.disappears_s:
            arrives_s = sent_s + self.model.delay_s
            heappush(self._coming, (arrives_s, next(self._order), sent_s, intruder, chance))

    def _hear(
        self, intruder: Intruder, sent_s: float, chance: random.Random, own_m: Vec3 | None
    ) -> Heard | None:
        model = self.model
        (north_m, east_m, down_m), (north_mps, east_mps, down_mps) = intruder.state_at(sent_s)
        if own_m is not None and math.hypot(north_m - own_m[0], east_m - own_m[1]) > model.range_m:
            return None
        position_m = (
            north_m + chance.gauss(0.0, model.horizontal_sigma_m),
            east_m + chance.gauss(0.0, model.horizontal_sigma_m),
            down_m + chance.gauss(0.0, model.vertical_sigma_m),
        )
        north_mps += chance.gauss(0.0, model.speed_sigma_mps)
        east_mps += chance.gauss(0.0, model.speed_sigma_mps)
        climb_mps = -down_mps + chance.gauss(0.0, model.climb_sigma_mps)
        return Heard(intruder, sent_s, position_m, (north_mps, east_mps, -climb_mps))


class AdsbReceiver(TrafficReceiver):
    """Reports what it hears as ADSB_VEHICLE, the altitudes with the offset of the model."""

    def reports(self, now_s: float, own_m: Vec3 | None = None) -> list[Message]:
        """The reports that arrived since the last call, in order; `own_m` is the receiver's position."""
        return [self._report(heard) for heard in self.heard(now_s, own_m)]

    def _report(self, heard: Heard) -> Message:
        model, intruder = self.model, heard.intruder
        north_m, east_m, down_m = heard.position_m
        return adsb_vehicle(
            intruder.icao,
            intruder.callsign,
            self.frame.to_geo(north_m, east_m, down_m - model.altitude_offset_m),
            heard.velocity_mps,
            category=intruder.emitter_type,
            barometric=model.barometric,
            age_s=model.delay_s,
            flags=model.flags,
        )
