"""A snapshot as JSON for the page and other programs: units in the names, angles in degrees, numbers rounded.

`state.md` beside this file explains every key.
"""

import json
import math
from functools import lru_cache
from typing import Any

import numpy as np

from companion.airspace.fences import FenceZone
from companion.avoidance.intruders import approach_angle_rad, half_angle_rad
from companion.avoidance.mission_path import mission_guidance
from companion.avoidance.trajectory import TIMES_S, Commands, fly_ahead, own_state
from companion.gcs.concern_values import concern_values
from companion.gcs.traffic_conditions import TRAFFIC_KEY
from companion.geodesy import LocalFrame, course_deg
from companion.model import Layer, Ownship, Snapshot, Threat, Track
from companion.output.decision_record import guidance_of, threat_text
from companion.output.notice import Condition
from companion.web.live_snapshot import LiveSnapshot
from companion.web.rolling_stats import RollingStats

VERSION = 1
_PREDICTED_S = np.arange(0.0, 61.0, 5.0)
# TCAS shows traffic within 6 NM and 1200 ft as proximate. Small aircraft are slower: two outer radii instead.
_NEAR_LAYERS, _NEAR_HEIGHT_M = 2.0, 366.0
_CIRCLE_CORNERS = 48


def state_of(live: LiveSnapshot, sequence: int, stats: RollingStats) -> dict[str, Any]:
    """The state as a dictionary; `stats` must contain the health of this snapshot and those before."""
    snapshot = live.snapshot
    return {
        "version": VERSION,
        "sequence": sequence,
        "time_unix_s": round(snapshot.time_s, 3),
        "aircraft": {
            "autopilot": live.autopilot,
            "firmware": live.firmware,
            "system_id": live.system_id,
            "mode": snapshot.mode,
            "armed": snapshot.armed,
        },
        "companion": {
            "role": live.role,
            "state": snapshot.state,
            "flying": live.flying,
            "last_text": snapshot.last_text,
            "conditions": [_condition(one) for one in live.conditions],
        },
        "own": _own(snapshot.ownship, live),
        "goal": _goal(snapshot),
        "decision": {
            "layer": str(snapshot.decision.layer),
            "because": snapshot.decision.because,
            "maneuver": snapshot.maneuver,
            "announced": snapshot.maneuver_text,
            "guidance": guidance_of(snapshot.decision.guidance),
            "threats": [json.loads(threat_text(threat)) for threat in snapshot.decision.threats],
        },
        "predicted": _predicted(live),
        "volumes": {
            "outer_m": round(live.avoidance.outer_radius_m),
            "inner_m": round(live.avoidance.inner_radius_m),
            "well_clear_horizontal_m": round(live.avoidance.well_clear_horizontal_m, 1),
            "well_clear_vertical_m": round(live.avoidance.well_clear_vertical_m, 1),
        },
        "cones": _cones(live),
        "tracks": [_track(track, live) for track in snapshot.tracks],
        "concerns": [concern_values(concern) for concern in live.concerns],
        "mission": _mission(live),
        "fences": [_fence(zone) for zone in live.zones],
        "links": stats.links(),
        "receivers": stats.receivers(),
        "service": {
            "uptime_s": round(live.health.uptime_s, 1),
            "tick_ms_p99": stats.tick_ms_p99(),
            "position_age_s": _or_none(live.position_age_s, 2),
            "recording_problem": live.health.recording_problem,
        },
    }


def _condition(one: Condition) -> dict[str, Any]:
    values: dict[str, Any] = {"severity": one.severity, "text": one.text}
    return values | {"of_traffic": True} if one.key.startswith(TRAFFIC_KEY) else values


def _deg(angle_rad: float) -> float:
    """A course or bearing in degrees, 0 to 359.9."""
    return round(course_deg(angle_rad), 1) % 360.0


def _or_none(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None


def _rounded(value: float | None) -> float | None:
    return None if value is None else _or_none(value, 1)


def _own(own: Ownship | None, live: LiveSnapshot) -> dict[str, Any] | None:
    if own is None or live.frame is None:
        return None
    place = live.frame.to_geo(*own.position_m)
    north_mps, east_mps, down_mps = own.velocity_mps
    home_m, wind_mps = live.home_altitude_m, own.wind_mps
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


def _goal(snapshot: Snapshot) -> dict[str, Any] | None:
    """Course, airspeed and altitude of the mission from here, and its next position if it has one."""
    goal, own = snapshot.goal, snapshot.ownship
    if goal is None or own is None:
        return None
    mission, position_m = mission_guidance(own_state(snapshot.time_s, own), own, goal), goal.position_m
    return {
        "course_deg": _deg(mission.course_rad),
        "airspeed_mps": round(mission.airspeed_mps, 1),
        "altitude_m": round(mission.altitude_m, 1),
        "north_m": None if position_m is None else round(position_m[0], 1),
        "east_m": None if position_m is None else round(position_m[1], 1),
    }


def _predicted(live: LiveSnapshot) -> list[list[float]]:
    """The path of the guidance, else of the mission: [north_m, east_m, altitude_m] in steps of 5 s."""
    own, goal, guidance = live.snapshot.ownship, live.snapshot.goal, live.snapshot.decision.guidance
    if own is None or goal is None:
        return []
    state = own_state(live.snapshot.time_s, own)
    flown = guidance or mission_guidance(state, own, goal)
    path_m = fly_ahead(state, Commands.of([flown]), live.envelope).row_m(0)
    north_m, east_m, down_m = (np.interp(_PREDICTED_S, TIMES_S, path_m[:, axis]) for axis in range(3))
    return [[round(float(x), 1) for x in place] for place in zip(north_m, east_m, -down_m, strict=True)]


def _cones(live: LiveSnapshot) -> list[dict[str, Any]]:
    snapshot = live.snapshot
    own, by_id = snapshot.ownship, {track.track_id: track for track in snapshot.tracks}
    threats = [threat for threat in snapshot.decision.threats if threat.track_id in by_id]
    if own is None or not threats:
        return []
    return [_cone(threat, by_id[threat.track_id], own, live) for threat in threats]


def _cone(threat: Threat, track: Track, own: Ownship, live: LiveSnapshot) -> dict[str, Any]:
    params = live.avoidance
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


def _track(track: Track, live: LiveSnapshot) -> dict[str, Any]:
    north_mps, east_mps, down_mps = track.velocity_mps
    own = live.snapshot.ownship
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
        "state": str(track.state),
        "sources": list(track.sources),
        "position_sigma_m": _rounded(track.position_sigma_m),
        "velocity_sigma_mps": _rounded(track.velocity_sigma_mps),
        "vertical_uncertainty_m": round(track.vertical_uncertainty_m, 1),
        "alarm": track.alarm,
        "distance_m": round(distance_m),
        "level": _level(track.track_id, distance_m, above_m, live),
    }


def _level(track_id: str, distance_m: float, above_m: float, live: LiveSnapshot) -> str:
    """The level as on a TCAS: warning for threats of the inner layer, caution for those of the outer one."""
    layers = {threat.track_id: threat.layer for threat in live.snapshot.decision.threats}
    layer = layers.get(track_id, Layer.CLEAR)
    if layer is Layer.INNER:
        return "warning"
    if layer is Layer.OUTER:
        return "caution"
    near = distance_m < _NEAR_LAYERS * live.avoidance.outer_radius_m and abs(above_m) < _NEAR_HEIGHT_M
    return "proximate" if near else "other"


def _mission(live: LiveSnapshot) -> dict[str, Any] | None:
    if live.mission is None:
        return None
    places = live.mission.places(live.home_altitude_m)
    return {
        "current": live.mission_sequence,
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
