"""Tracks: what is known of targets, extrapolated to the present in the local frame."""

import cmath
from collections.abc import Sequence
from typing import Final

from companion.geodesy import LocalFrame
from companion.model import Track, TrackState, TrafficKind, Vec2
from companion.traffic.altitude_datums import DatumOffsets, ReportedAltitude, to_sea_level
from companion.traffic.association import leading_target
from companion.traffic.observers import Observers
from companion.traffic.target import Motion, Target

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
