"""The nouns that every room shares. SI units, radians, north-east-down; `None` means unknown."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Literal

from companion.geodesy import GeoPoint

Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
# The units of texts for the operator: metres and m/s, or feet and knots.
TextUnits = Literal["metric", "aviation"]


class Role(IntEnum):
    """What the operator lets us do. The numbers are those of the MAVLink parameter and command."""

    OFF = 0  # nothing is computed
    ADVISE = 1  # everything is computed, announced and recorded, nothing commanded
    FLY = 2


class Layer(StrEnum):
    """Which of the two layers decides (paper §2.3)."""

    CLEAR = "clear"
    OUTER = "outer"
    INNER = "inner"


class TrafficKind(StrEnum):
    """What a report is about, as far as avoidance cares."""

    AIRCRAFT = "aircraft"
    UAV = "uav"
    SURFACE_VEHICLE = "surface vehicle"
    OBSTACLE = "obstacle"


class AltitudeReference(StrEnum):
    """What a reported height is measured against."""

    BAROMETRIC = "barometric"  # 1013.25 hPa in the standard atmosphere, as transponders report it
    GEOMETRIC = "geometric"  # the ellipsoid of WGS 84, as satellites give it
    SEA_LEVEL = "sea level"  # mean sea level, as autopilots estimate it


class TrafficSource(StrEnum):
    """By what an aircraft makes itself known."""

    ADSB = "ADS-B"
    UTM = "UTM"
    SYSTEM = "MAVLink system"


def adsb_key(icao: int) -> str:
    """The key of an ICAO address."""
    return f"{icao:06X}"


def uas_key(uas_id: str) -> str:
    """The key of a UAS id in hexadecimal; the zero bytes that fill it up do not count."""
    return f"UTM-{bytes.fromhex(uas_id).rstrip(bytes(1)).hex().upper()}"


@dataclass(frozen=True, slots=True)
class TrafficReport:
    """One report of one other aircraft, valid at `time_s`; what the sender did not vouch for is `None`.

    `key` names the aircraft among all that are heard, of whatever source, and its track after it: the six
    digits of an ICAO address, or the source's own name with a prefix. The sigmas are standard deviations that
    the sender states. `airborne`: not known to stand on the ground.
    """

    source: TrafficSource
    key: str
    time_s: float
    lat_deg: float | None = None
    lon_deg: float | None = None
    altitude_m: float | None = None
    altitude_reference: AltitudeReference = AltitudeReference.GEOMETRIC
    course_rad: float | None = None
    ground_speed_mps: float | None = None
    climb_mps: float | None = None
    callsign: str | None = None
    squawk: int | None = None
    kind: TrafficKind = TrafficKind.AIRCRAFT
    simulated: bool = False
    icao: int | None = None
    airborne: bool = True
    position_sigma_m: float | None = None
    altitude_sigma_m: float | None = None


@dataclass(frozen=True, slots=True)
class Ownship:
    """Our aircraft: position and ground velocity in the shared local frame (north, east, down).

    `heading_rad` is where the nose points, clockwise from true north; `wind_mps` is the velocity of the
    air over the ground (north, east), `None` when nobody measured it.
    """

    time_s: float
    position_m: Vec3
    velocity_mps: Vec3
    airspeed_mps: float
    heading_rad: float
    wind_mps: Vec2 | None = None


@dataclass(frozen=True, slots=True)
class Track:
    """Another aircraft, as estimated at `time_s` in the shared local frame (north, east, down).

    `protected_horizontal_m` and `protected_vertical_m` are the volume to keep out of; `None` takes the
    well-clear volume of the avoidance parameters. `member`: it is one of our group, and tells. A `kind` of
    OBSTACLE stands on the ground: its position is its top, and nothing flies under it.
    `turn_radps`: how fast its course turns, positive to the right. `vertical_uncertainty_m`: by how much its
    height and ours may be wrong against each other, beyond what the avoidance's own margin covers (an unknown
    altimeter setting, different references).
    """

    track_id: str
    time_s: float
    position_m: Vec3
    velocity_mps: Vec3
    icao: int | None = None
    callsign: str | None = None
    kind: TrafficKind = TrafficKind.AIRCRAFT
    age_s: float = 0.0
    protected_horizontal_m: float | None = None
    protected_vertical_m: float | None = None
    member: "Member | None" = None
    vertical_uncertainty_m: float = 0.0
    turn_radps: float = 0.0


@dataclass(frozen=True, slots=True)
class Goal:
    """What the mission wants: a course and an altitude to hold, or a position to reach.

    `altitude_m` is height above the zero of the local frame (in flight: mean sea level). With `position_m`
    the course and altitude follow from it. `is_end`: the flight ends at the position, so that nothing beyond
    it matters.
    """

    course_rad: float | None = None
    airspeed_mps: float | None = None
    altitude_m: float | None = None
    position_m: Vec3 | None = None
    is_end: bool = False


@dataclass(frozen=True, slots=True)
class Member:
    """What a UAV of our group tells the others: where it goes, and what it can do."""

    goal: Goal
    min_airspeed_mps: float
    max_airspeed_mps: float
    max_turn_rate_radps: float


@dataclass(frozen=True, slots=True)
class Guidance:
    """What to fly, absolute: course over ground, airspeed, height above the zero of the local frame."""

    course_rad: float
    airspeed_mps: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class Threat:
    """A track that takes part in a conflict, measured at the moment of the decision.

    `time_to_closest_s` and the two miss distances are those of flying the mission on, unavoided.
    """

    track_id: str
    icao: int | None
    distance_m: float
    relative_altitude_m: float
    bearing_rad: float
    closing_mps: float
    time_to_closest_s: float
    miss_horizontal_m: float
    miss_vertical_m: float
    layer: Layer


@dataclass(frozen=True, slots=True)
class Decision:
    """The avoider's answer. `guidance` is `None` when the mission may be flown."""

    layer: Layer
    guidance: Guidance | None = None
    threats: Sequence[Threat] = ()
    because: str = ""


@dataclass(frozen=True, slots=True)
class PriorFlightState:
    """What the aircraft was doing when it was taken over, and goes back to.

    `target` is where it was flying to or circling; course and altitude are those it flew.
    """

    mode: int
    sequence: int | None = None
    target: GeoPoint | None = None
    course_rad: float = 0.0
    altitude_m: float = 0.0
    airspeed_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All that a display needs to know about one moment."""

    time_s: float
    state: str
    mode: str | None
    armed: bool
    ownship: Ownship | None
    tracks: Sequence[Track] = ()
    decision: Decision = field(default_factory=lambda: Decision(Layer.CLEAR))
    goal: Goal | None = None
    last_text: str = ""
