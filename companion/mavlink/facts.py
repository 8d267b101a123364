"""Facts: what messages said, in SI units and radians, with `None` for whatever the sender marked as invalid.

A fact names its sender (`sender`), because on one link several systems speak. Positions are geographic
here; the local frame comes later, in the engine. `climb` is positive up, `velocity_mps` is north-east-down.
"""

from dataclasses import dataclass

from companion.model import TrafficReport, Vec3


@dataclass(frozen=True, slots=True)
class Sender:
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
    """VFR_HUD: speed through the air."""

    sender: Sender
    airspeed_mps: float | None


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
    """MISSION_CURRENT: the item that is being flown."""

    sender: Sender
    sequence: int


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
    | CommandResult
    | Parameter
    | OwnTransponder
    | Traffic
)
