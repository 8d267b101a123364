"""The topics of a recording, and the schemas of their messages: JSON schemas that Foxglove can read.

Foxglove allows one type for each property: one that may be null is marked `nullable`. It needs the properties
of every object and allows no lists of lists: such lists in the messages are left out here.
"""

import json
from dataclasses import dataclass
from typing import Any

Schema = dict[str, Any]


@dataclass(frozen=True)
class Topic:
    """One topic of the MCAP file, with the schema of its JSON messages."""

    name: str
    schema_name: str
    schema: Schema

    @property
    def schema_text(self) -> bytes:
        """The schema as written in the file."""
        return json.dumps(self.schema, separators=(",", ":")).encode()


_NUMBER: Schema = {"type": "number"}
_INTEGER: Schema = {"type": "integer"}
_BOOLEAN: Schema = {"type": "boolean"}
_TEXT: Schema = {"type": "string"}
_NULLABLE: Schema = {"nullable": True}


def _object(properties: Schema) -> Schema:
    return {"type": "object", "properties": properties}


def _list(properties: Schema) -> Schema:
    return {"type": "array", "items": _object(properties)}


def _numbers(names: str) -> Schema:
    return dict.fromkeys(names.split(), _NUMBER)


def _numbers_or_null(names: str) -> Schema:
    return dict.fromkeys(names.split(), _NUMBER | _NULLABLE)


def _texts_or_null(names: str) -> Schema:
    return dict.fromkeys(names.split(), _TEXT | _NULLABLE)


_GUIDANCE = _object(_numbers("course_deg airspeed_mps altitude_m")) | _NULLABLE
_THREATS = _list(
    {
        "track": _TEXT,
        **_numbers("distance_m relative_altitude_m bearing_deg closing_mps"),
        **_numbers_or_null("time_to_closest_s"),
        **_numbers("miss_horizontal_m miss_vertical_m"),
        "layer": _TEXT,
    }
)
_EVIDENCE = (
    {"state": _TEXT, "sources": {"type": "array", "items": _TEXT}, "alarm": _INTEGER}
    | _numbers_or_null("position_sigma_m velocity_sigma_mps")
    | _numbers("vertical_uncertainty_m")
)
_CONCERNS = _list(
    {"kind": _TEXT, "name": _TEXT, "avoided": _BOOLEAN}
    | _numbers_or_null("distance_m bearing_deg")
    | _numbers("seconds")
)

DECISION = Topic(
    "/companion/decision",
    "companion.Decision",
    _object(
        {
            "time_us": _INTEGER,
            "layer": _TEXT,
            "state": _TEXT,
            "flying": _BOOLEAN,
            **_texts_or_null("mode"),
            "guidance": _GUIDANCE,
            "tracks": _INTEGER,
            "own": _object(
                _numbers_or_null("lat_deg lon_deg")
                | _numbers("north_m east_m altitude_m")
                | _numbers_or_null("height_m")
                | _numbers("course_deg ground_speed_mps airspeed_mps climb_mps")
            ),
            "because": _TEXT,
            "threats": _THREATS,
            # North and east from our own aircraft.
            "traffic": _list(
                {"track": _TEXT, **_texts_or_null("icao callsign"), "kind": _TEXT}
                | _numbers("north_m east_m altitude_m course_deg ground_speed_mps climb_mps age_s")
                | _EVIDENCE
                | {"reports": _INTEGER}
            ),
            "concerns": _CONCERNS,
        }
    ),
)

STATE = Topic(
    "/companion/state",
    "companion.State",
    _object(
        {
            "version": _INTEGER,
            "time_unix_s": _NUMBER,
            "sequence": _INTEGER,
            "aircraft": _object(
                _texts_or_null("autopilot firmware mode")
                | {"system_id": _INTEGER | _NULLABLE, "armed": _BOOLEAN}
            ),
            "companion": _object(
                {"role": _TEXT, "state": _TEXT, "flying": _BOOLEAN, "last_text": _TEXT}
                | {"conditions": _list({"severity": _INTEGER, "text": _TEXT, "of_traffic": _BOOLEAN})},
            ),
            "own": _object(
                _numbers("lat_deg lon_deg north_m east_m altitude_m")
                | _numbers_or_null("height_m")
                | _numbers("course_deg heading_deg ground_speed_mps airspeed_mps climb_mps")
                | _numbers_or_null("wind_north_mps wind_east_mps")
            )
            | _NULLABLE,
            "goal": _object(_numbers_or_null("course_deg airspeed_mps altitude_m north_m east_m"))
            | _NULLABLE,
            "decision": _object(
                {"layer": _TEXT, "because": _TEXT, "maneuver": _TEXT, "announced": _TEXT}
                | {"guidance": _GUIDANCE, "threats": _THREATS},
            ),
            "volumes": _object(
                _numbers("outer_m inner_m well_clear_horizontal_m well_clear_vertical_m"),
            ),
            "cones": _list(
                {"track": _TEXT, "inside": _BOOLEAN}
                | _numbers("bearing_deg half_angle_deg transition_deg relative_course_deg")
            ),
            "tracks": _list(
                {"track": _TEXT, **_texts_or_null("callsign icao"), "kind": _TEXT, "level": _TEXT}
                | _numbers("north_m east_m altitude_m relative_altitude_m")
                | _numbers_or_null("course_deg")
                | _numbers("ground_speed_mps climb_mps turn_dps age_s distance_m")
                | _EVIDENCE
            ),
            "concerns": _CONCERNS,
            "mission": _object(
                {
                    "current": _INTEGER | _NULLABLE,
                    "items": _list({"sequence": _INTEGER, **_numbers("lat_deg lon_deg altitude_m")}),
                }
            )
            | _NULLABLE,
            "fences": _list({"inclusion": _BOOLEAN}),
            "links": _list(
                {"address": _TEXT, "connected": _BOOLEAN}
                | _numbers("frames_per_s lost_share")
                | _numbers_or_null("silent_s")
            ),
            "receivers": _list(
                {"address": _TEXT, "title": _TEXT, "lacks": _TEXT, **_texts_or_null("problem")}
                | _numbers("messages_per_s reports_per_s")
                | {"aircraft": _INTEGER, "bad": _INTEGER, "dropped": _INTEGER, **_numbers("silent_s")}
            ),
            "service": _object(
                _numbers("uptime_s tick_ms_p99")
                | _numbers_or_null("position_age_s")
                | _texts_or_null("recording_problem")
            ),
        }
    ),
)

TEXT = Topic(
    "/companion/text",
    "companion.Text",
    _object({"time_us": _INTEGER, "severity": _INTEGER, "text": _TEXT}),
)

TOPICS = (DECISION, STATE, TEXT)
