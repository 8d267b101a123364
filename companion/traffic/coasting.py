"""Coasting: tracks that are not heard any more are extrapolated past their predicted meeting, then lost.

A usual track is dropped after `stale_s`. One in conflict, or one that meets our present flight, is kept for
longer: silence is no evidence that it went away (Blackman and Popoli 1999, 6.2: track deletion).
"""

import math
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.traffic.altitude_datums import SeaLevelAltitude
from companion.traffic.own_trail import OwnTrail
from companion.traffic.params import TrafficParams
from companion.traffic.target import Target

# A meeting: the straight predictions come this near within this time.
_MEETING_M, _MEETING_HEIGHT_M, _MEETING_WITHIN_S = 3_000.0, 300.0, 120.0
# A threat is of the present conflict until this long after it was one; its end is explained by its silence.
_RECENT_S: Final = 20.0
_MOST_LOST: Final = 32
# Losses are shown for this long.
_SHOWN_S: Final = 30.0


class Lost(NamedTuple):
    """A track that was in conflict or near us, and was given up at `lost_s`."""

    track_id: str
    name: str
    measured_s: float
    lost_s: float
    lat_deg: float
    lon_deg: float


class _Threat(NamedTuple):
    """A track in conflict: when it was the last time, and whether it was heard then."""

    noted_s: float
    measured_s: float
    was_silent: bool


class Coasting:
    """Which silent tracks are kept, and which of those that mattered were lost."""

    def __init__(self, params: TrafficParams, trail: OwnTrail) -> None:
        self._params = params
        self._trail = trail
        self._lost: dict[str, Lost] = {}
        self._threats: dict[str, _Threat] = {}

    def note_threats(self, track_ids: list[str], targets: dict[str, Target], now_s: float) -> None:
        """Note which tracks are in conflict with us, as decided now."""
        recent = {key: one for key, one in self._threats.items() if now_s - one.noted_s <= _RECENT_S}
        # The last threats of a conflict stay, however long the aircraft then waits before it returns.
        if track_ids:
            self._threats = recent
        for track_id in track_ids:
            target = targets.get(track_id)
            if target is not None:
                self._threats[track_id] = _Threat(now_s, target.measured_s, target.is_silent(now_s))

    def keeps(self, target: Target, altitude: SeaLevelAltitude | None, now_s: float) -> bool:
        """Whether a target that is not heard for the usual time is extrapolated on."""
        if not target.shown or target.evidence.on_ground or now_s - target.measured_s > self._params.coast_s:
            return False
        return target.threat or self._meets_us(target, altitude, now_s)

    def _meets_us(self, target: Target, altitude: SeaLevelAltitude | None, now_s: float) -> bool:
        """Whether the straight predictions of both meet in the next minutes."""
        own, motion = self._trail.latest, target.motion
        if own is None or motion is None or altitude is None:
            return False
        frame = LocalFrame(own.lat_deg, own.lon_deg)
        north_m, east_m = frame.to_north_east_m(motion.lat_deg, motion.lon_deg)
        elapsed_s, own_elapsed_s = now_s - motion.position_s, now_s - own.time_s
        north_m += motion.north_mps * elapsed_s - own.north_mps * own_elapsed_s
        east_m += motion.east_mps * elapsed_s - own.east_mps * own_elapsed_s
        north_mps, east_mps = motion.north_mps - own.north_mps, motion.east_mps - own.east_mps
        speed2 = max(north_mps**2 + east_mps**2, 1e-6)
        meeting_s = -(north_m * north_mps + east_m * east_mps) / speed2
        if not 0.0 < meeting_s <= _MEETING_WITHIN_S:
            return False
        miss_m = math.hypot(north_m + north_mps * meeting_s, east_m + east_mps * meeting_s)
        above_m = abs(altitude.altitude_m - own.altitude_m)
        return miss_m <= _MEETING_M and above_m - altitude.uncertainty_m <= _MEETING_HEIGHT_M

    def note_lost(self, target: Target, now_s: float) -> None:
        """Note a track that is given up, if it was in conflict or may have been near."""
        motion = target.motion
        if motion is None or not target.shown or not (target.threat or target.track_id in self._threats):
            return
        name = target.callsign or target.track_id
        if len(self._lost) >= _MOST_LOST:
            del self._lost[next(iter(self._lost))]
        self._lost[target.track_id] = Lost(
            target.track_id, name, target.measured_s, now_s, motion.lat_deg, motion.lon_deg
        )

    def lost(self, now_s: float) -> list[Lost]:
        """The tracks that were given up a short time ago."""
        return [one for one in self._lost.values() if now_s - one.lost_s <= _SHOWN_S]

    def unheard(self, targets: dict[str, Target], now_s: float) -> tuple[str, float] | None:
        """Name and silence [s] of the threat that ended the conflict because it is not heard any more."""
        silent: list[tuple[float, str]] = []
        for track_id, threat in self._threats.items():
            target, lost = targets.get(track_id), self._lost.get(track_id)
            heard_since = target is not None and target.measured_s > threat.measured_s
            if threat.was_silent and not heard_since:
                name = track_id if target is None else target.callsign or track_id
                silent.append((now_s - threat.measured_s, name if lost is None else lost.name))
        if not silent:
            return None
        silent_s, name = max(silent)
        return name, silent_s
