"""Tracks: what is known of targets, extrapolated to the present in the local frame, and for how long.

A usual track is dropped after `stale_s`. One in conflict, or one that meets our present flight, is coasted
past its predicted meeting, then lost: silence is no evidence that it went away (Blackman and Popoli 1999,
6.2: track deletion).
"""

import cmath
import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.model import Track, TrackState, TrafficKind, Vec2
from companion.traffic.altitudes import DatumOffsets, ReportedAltitude, SeaLevelAltitude, to_sea_level
from companion.traffic.observers import Observers
from companion.traffic.own_aircraft import OwnTrail
from companion.traffic.params import TrafficParams
from companion.traffic.store import leading_target
from companion.traffic.target import Motion, Target

# A meeting: the straight predictions come this near within this time.
_MEETING_M, _MEETING_HEIGHT_M, _MEETING_WITHIN_S = 3_000.0, 300.0, 120.0
# A threat is of the present conflict until this long after it was one; its end is explained by its silence.
_RECENT_S: Final = 20.0
_MOST_LOST: Final = 32
# Losses are shown for this long.
_SHOWN_S: Final = 30.0
_TOLERANCE_S: Final = 1e-3


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
        """Whether a target that is not heard for the usual time is extrapolated on.

        One that was reported once, and never confirmed, is not: of a flood, each would last for minutes.
        """
        if (
            not target.is_confirmed
            or not target.shown
            or target.evidence.on_ground
            or now_s - target.measured_s > self._params.coast_s
        ):
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
        """Note a track that is given up, if it is in conflict, or was silent when it was the last time."""
        motion, threat = target.motion, self._threats.get(target.track_id)
        silent_threat = threat is not None and threat.was_silent and target.measured_s <= threat.measured_s
        if motion is None or not (target.threat or silent_threat):
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


# Of more tracks than this, those that cannot be near us within this time are made again once a second only.
_MANY, _FAR_S, _MADE_AGAIN_S = 200, 90.0, 1.0


class FarTracks:
    """The last tracks of far aircraft, while there are many: each tick makes a tenth of them."""

    def __init__(self) -> None:
        self._made: dict[str, Track] = {}
        self._frame: LocalFrame | None = None
        self._offset_s = 0.0

    def begin(self, frame: LocalFrame, targets: int, offset_s: float) -> None:
        """Begin the tracks of a moment; `offset_s`: the caller's clock minus the monotonic one."""
        if targets <= _MANY or frame != self._frame or abs(offset_s - self._offset_s) > _TOLERANCE_S:
            self._made.clear()
        self._frame, self._offset_s = (frame if targets > _MANY else None), offset_s

    def known(self, target: Target, now_s: float) -> Track | None:
        """The track as made before, if it may be used at `now_s` on the monotonic clock."""
        track = self._made.get(target.track_id)
        if track is None:
            return None
        made_s = track.time_s - self._offset_s
        again = now_s - made_s > _MADE_AGAIN_S - _TOLERANCE_S
        news = abs(made_s - track.age_s - target.measured_s) > _TOLERANCE_S
        return None if again or news or not self._is_far(target, now_s) else track

    def keep(self, target: Target, track: Track | None, now_s: float) -> None:
        """Note a track that was made."""
        if self._frame is None:
            return
        if track is None or not self._is_far(target, now_s):
            self._made.pop(target.track_id, None)
        else:
            self._made[target.track_id] = track

    def remove(self, track_id: str) -> None:
        """Forget a target that is not received any more."""
        self._made.pop(track_id, None)

    @staticmethod
    def _is_far(target: Target, now_s: float) -> bool:
        return not target.threat and target.reach_s - (now_s - target.measured_s) > _FAR_S


# A turn is not extrapolated for longer: its end is unknown.
_TURN_S: Final = 20.0


class TrackMaker:
    """Makes the tracks of one moment."""

    def __init__(self, now_s: float, monotonic_s: float, frame: LocalFrame, offsets: DatumOffsets) -> None:
        self._now_s, self._monotonic_s = now_s, monotonic_s
        self._frame, self._scale = frame, frame.metres_per_degree
        self._offsets = offsets

    def track(self, target: Target, observers: Observers | None) -> Track | None:
        """The track of one target; `None` without a position or an altitude."""
        motion = target.motion
        if motion is None:
            return None
        sources = (target.source.value,) if observers is None else observers.names(self._monotonic_s)
        return self._make(target, target, motion, motion.altitudes, sources)

    def track_of_group(self, target: Target, members: Sequence[Target]) -> Track | None:
        """The track of targets that are one aircraft: the best position, the most certain altitude."""
        altitudes = [altitude for member in members if member.motion for altitude in member.motion.altitudes]
        leading = leading_target(members, self._monotonic_s)
        if leading.motion is None:
            return None
        recent = [member for member in members if not member.is_silent(self._monotonic_s)]
        names = {member.last.report.heard_by or member.source.value for member in recent or [leading]}
        return self._make(target, leading, leading.motion, tuple(altitudes), tuple(sorted(names)))

    def _make(
        self,
        target: Target,
        leading: Target,
        motion: Motion,
        altitudes: tuple[ReportedAltitude, ...],
        sources: tuple[str, ...],
    ) -> Track | None:
        age_s = self._monotonic_s - leading.measured_s
        coasted = target.threat or self._monotonic_s > target.expires_s
        altitude = to_sea_level(altitudes, self._offsets, self._monotonic_s, coast=coasted)
        if altitude is None:
            return None
        north_m, east_m, north_mps, east_mps = _extrapolate(
            motion, self._monotonic_s, self._frame, self._scale
        )
        # By position: with a thousand tracks, keywords cost as much as the arithmetic.
        return Track(
            target.track_id,
            self._now_s,
            (north_m, east_m, -altitude.altitude_m),
            (north_mps, east_mps, -altitude.climb_mps),
            target.icao,
            target.callsign,
            TrafficKind.SURFACE_VEHICLE if leading.evidence.on_ground else leading.kind,
            age_s,
            None,
            None,
            None,
            altitude.uncertainty_m,
            motion.turn_radps if age_s <= _TURN_S else 0.0,
            self._state(target, leading),
            leading.position_sigma_m(self._monotonic_s),
            leading.velocity_sigma_mps,
            sources,
            target.alarm,
        )

    def _state(self, target: Target, leading: Target) -> TrackState:
        if leading.kind is not TrafficKind.OBSTACLE and leading.is_silent(self._monotonic_s):
            return TrackState.COASTED
        return TrackState.CONFIRMED if target.is_confirmed else TrackState.TENTATIVE


def _extrapolate(
    motion: Motion, monotonic_s: float, frame: LocalFrame, metres_per_degree: Vec2
) -> tuple[float, float, float, float]:
    """Position [m] and velocity [m/s] at the given time: north, east, north, east.

    The turn is applied to the velocity only: it changes the position by metres, but the course by degrees.
    """
    lat_deg, lon_deg, position_s, north_mps, east_mps, turn_radps, _, _ = motion
    elapsed_s = monotonic_s - position_s
    # Inlined from `LocalFrame.to_north_east_m`: calls cost too much for a thousand tracks.
    dlon_deg = (lon_deg - frame.lon_deg + 180.0) % 360.0 - 180.0
    north_m = (lat_deg - frame.lat_deg) * metres_per_degree[0] + north_mps * elapsed_s
    east_m = dlon_deg * metres_per_degree[1] + east_mps * elapsed_s
    if turn_radps != 0.0 and elapsed_s <= _TURN_S:
        turned = cmath.rect(1.0, turn_radps * elapsed_s) * complex(north_mps, east_mps)
        north_mps, east_mps = turned.real, turned.imag
    return north_m, east_m, north_mps, east_mps
