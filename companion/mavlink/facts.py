"""Facts: what messages said, in SI units and radians, with `None` for whatever the sender marked as invalid.

A fact names its sender (`sender`), because on one link several systems speak. Positions are geographic
here; the local frame comes later, in the engine. `climb` is positive up, `velocity_mps` is north-east-down.
"""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from companion.model import TrafficReport, Vec3

# The parameter with our own transponder's address, of either autopilot.
OWN_ICAO_PARAMETER = "ADSB_ICAO_ID"


class Sender(NamedTuple):
    """The MAVLink address a message came from."""

    system_id: int
    component_id: int


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT. `autopilot`, `vehicle_type` and `system_status` are the MAVLink enumerations."""

    sender: Sender
    vehicle_type: int
    autopilot: int
    armed: bool
    custom_mode: int
    system_status: int


@dataclass(frozen=True, slots=True)
class OwnPosition:
    """GLOBAL_POSITION_INT: where a system says that it is itself; ours and others' alike."""

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
    """VFR_HUD: speed through the air, and height above mean sea level, both `None` when not measured."""

    sender: Sender
    airspeed_mps: float | None
    altitude_m: float | None = None


@dataclass(frozen=True, slots=True)
class PressureAltitude:
    """SCALED_PRESSURE: height in the standard atmosphere, as transponders report it."""

    sender: Sender
    altitude_m: float


@dataclass(frozen=True, slots=True)
class GeoidSeparation:
    """GPS_RAW_INT: height above the ellipsoid less height above mean sea level, here."""

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
    """EXTENDED_SYS_STATE: `landed_state` is MAV_LANDED_STATE, `None` when undefined."""

    sender: Sender
    landed_state: int | None


@dataclass(frozen=True, slots=True)
class NavigationTarget:
    """POSITION_TARGET_GLOBAL_INT: where the autopilot is flying to."""

    sender: Sender
    lat_deg: float
    lon_deg: float
    altitude_m: float | None


@dataclass(frozen=True, slots=True)
class MissionProgress:
    """MISSION_CURRENT: the item that is being flown, and what tells one mission from another.

    `total` is `None` where the sender does not say, and so are the identities of mission and fence.
    """

    sender: Sender
    sequence: int
    total: int | None = None
    mission_id: int | None = None
    fence_id: int | None = None


class HeightAbove(Enum):
    """What the height of a mission item is measured from."""

    SEA = "sea"
    HOME = "home"
    TERRAIN = "terrain"


@dataclass(frozen=True, slots=True)
class MissionItem:
    """MISSION_ITEM_INT: one item of a mission or of a fence (`mission_type`: MAV_MISSION_TYPE).

    `params` are its first four, in the units of `command` (MAV_CMD). An item without a place has no latitude
    and longitude, one without a height in a known frame no `height_m`.
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
    """MISSION_COUNT: how many items a list has that is about to be transferred."""

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
class MissionTalk:
    """Any other message of the mission protocol: somebody transfers, or clears, a list."""

    sender: Sender
    target: Sender
    mission_type: int


@dataclass(frozen=True, slots=True)
class FenceStatus:
    """FENCE_STATUS: the autopilot keeps to a fence; `breached`: it is outside."""

    sender: Sender
    breached: bool


@dataclass(frozen=True, slots=True)
class HomePosition:
    """HOME_POSITION; the height is above mean sea level."""

    sender: Sender
    lat_deg: float
    lon_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class TerrainReport:
    """TERRAIN_REPORT of a place whose terrain is known.

    `terrain_altitude_m` is above mean sea level; `height_above_terrain_m` is that of the aircraft.
    """

    sender: Sender
    lat_deg: float
    lon_deg: float
    terrain_altitude_m: float
    height_above_terrain_m: float


@dataclass(frozen=True, slots=True)
class CommandResult:
    """COMMAND_ACK. `target` is whom it answers, `None` in MAVLink 1, which does not say."""

    sender: Sender
    command: int
    result: int
    target: Sender | None


@dataclass(frozen=True, slots=True)
class Parameter:
    """PARAM_VALUE, already turned into the number it stands for (also where PX4 packs integers bytewise)."""

    sender: Sender
    name: str
    value: float


@dataclass(frozen=True, slots=True)
class RcChannels:
    """RC_CHANNELS: positions of the pilot's sticks [us], `None` for a channel that is not there."""

    sender: Sender
    pulses_us: tuple[int | None, ...]


@dataclass(frozen=True, slots=True)
class AttitudeTarget:
    """ATTITUDE_TARGET: whether the attitude that the autopilot steers to is a number at all."""

    sender: Sender
    finite: bool


@dataclass(frozen=True, slots=True)
class SystemTime:
    """SYSTEM_TIME: the autopilot's idea of the time [s, Unix]; `None` before it has one."""

    sender: Sender
    unix_s: float | None


@dataclass(frozen=True, slots=True)
class AutopilotVersion:
    """AUTOPILOT_VERSION: the firmware's version as people write it, and the capability bits."""

    sender: Sender
    version: str
    major: int
    minor: int
    capabilities: int


@dataclass(frozen=True, slots=True)
class CommandRequest:
    """COMMAND_LONG or COMMAND_INT from somebody to `target` (component 0: all); `None` stands for NaN."""

    sender: Sender
    target: Sender
    command: int
    params: tuple[float | None, float | None, float | None, float | None]


@dataclass(frozen=True, slots=True)
class ParameterRequest:
    """PARAM_REQUEST_LIST (neither name nor index), or PARAM_REQUEST_READ by name or index."""

    sender: Sender
    target: Sender
    name: str | None
    index: int | None


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """PARAM_SET; `value` is `None` where it is no finite number: a wish too, and to be answered."""

    sender: Sender
    target: Sender
    name: str
    value: float | None


@dataclass(frozen=True, slots=True)
class OwnTransponder:
    """UAVIONIX_ADSB_OUT_CFG: the address our own transponder transmits."""

    sender: Sender
    icao: int


@dataclass(frozen=True, slots=True)
class Traffic:
    """ADSB_VEHICLE or UTM_GLOBAL_POSITION. `report.time_s` is the time of reception less the known age."""

    sender: Sender
    report: TrafficReport


Fact = (
    Heartbeat
    | OwnPosition
    | AirData
    | PressureAltitude
    | GeoidSeparation
    | Wind
    | LandedState
    | NavigationTarget
    | MissionProgress
    | MissionItem
    | MissionCount
    | MissionAck
    | MissionTalk
    | FenceStatus
    | HomePosition
    | TerrainReport
    | CommandResult
    | Parameter
    | RcChannels
    | AttitudeTarget
    | SystemTime
    | AutopilotVersion
    | CommandRequest
    | ParameterRequest
    | ParameterSet
    | OwnTransponder
    | Traffic
)
