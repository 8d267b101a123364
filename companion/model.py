"""The data types that all rooms share. SI units, radians, north-east-down; `None` means unknown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Literal

from companion.geodesy import GeoPoint

Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
LatLon = tuple[float, float]
"""Latitude and longitude [deg]."""
# Units in texts for the operator: metres and m/s, or feet and knots.
TextUnits = Literal["metric", "aviation"]

# Smaller changes from the present flight have no words: of course, height and airspeed.
STEADY_TURN_RAD, STEADY_CLIMB_M, STEADY_SPEED_MPS = math.radians(3.0), 5.0, 2.0
# Heights that differ by less than this are the same height, in words.
LEVEL_M = 10


class Role(IntEnum):
    """The operator's permission. The numbers are the values of the MAVLink parameter and command."""

    OFF = 0  # no decisions
    ADVISE = 1  # decisions are announced and recorded, but not commanded
    FLY = 2


class Layer(StrEnum):
    """The avoidance layer that decides (paper §2.3)."""

    CLEAR = "clear"
    OUTER = "outer"
    INNER = "inner"


class TrafficKind(StrEnum):
    """The kinds of objects that avoidance distinguishes."""

    AIRCRAFT = "aircraft"
    UAV = "uav"
    SURFACE_VEHICLE = "surface vehicle"
    OBSTACLE = "obstacle"


class AltitudeReference(StrEnum):
    """The reference that an altitude is measured from."""

    BAROMETRIC = "barometric"  # the 1013.25 hPa level of the standard atmosphere, used by transponders
    GEOMETRIC = "geometric"  # the WGS 84 ellipsoid, used by satellite receivers
    SEA_LEVEL = "sea level"  # mean sea level, as estimated by autopilots


class TrafficSource(StrEnum):
    """The surveillance that a traffic report came by."""

    ADSB = "ADS-B"
    ADSR = "ADS-R"  # ADS-B of another data link, repeated by a ground station
    TISB = "TIS-B"  # radar tracks, broadcast by a ground station
    MLAT = "MLAT"  # located by the times of arrival at several ground stations
    MODE_S = "Mode S"  # an altitude and an address, without a position
    FLARM = "FLARM"
    REMOTE_ID = "Remote ID"
    UTM = "UTM"
    SYSTEM = "MAVLink system"


class TrackState(StrEnum):
    """How well a track is known at present."""

    TENTATIVE = "tentative"  # reported once
    CONFIRMED = "confirmed"
    COASTED = "coasted"  # not reported for several of its usual intervals, and extrapolated
    LOST = "lost"  # silent for too long to be a track


def adsb_key(icao: int) -> str:
    """The key of an ICAO address: its six hexadecimal digits."""
    return f"{icao:06X}"


def system_key(system_id: int) -> str:
    """The key of another MAVLink system that reports its own position."""
    return f"SYS-{system_id}"


def uas_key(uas_id: str) -> str:
    """The key of a hexadecimal UAS id, without the trailing zero bytes that pad it."""
    return f"UTM-{bytes.fromhex(uas_id).rstrip(bytes(1)).hex().upper()}"


@dataclass(frozen=True, slots=True)
class TrafficReport:
    """A report of another aircraft, valid at `time_s`; values that the sender did not mark valid are `None`.

    `key` identifies the aircraft across all sources: the six digits of its ICAO address, or a prefix with the
    source's own identifier; "" for an aircraft without an identifier. `airborne` is False only when the
    sender says that the aircraft is on the ground.

    The sigmas are standard deviations as stated by the sender (horizontal ones for each axis).
    `containment_m` is the radius that the true position leaves with the probability that `sil` stands for
    (the surveillance integrity level of ADS-B: 1, 2, 3 for 1e-3, 1e-5, 1e-7 in an hour).
    `geometric_altitude_m` is above the ellipsoid, sent in addition to a barometric `altitude_m`.

    `relative_m` (north, east, up) is the position relative to our own, of receivers that send nothing else.
    `alarm` is the receiver's own collision alarm, 0 (none) to 3. `heard_by` names the receiver. The age from
    which `time_s` follows was cut off to whole steps of `age_step_s`.
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
    velocity_sigma_mps: float | None = None
    containment_m: float | None = None
    sil: int | None = None
    geometric_altitude_m: float | None = None
    relative_m: Vec3 | None = None
    alarm: int = 0
    heard_by: str = ""
    age_step_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Ownship:
    """Our aircraft: position and ground velocity in the shared local frame (north, east, down).

    `heading_rad` is the direction of the nose, clockwise from true north; `wind_mps` is the velocity of the
    air over the ground (north, east), `None` when it was not measured.
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

    `protected_horizontal_m` and `protected_vertical_m` define the volume to stay out of; `None` selects the
    well-clear volume of the avoidance parameters. `is_member` marks an aircraft of our formation, `member` is
    what it announces, if that is known. An OBSTACLE
    stands on the ground: its position is its top, and the space below it is blocked. `turn_radps` is its rate
    of turn, positive to the right. `vertical_uncertainty_m` is the possible error of its altitude relative to
    ours that the avoidance's own margin does not cover (unknown altimeter setting, different references).
    The two sigmas are standard deviations of each horizontal axis at `time_s`, `None` if unknown. `sources`
    names the receivers or kinds of surveillance that report it, `alarm` is the highest alarm of a receiver.
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
    state: TrackState = TrackState.CONFIRMED
    position_sigma_m: float | None = None
    velocity_sigma_mps: float | None = None
    sources: tuple[str, ...] = ()
    alarm: int = 0
    is_member: bool = False

    @property
    def name(self) -> str:
        """The name that people read: callsign, ICAO address, or the track id."""
        return self.callsign or (self.track_id if self.icao is None else adsb_key(self.icao))


@dataclass(frozen=True, slots=True)
class Goal:
    """The mission's present aim: a course and an altitude to hold, or a position to reach.

    `altitude_m` is the height above the zero of the local frame (in flight: mean sea level). `position_m`
    determines course and altitude. With `is_end` the flight ends at the position, and conflicts beyond it do
    not count.

    With `leg_from_m` the position is reached along the straight leg from there, sloped like it: from beside
    the leg the aircraft first flies back to it. With `loiter_radius_m` it circles the position afterwards,
    to the left if negative, with a usual radius if 0. From the position the flight continues to `then_m`.
    `height_is_known` is false where the mission's height is unknown, and the altitude that of the aircraft.
    """

    course_rad: float | None = None
    airspeed_mps: float | None = None
    altitude_m: float | None = None
    position_m: Vec3 | None = None
    is_end: bool = False
    leg_from_m: Vec3 | None = None
    loiter_radius_m: float | None = None
    then_m: Vec3 | None = None
    height_is_known: bool = True


@dataclass(frozen=True, slots=True)
class Guidance:
    """Absolute targets: course over ground, airspeed, height above the zero of the local frame."""

    course_rad: float
    airspeed_mps: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class Proposal:
    """An answer that a member would fly once the others agree; `guidance` is `None` for its mission."""

    number: int
    guidance: Guidance | None


@dataclass(frozen=True, slots=True)
class Intent:
    """What a member of a group flies, and what it proposes to fly instead.

    `flown` is the answer that was checked and is flown, `None` for the mission. `heard` has the number of the
    newest proposal that it has heard of each other member, by id. A member that does not `answer` flies its
    mission whatever happens, as a pilot or its autopilot has it.
    """

    flown: Guidance | None = None
    proposal: Proposal | None = None
    heard: Mapping[str, int] = field(default_factory=dict)
    answers: bool = True


@dataclass(frozen=True, slots=True)
class Member:
    """The goal and performance that a UAV of our group announces to the others.

    `member_id` is the same for all members; by default the id of the track. Without an `intent`, members know
    each other's states exactly and at once, as in one process, and each flies its part of the joint response
    without agreeing on it.
    """

    goal: Goal
    min_airspeed_mps: float
    max_airspeed_mps: float
    max_turn_rate_radps: float
    intent: Intent | None = None
    member_id: str = ""


@dataclass(frozen=True, slots=True)
class Threat:
    """A track in conflict with us, as it is at the time of the decision.

    `time_to_closest_s` and the two miss distances are predicted for the mission without avoidance.
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
    name: str = ""  # as `Track.name`


@dataclass(frozen=True, slots=True)
class Decision:
    """The avoider's decision. `guidance` is `None` when the mission may be flown.

    `awaited` are conflicts that need no answer yet: an avoidance that begins later still keeps clear of them.
    """

    layer: Layer
    guidance: Guidance | None = None
    threats: Sequence[Threat] = ()
    because: str = ""
    awaited: Sequence[Threat] = ()


@dataclass(frozen=True, slots=True)
class PriorFlightState:
    """The flight before the take-over, which the aircraft resumes afterwards.

    `target` is the place that it was flying to or circling; course and altitude are those it flew.
    """

    mode: int
    sequence: int | None = None
    target: GeoPoint | None = None
    course_rad: float = 0.0
    altitude_m: float = 0.0
    airspeed_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state at one moment, for a display."""

    time_s: float
    state: str
    mode: str | None
    armed: bool
    ownship: Ownship | None
    tracks: Sequence[Track] = ()
    decision: Decision = field(default_factory=lambda: Decision(Layer.CLEAR))
    goal: Goal | None = None
    last_text: str = ""
    maneuver: str = ""  # as announced last, while it lasts: "CLIMB to 397 m, RIGHT 045"
    maneuver_text: str = ""  # the same with the traffic
