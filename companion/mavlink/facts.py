"""Facts: the content of messages in SI units and radians; a field marked as invalid by its sender is `None`.

Every fact has its `sender`, because several systems may share a link. Positions are geographic; the local
frame is the engine's. `climb` is positive up, `velocity_mps` is north-east-down.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from companion.model import Guidance, LatLon, Proposal, TrafficReport, Vec3

# The parameter with the address of our own transponder, in both autopilots.
OWN_ICAO_PARAMETER = "ADSB_ICAO_ID"


class Sender(NamedTuple):
    """The MAVLink address of the sender of a message."""

    system_id: int
    component_id: int


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT. `autopilot`, `vehicle_type` and `system_status` are the MAVLink enumerations.

    `is_companion`: it looks like ours, an onboard controller whose custom mode is its role.
    """

    sender: Sender
    vehicle_type: int
    autopilot: int
    armed: bool
    custom_mode: int
    system_status: int
    is_companion: bool = False


@dataclass(frozen=True, slots=True)
class OwnPosition:
    """GLOBAL_POSITION_INT: the position of the sender, our own system or another."""

    sender: Sender
    boot_time_s: float
    lat_deg: float
    lon_deg: float
    altitude_m: float
    height_above_home_m: float
    velocity_mps: Vec3
    heading_rad: float | None


@dataclass(frozen=True, slots=True)
class AirData:
    """VFR_HUD: airspeed, and altitude above mean sea level; `None` when not measured."""

    sender: Sender
    airspeed_mps: float | None
    altitude_m: float | None = None


@dataclass(frozen=True, slots=True)
class AirspeedSensor:
    """SYS_STATUS: whether an airspeed sensor is fitted, in use and healthy."""

    sender: Sender
    usable: bool


@dataclass(frozen=True, slots=True)
class PressureAltitude:
    """SCALED_PRESSURE: altitude in the standard atmosphere, as transponders report it."""

    sender: Sender
    altitude_m: float


@dataclass(frozen=True, slots=True)
class GeoidSeparation:
    """GPS_RAW_INT: altitude above the ellipsoid minus altitude above mean sea level, at this position."""

    sender: Sender
    separation_m: float


@dataclass(frozen=True, slots=True)
class Wind:
    """WIND or WIND_COV: velocity of the air over the ground, north and east."""

    sender: Sender
    north_mps: float
    east_mps: float


@dataclass(frozen=True, slots=True)
class LandedState:
    """EXTENDED_SYS_STATE: MAV_LANDED_STATE and MAV_VTOL_STATE, `None` when undefined.

    `vtol_state`: 1 in transition to wing flight, 2 to rotors, 3 on rotors, 4 on the wing; `None` for an
    aircraft that is no VTOL.
    """

    sender: Sender
    landed_state: int | None
    vtol_state: int | None = None


@dataclass(frozen=True, slots=True)
class NavigationTarget:
    """POSITION_TARGET_GLOBAL_INT: the position that the autopilot flies to."""

    sender: Sender
    lat_deg: float
    lon_deg: float
    altitude_m: float | None


@dataclass(frozen=True, slots=True)
class MissionProgress:
    """MISSION_CURRENT: the current item; `total` and the ids of mission and fence are `None` if not sent."""

    sender: Sender
    sequence: int
    total: int | None = None
    mission_id: int | None = None
    fence_id: int | None = None


class HeightAbove(Enum):
    """The reference of the height of a mission item."""

    SEA = "sea"
    HOME = "home"
    TERRAIN = "terrain"


@dataclass(frozen=True, slots=True)
class MissionItem:
    """MISSION_ITEM_INT: one item of a mission or of a fence (`mission_type`: MAV_MISSION_TYPE).

    `params` are the first four, in the units of `command` (MAV_CMD). Latitude, longitude and `height_m` are
    `None` if the item has none, or an unknown frame.
    """

    sender: Sender
    target: Sender
    mission_type: int
    sequence: int
    command: int
    params: tuple[float | None, float | None, float | None, float | None]
    lat_deg: float | None
    lon_deg: float | None
    height_m: float | None
    height_above: HeightAbove


@dataclass(frozen=True, slots=True)
class MissionCount:
    """MISSION_COUNT: the number of items in a list that is about to be transferred."""

    sender: Sender
    target: Sender
    mission_type: int
    count: int


@dataclass(frozen=True, slots=True)
class MissionAck:
    """MISSION_ACK: the end of a transfer; `result` is MAV_MISSION_RESULT."""

    sender: Sender
    target: Sender
    mission_type: int
    result: int


@dataclass(frozen=True, slots=True)
class OtherMissionMessage:
    """Any other message of the mission protocol: a list is being transferred or cleared."""

    sender: Sender
    target: Sender
    mission_type: int


@dataclass(frozen=True, slots=True)
class FenceStatus:
    """FENCE_STATUS: the autopilot has a fence; `breached`: the aircraft is outside of it."""

    sender: Sender
    breached: bool


@dataclass(frozen=True, slots=True)
class HomePosition:
    """HOME_POSITION; the altitude is above mean sea level."""

    sender: Sender
    lat_deg: float
    lon_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class TerrainReport:
    """TERRAIN_REPORT for a position with terrain data.

    `terrain_altitude_m` is above mean sea level; `height_above_terrain_m` is that of the aircraft.
    """

    sender: Sender
    lat_deg: float
    lon_deg: float
    terrain_altitude_m: float
    height_above_terrain_m: float


@dataclass(frozen=True, slots=True)
class CommandResult:
    """COMMAND_ACK. `target` is the address that it answers; `None` in MAVLink 1, which has no such field."""

    sender: Sender
    command: int
    result: int
    target: Sender | None


@dataclass(frozen=True, slots=True)
class Parameter:
    """PARAM_VALUE, converted to the number that it represents (PX4 sends the bits of integers)."""

    sender: Sender
    name: str
    value: float


@dataclass(frozen=True, slots=True)
class RcChannels:
    """RC_CHANNELS: positions of the pilot's sticks [us]; `None` for a missing channel."""

    sender: Sender
    pulses_us: tuple[int | None, ...]


@dataclass(frozen=True, slots=True)
class AttitudeTarget:
    """ATTITUDE_TARGET: whether the attitude setpoint of the autopilot is finite."""

    sender: Sender
    finite: bool


@dataclass(frozen=True, slots=True)
class SystemTime:
    """SYSTEM_TIME: the Unix time of the autopilot's clock [s]; `None` if it is not set yet."""

    sender: Sender
    unix_s: float | None


@dataclass(frozen=True, slots=True)
class TimeSync:
    """TIMESYNC: an answer to the request with this stamp [ns]; `answer_ns` is the time of the sender."""

    sender: Sender
    answer_ns: int
    stamp_ns: int


@dataclass(frozen=True, slots=True)
class LinkAnswer:
    """The sender answered what we sent at `asked_s` on our clock: messages arrive in both directions."""

    sender: Sender
    asked_s: float


@dataclass(frozen=True, slots=True)
class OtherVehicle:
    """Another vehicle has the address of the sender: its clock or its position is not that of ours."""

    sender: Sender


@dataclass(frozen=True, slots=True)
class OtherCompanion:
    """Another companion has our address: a message came from it that we did not send."""

    sender: Sender


@dataclass(frozen=True, slots=True)
class AutopilotVersion:
    """AUTOPILOT_VERSION: the firmware version (as text and numbers), and the capability bits."""

    sender: Sender
    version: str
    major: int
    minor: int
    capabilities: int


@dataclass(frozen=True, slots=True)
class AvailableMode:
    """AVAILABLE_MODES: one of the `total` modes of the autopilot; `index` counts from 1."""

    sender: Sender
    custom_mode: int
    index: int
    total: int
    selectable: bool


@dataclass(frozen=True, slots=True)
class CommandRequest:
    """COMMAND_LONG or COMMAND_INT to `target` (component 0: all); `None` replaces NaN and infinities.

    `is_copy`: it was received before, byte for byte.
    """

    sender: Sender
    target: Sender
    command: int
    params: tuple[float | None, float | None, float | None, float | None]
    is_copy: bool = False


@dataclass(frozen=True, slots=True)
class ParameterRequest:
    """PARAM_REQUEST_LIST (neither name nor index), or PARAM_REQUEST_READ by name or index."""

    sender: Sender
    target: Sender
    name: str | None
    index: int | None


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """PARAM_SET; `value` is `None` if it is not finite, and the request still needs an answer."""

    sender: Sender
    target: Sender
    name: str
    value: float | None


@dataclass(frozen=True, slots=True)
class OwnTransponder:
    """UAVIONIX_ADSB_OUT_CFG: the ICAO address of our own transponder."""

    sender: Sender
    icao: int


RECEIVER = Sender(0, 0)
"""The sender of facts from receivers that do not speak MAVLink: the address that no MAVLink system has."""


@dataclass(frozen=True, slots=True)
class Traffic:
    """A report of another aircraft. `report.time_s` is the time of reception minus the known age."""

    sender: Sender
    report: TrafficReport


@dataclass(frozen=True, slots=True)
class MemberIntent:
    """What another companion of our formation announces: goal, limits, what it flies and what it proposes.

    `then_deg` is the place after the goal. `counter` orders the messages of one sender. Altitudes, also those
    of the two guidances, are above mean sea level. `heard` has the newest proposal heard of each other
    system, by system id.
    """

    sender: Sender
    counter: int
    goal_deg: LatLon | None
    then_deg: LatLon | None
    goal_course_rad: float | None
    goal_altitude_m: float
    goal_airspeed_mps: float
    goal_is_end: bool
    min_airspeed_mps: float
    max_airspeed_mps: float
    max_turn_rate_radps: float
    flown: Guidance | None
    proposal: Proposal | None
    heard: Mapping[int, int]
    answers: bool


@dataclass(frozen=True, slots=True)
class ReceiverOwnship:
    """A receiver's report of the aircraft that carries it; ours only if it is where we are.

    Its barometric altitude is in the standard atmosphere, its geometric one above the ellipsoid.
    """

    sender: Sender
    report: TrafficReport


Fact = (
    Heartbeat
    | OwnPosition
    | AirData
    | AirspeedSensor
    | PressureAltitude
    | GeoidSeparation
    | Wind
    | LandedState
    | NavigationTarget
    | MissionProgress
    | MissionItem
    | MissionCount
    | MissionAck
    | OtherMissionMessage
    | FenceStatus
    | HomePosition
    | TerrainReport
    | CommandResult
    | Parameter
    | RcChannels
    | AttitudeTarget
    | SystemTime
    | TimeSync
    | LinkAnswer
    | OtherVehicle
    | OtherCompanion
    | AutopilotVersion
    | AvailableMode
    | CommandRequest
    | ParameterRequest
    | ParameterSet
    | OwnTransponder
    | Traffic
    | MemberIntent
    | ReceiverOwnship
)
