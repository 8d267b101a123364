"""Two members of a formation whose ways cross at right angles after 48 s, one of them a PX4."""

from typing import Any

from sim.files import checked_from
from sim.members.scenario import FormationScenario

TWO: dict[str, Any] = {
    "description": "two ways that cross",
    "duration_s": 180,
    "home": {"lat_deg": 47.0, "lon_deg": 8.0, "altitude_m": 400.0},
    "formation": [
        {
            "name": "NORTH",
            "system_id": 7,
            "airspeed_mps": 25,
            "start": {"where": "air", "heading_deg": 0, "north_m": -1250, "height_m": 300},
            "mission": {
                "takeoff_height_m": 60,
                "waypoints": [{"north_m": 1200, "east_m": 0, "height_m": 300}],
            },
        },
        {
            "name": "EAST",
            "system_id": 8,
            "autopilot": "px4",
            "airspeed_mps": 25,
            "start": {"where": "air", "heading_deg": 90, "east_m": -1250, "height_m": 300},
            "mission": {
                "takeoff_height_m": 60,
                "waypoints": [{"north_m": 0, "east_m": 1200, "height_m": 300}],
            },
        },
    ],
}


def two_members(**changes: Any) -> FormationScenario:
    """The scenario, with some keys of the file changed."""
    return checked_from({**TWO, **changes}, FormationScenario, "test")
