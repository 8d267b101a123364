"""A decision as one line of JSON: units in the names, degrees, numbers rounded to what they are worth."""

import json
import math

from companion.model import Decision, Guidance, Ownship, Threat
from companion.units import course_deg


def decision_line(time_s: float, decision: Decision, own: Ownship | None, tracks: int) -> str:
    """One line, without the newline; the same decision gives the same bytes."""
    record = {
        "time_us": round(time_s * 1e6),
        "layer": str(decision.layer),
        "guidance": guidance_of(decision.guidance),
        "threats": [threat_of(threat) for threat in decision.threats],
        "tracks": tracks,
        "own": None
        if own is None
        else {
            "north_m": round(own.position_m[0], 1),
            "east_m": round(own.position_m[1], 1),
            "altitude_m": round(-own.position_m[2], 1),
            "course_deg": round(course_deg(math.atan2(own.velocity_mps[1], own.velocity_mps[0])), 1),
            "airspeed_mps": round(own.airspeed_mps, 1),
        },
        "because": decision.because,
    }
    return json.dumps(record, separators=(",", ":"), allow_nan=False)


def guidance_of(guidance: Guidance | None) -> dict[str, object] | None:
    """What is commanded; `None` is the mission."""
    if guidance is None:
        return None
    return {
        "course_deg": round(course_deg(guidance.course_rad), 2),
        "airspeed_mps": round(guidance.airspeed_mps, 2),
        "altitude_m": round(guidance.altitude_m, 1),
    }


def threat_of(threat: Threat) -> dict[str, object]:
    """A threat as it was seen when decided."""
    to_closest_s = threat.time_to_closest_s
    return {
        "track": threat.track_id,
        "distance_m": round(threat.distance_m, 1),
        "relative_altitude_m": round(threat.relative_altitude_m, 1),
        "bearing_deg": round(course_deg(threat.bearing_rad), 1),
        "closing_mps": round(threat.closing_mps, 1),
        "time_to_closest_s": round(to_closest_s, 1) if math.isfinite(to_closest_s) else None,
        "miss_horizontal_m": round(threat.miss_horizontal_m, 1),
        "miss_vertical_m": round(threat.miss_vertical_m, 1),
        "layer": str(threat.layer),
    }
