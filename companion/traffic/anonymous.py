"""Aircraft without an identifier, followed by place and motion.

Each report goes to the nearest aircraft that it fits (nearest neighbour within a gate; Blackman and Popoli
1999, 6.3), and one of a batch to one aircraft only. One that fits none begins an aircraft, which is a track
when a second report confirms it (M of N initiation), or at once where it may be near us within seconds.
"""

from collections.abc import Callable
from typing import Final

from companion.traffic.contact import URGENT_S, Assignment
from companion.traffic.measurement import DropReason, Measurement, RepeatFilter
from companion.traffic.params import TrafficParams
from companion.traffic.store import Grid
from companion.traffic.target import Target

_MOST_REPEATS: Final = 4096
# Reports of one receiver at one moment are of different aircraft.
_BATCH_S: Final = 0.05
# A fit is at most so many gates away, and of a similar velocity.
_FURTHEST: Final = 6.0


class AnonymousContacts:
    """All aircraft without an identifier."""

    def __init__(self, params: TrafficParams, grid: Grid) -> None:
        self.repeats = RepeatFilter(params.repeat_window_s, _MOST_REPEATS)
        self._params = params
        self._grid = grid
        self._count = 0

    def assign(self, measurement: Measurement, reach_s: Callable[[Measurement], float]) -> Assignment:
        """Update the aircraft that a measurement fits, or begin one; `reach_s`: how soon it may be near."""
        nearest, distance = None, _FURTHEST
        for target in self._grid.near(measurement.lat_deg, measurement.lon_deg):
            if not target.anonymous or self._is_same_batch(target, measurement):
                continue
            away = target.distance(measurement)
            if away < distance and target.explains(measurement) and target.explains_velocity(measurement):
                nearest, distance = target, away
        if nearest is None:
            self._count += 1
            reach = reach_s(measurement)
            measurement = measurement._replace(urgent=reach < URGENT_S)
            nearest = Target(measurement, f"ANON-{self._count}", 1, self._params, anonymous=True)
        elif measurement.time_s < nearest.measured_s:
            return Assignment(None, [DropReason.REORDERED], [])
        return Assignment(nearest, nearest.receive(measurement), [])

    @staticmethod
    def _is_same_batch(target: Target, measurement: Measurement) -> bool:
        last = target.last
        return (
            abs(measurement.received_s - last.received_s) < _BATCH_S and last.observer == measurement.observer
        )
