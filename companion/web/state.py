"""A moment as JSON for pages and programs: units in the names, degrees, numbers rounded to their worth.

Every key is explained in `state.md` beside this file.
"""

import json
import math
from functools import lru_cache
from typing import Any

import numpy as np

from companion.airspace.fence_zones import FenceZone
from companion.avoidance.cone import approach_angle_rad, half_angle_rad
from companion.avoidance.own_flight import mission_guidance, own_state
from companion.avoidance.prediction_times import TIMES_S
from companion.avoidance.trajectory import Commands, fly_ahead
from companion.geodesy import LocalFrame
from companion.model import Layer, Ownship, Snapshot, Threat, Track
from companion.output.decision_record import guidance_of, threat_text
from companion.units import course_deg
from companion.web.live_snapshot import LiveSnapshot
from companion.web.rolling_stats import RollingStats

VERSION = 1
_PREDICTED_S = np.arange(0.0, 61.0, 5.0)
# TCAS shows traffic within 6 NM and 1200 ft filled; among small aircraft this is as near.
_NEAR_LAYERS, _NEAR_HEIGHT_M = 2.0, 366.0
_CIRCLE_CORNERS = 48


def state_of(moment: LiveSnapshot, sequence: int, trends: RollingStats) -> dict[str, Any]:
    """The state at one moment; `trends` must have been shown the moments before."""
    shot = moment.snapshot
    return {
        "version": VERSION,
        "sequence": sequence,
        "time_unix_s": round(shot.time_s, 3),
        "aircraft": {
            "autopilot": moment.autopilot,
            "firmware": moment.firmware,
            "system_id": moment.system_id,
            "mode": shot.mode,
            "armed": shot.armed,
        },
        "companion": {
            "role": moment.role,
            "state": shot.state,
            "flying": moment.flying,
            "last_text": shot.last_text,
        },
        "own": _own(shot.ownship, moment),
        "goal": _goal(shot),
        "decision": {
            "layer": str(shot.decision.layer),
            "because": shot.decision.because,
            "guidance": guidance_of(shot.decision.guidance),
            "threats": [json.loads(threat_text(threat)) for threat in shot.decision.threats],
        },
        "predicted": _predicted(moment),
        "volumes": {
            "outer_m": round(moment.avoidance.outer_radius_m),
            "inner_m": round(moment.avoidance.inner_radius_m),
            "well_clear_horizontal_m": round(moment.avoidance.well_clear_horizontal_m, 1),
            "well_clear_vertical_m": round(moment.avoidance.well_clear_vertical_m, 1),
        },
        "cones": _cones(moment),
        "tracks": [_track(track, shot, moment) for track in shot.tracks],
        "mission": _mission(moment),
        "fences": [_fence(zone) for zone in moment.zones],
        "links": trends.links(),
        "service": {
            "uptime_s": round(moment.health.uptime_s, 1),
            "tick_ms_p99": trends.tick_ms_p99(),
            "position_age_s": _or_none(moment.position_age_s, 2),
            "recording_problem": moment.health.recording_problem,
        },
    }


def _deg(angle_rad: float) -> float:
    """A course or bearing in degrees, 0 to 359.9."""
    return round(course_deg(angle_rad), 1) % 360.0


def _or_none(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None


def _own(own: Ownship | None, moment: LiveSnapshot) -> dict[str, Any] | None:
    if own is None or moment.frame is None:
        return None
    place = moment.frame.to_geo(*own.position_m)
    north_mps, east_mps, down_mps = own.velocity_mps
    home_m, wind_mps = moment.home_altitude_m, own.wind_mps
    return {
        "lat_deg": round(place.lat_deg, 7),
        "lon_deg": round(place.lon_deg, 7),
        "north_m": round(own.position_m[0], 1),
        "east_m": round(own.position_m[1], 1),
        "altitude_m": round(place.altitude_m, 1),
        "height_m": None if home_m is None else round(place.altitude_m - home_m, 1),
        "course_deg": _deg(math.atan2(east_mps, north_mps)),
        "heading_deg": _deg(own.heading_rad),
        "ground_speed_mps": round(math.hypot(north_mps, east_mps), 1),
        "airspeed_mps": round(own.airspeed_mps, 1),
        "climb_mps": round(-down_mps, 1),
        "wind_north_mps": None if wind_mps is None else round(wind_mps[0], 1),
        "wind_east_mps": None if wind_mps is None else round(wind_mps[1], 1),
    }


def _goal(shot: Snapshot) -> dict[str, Any] | None:
    """The mission as course, speed and height from here, and the place that it leads to if there is one."""
    goal, own = shot.goal, shot.ownship
    if goal is None or own is None:
        return None
    wanted, place_m = mission_guidance(own_state(shot.time_s, own), own, goal), goal.position_m
    return {
        "course_deg": _deg(wanted.course_rad),
        "airspeed_mps": round(wanted.airspeed_mps, 1),
        "altitude_m": round(wanted.altitude_m, 1),
        "north_m": None if place_m is None else round(place_m[0], 1),
        "east_m": None if place_m is None else round(place_m[1], 1),
    }


def _predicted(moment: LiveSnapshot) -> list[list[float]]:
    """Where what is commanded leads, else the mission."""
    own, goal, guidance = moment.snapshot.ownship, moment.snapshot.goal, moment.snapshot.decision.guidance
    if own is None or goal is None:
        return []
    state = own_state(moment.snapshot.time_s, own)
    flown = guidance or mission_guidance(state, own, goal)
    path_m = fly_ahead(state, Commands.of([flown]), moment.envelope).row_m(0)
    north_m, east_m, down_m = (np.interp(_PREDICTED_S, TIMES_S, path_m[:, axis]) for axis in range(3))
    return [[round(float(x), 1) for x in place] for place in zip(north_m, east_m, -down_m, strict=True)]


def _cones(moment: LiveSnapshot) -> list[dict[str, Any]]:
    shot = moment.snapshot
    own, by_id = shot.ownship, {track.track_id: track for track in shot.tracks}
    threats = [threat for threat in shot.decision.threats if threat.track_id in by_id]
    if own is None or not threats:
        return []
    return [_cone(threat, by_id[threat.track_id], own, moment) for threat in threats]


def _cone(threat: Threat, track: Track, own: Ownship, moment: LiveSnapshot) -> dict[str, Any]:
    params = moment.avoidance
    radius_m = track.protected_horizontal_m or params.well_clear_horizontal_m
    radius_m *= 1.0 + params.horizontal_margin
    rel_m = np.subtract(track.position_m, own.position_m)[None, :2]
    rel_mps = np.subtract(own.velocity_mps, track.velocity_mps)[None, :2]
    half_rad = float(half_angle_rad(np.hypot(rel_m[:, 0], rel_m[:, 1]), np.array([radius_m]))[0])
    alpha_rad = float(approach_angle_rad(rel_m, rel_mps)[0])
    return {
        "track": threat.track_id,
        "bearing_deg": _deg(math.atan2(rel_m[0, 1], rel_m[0, 0])),
        "half_angle_deg": round(math.degrees(half_rad), 1),
        "transition_deg": round(math.degrees(params.delta_beta_rad), 1),
        "relative_course_deg": _deg(math.atan2(rel_mps[0, 1], rel_mps[0, 0])),
        "inside": abs(alpha_rad) <= half_rad,
    }


def _track(track: Track, shot: Snapshot, moment: LiveSnapshot) -> dict[str, Any]:
    north_mps, east_mps, down_mps = track.velocity_mps
    own = shot.ownship
    off_m = (0.0, 0.0, 0.0) if own is None else tuple(np.subtract(track.position_m, own.position_m).tolist())
    distance_m, above_m = math.hypot(off_m[0], off_m[1]), -off_m[2]
    speed_mps = math.hypot(north_mps, east_mps)
    return {
        "track": track.track_id,
        "callsign": track.callsign,
        "icao": None if track.icao is None else f"{track.icao:06X}",
        "kind": str(track.kind),
        "north_m": round(track.position_m[0], 1),
        "east_m": round(track.position_m[1], 1),
        "altitude_m": round(-track.position_m[2], 1),
        "relative_altitude_m": round(above_m, 1),
        "course_deg": _deg(math.atan2(east_mps, north_mps)) if speed_mps > 0.5 else None,
        "ground_speed_mps": round(speed_mps, 1),
        "climb_mps": round(-down_mps, 1),
        "turn_dps": round(math.degrees(track.turn_radps), 2),
        "age_s": round(track.age_s, 1),
        "distance_m": round(distance_m),
        "level": _level(track.track_id, distance_m, above_m, moment),
    }


def _level(track_id: str, distance_m: float, above_m: float, moment: LiveSnapshot) -> str:
    """How a TCAS would show it: red what the inner layer is about, amber what the outer one is."""
    layers = {threat.track_id: threat.layer for threat in moment.snapshot.decision.threats}
    layer = layers.get(track_id, Layer.CLEAR)
    if layer is Layer.INNER:
        return "warning"
    if layer is Layer.OUTER:
        return "caution"
    near = distance_m < _NEAR_LAYERS * moment.avoidance.outer_radius_m and abs(above_m) < _NEAR_HEIGHT_M
    return "proximate" if near else "other"


def _mission(moment: LiveSnapshot) -> dict[str, Any] | None:
    if moment.mission is None:
        return None
    places = moment.mission.places(moment.home_altitude_m)
    return {
        "current": moment.mission_sequence,
        "items": [
            {
                "sequence": sequence,
                "lat_deg": round(place.lat_deg, 7),
                "lon_deg": round(place.lon_deg, 7),
                "altitude_m": round(place.altitude_m, 1),
            }
            for sequence, place in places
        ],
    }


@lru_cache(maxsize=256)
def _fence(zone: FenceZone) -> dict[str, Any]:
    places = list(zone.vertices_deg)
    if zone.centre_deg is not None and zone.radius_m is not None:
        frame = LocalFrame(*zone.centre_deg)
        angles = np.linspace(0.0, math.tau, _CIRCLE_CORNERS, endpoint=False)
        around = [frame.to_geo(zone.radius_m * math.cos(a), zone.radius_m * math.sin(a), 0.0) for a in angles]
        places = [(place.lat_deg, place.lon_deg) for place in around]
    return {
        "inclusion": zone.inclusion,
        "points": [[round(lat_deg, 7), round(lon_deg, 7)] for lat_deg, lon_deg in places],
    }
