"""A decision as one line of JSON: units in the names, degrees, numbers rounded to their accuracy."""

import json
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

from companion.geodesy import LocalFrame, course_deg
from companion.model import Decision, Guidance, Ownship, Threat, Track, TrackState, TrafficKind, Vec3


class Circumstances(NamedTuple):
    """The state machine's state, the autopilot's mode and the local frame at the decision.

    `concerns` are JSON values about traffic that is not avoided or is odd; `reports` counts the reports of
    each track since the start.
    """

    state: str
    flying: bool
    mode: str | None
    frame: LocalFrame | None
    home_m: float | None = None  # altitude of home
    concerns: Sequence[Mapping[str, object]] = ()
    reports: Mapping[str, int] = MappingProxyType({})


def decision_line(
    time_s: float, decision: Decision, own: Ownship, tracks: Sequence[Track], around: Circumstances
) -> str:
    """One line without the newline; the same decision gives the same bytes.

    `traffic` lists all tracks, with `north_m` and `east_m` relative to `own`; `tracks` is their number.
    """
    place = None if around.frame is None else around.frame.to_geo(*own.position_m)
    north_mps, east_mps, down_mps = own.velocity_mps
    record = {
        "time_us": round(time_s * 1e6),
        "layer": str(decision.layer),
        "state": around.state,
        "flying": around.flying,
        "mode": around.mode,
        "guidance": guidance_of(decision.guidance),
        "tracks": len(tracks),
        "own": {
            "lat_deg": None if place is None else round(place.lat_deg, 7),
            "lon_deg": None if place is None else round(place.lon_deg, 7),
            "north_m": round(own.position_m[0], 1),
            "east_m": round(own.position_m[1], 1),
            "altitude_m": round(-own.position_m[2], 1),
            "height_m": None if around.home_m is None else round(-own.position_m[2] - around.home_m, 1),
            "course_deg": round(course_deg(math.atan2(east_mps, north_mps)), 1),
            "ground_speed_mps": round(math.hypot(north_mps, east_mps), 1),
            "airspeed_mps": round(own.airspeed_mps, 1),
            "climb_mps": round(-down_mps, 1),
        },
        "because": decision.because,
    }
    text = json.dumps(record, separators=(",", ":"), allow_nan=False)
    threats = ",".join(map(threat_text, decision.threats))
    traffic = _traffic(tracks, own.position_m, around.reports)
    concerns = json.dumps(around.concerns, separators=(",", ":"), allow_nan=False)
    return f'{text[:-1]},"threats":[{threats}],"traffic":[{traffic}],"concerns":{concerns}}}'


def guidance_of(guidance: Guidance | None) -> dict[str, object] | None:
    """The commanded guidance as JSON values; `None` is the mission."""
    if guidance is None:
        return None
    return {
        "course_deg": round(course_deg(guidance.course_rad), 2),
        "airspeed_mps": round(guidance.airspeed_mps, 2),
        "altitude_m": round(guidance.altitude_m, 1),
    }


# Threats and tracks are formatted here, ten times a second: the json module takes six times as long.
_THREAT = (
    '{"track":%s,"distance_m":%.1f,"relative_altitude_m":%.1f,"bearing_deg":%.1f,"closing_mps":%.1f,'
    '"time_to_closest_s":%s,"miss_horizontal_m":%.1f,"miss_vertical_m":%.1f,"layer":"%s"}'
)
_TRACK = (
    '%s,"north_m":%.1f,"east_m":%.1f,"altitude_m":%.1f,"course_deg":%.1f,"ground_speed_mps":%.1f,'
    '"climb_mps":%.1f,"age_s":%.1f,%s,%s,"vertical_uncertainty_m":%.1f,"reports":%d}'
)
_SIGMAS = '"position_sigma_m":%.1f,"velocity_sigma_mps":%.1f'


def threat_text(threat: Threat) -> str:
    """A threat at the moment of the decision, as JSON."""
    values = (
        threat.distance_m,
        threat.relative_altitude_m,
        course_deg(threat.bearing_rad),
        threat.closing_mps,
        threat.miss_horizontal_m,
        threat.miss_vertical_m,
    )
    _insist_on_finite(sum(values))
    to_closest = f"{threat.time_to_closest_s:.1f}" if math.isfinite(threat.time_to_closest_s) else "null"
    return _THREAT % (_quoted(threat.track_id), *values[:4], to_closest, *values[4:], threat.layer)


def _traffic(tracks: Sequence[Track], own_m: Vec3, reports: Mapping[str, int]) -> str:
    own_north_m, own_east_m, _ = own_m
    check = 0.0
    lines = []
    for track in tracks:
        north_m, east_m, down_m = track.position_m
        north_mps, east_mps, down_mps = track.velocity_mps
        check += north_m + east_m + down_m + north_mps + east_mps + down_mps + track.age_s
        check += track.vertical_uncertainty_m
        course = math.degrees(math.atan2(east_mps, north_mps)) % 360.0
        lines.append(
            _TRACK
            % (
                _names(track.track_id, track.icao, track.callsign, track.kind),
                north_m - own_north_m,
                east_m - own_east_m,
                -down_m,
                course,
                math.hypot(north_mps, east_mps),
                -down_mps,
                track.age_s,
                _evidence(track.state, track.sources, track.alarm),
                _sigmas(track.position_sigma_m, track.velocity_sigma_mps),
                track.vertical_uncertainty_m,
                reports.get(track.track_id, 0),
            )
        )
    _insist_on_finite(check)
    return ",".join(lines)


def _sigmas(position_m: float | None, velocity_mps: float | None) -> str:
    if position_m is not None and velocity_mps is not None and math.isfinite(position_m + velocity_mps):
        return _SIGMAS % (position_m, velocity_mps)
    known = [
        None if one is None or not math.isfinite(one) else round(one, 1) for one in (position_m, velocity_mps)
    ]
    return '"position_sigma_m":{},"velocity_sigma_mps":{}'.format(*map(json.dumps, known))


def _insist_on_finite(check: float) -> None:
    """ValueError for a number that is not finite, as `allow_nan=False` does in the json module."""
    if not math.isfinite(check):
        raise ValueError("a track is not finite")


_quoted = lru_cache(maxsize=4096)(json.dumps)


@lru_cache(maxsize=4096)
def _names(track_id: str, icao: int | None, callsign: str | None, kind: TrafficKind) -> str:
    """The constant fields of a track as JSON, without the closing brace."""
    names = {
        "track": track_id,
        "icao": None if icao is None else f"{icao:06X}",
        "callsign": callsign,
        "kind": str(kind),
    }
    return json.dumps(names, separators=(",", ":"))[:-1]


@lru_cache(maxsize=4096)
def _evidence(state: TrackState, sources: tuple[str, ...], alarm: int) -> str:
    """What the evidence of a track is, as JSON without braces."""
    return json.dumps({"state": str(state), "sources": sources, "alarm": alarm}, separators=(",", ":"))[1:-1]
