"""Outputs of a fake vehicle: events of the flight, messages to send, the truth for scoring."""

from dataclasses import dataclass
from typing import NamedTuple

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message
from companion.model import Vec3

INFO, WARNING, CRITICAL = 6, 4, 2  # MAV_SEVERITY


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text for the operator (STATUSTEXT)."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class ItemReached:
    """A mission item is done (MISSION_ITEM_REACHED)."""

    sequence: int


@dataclass(frozen=True, slots=True)
class FenceChanged:
    """A fence breach began or ended (FENCE_STATUS)."""


@dataclass(frozen=True, slots=True)
class ModeChanged:
    """The flight mode changed (an early HEARTBEAT, if the autopilot sends one)."""


Event = Text | ItemReached | FenceChanged | ModeChanged


class Outgoing(NamedTuple):
    """A message to send on a channel, from the vehicle's `system_id`, component 1."""

    channel: int
    message: Message


@dataclass(frozen=True, slots=True)
class Truth:
    """The true state of the vehicle, for scoring.

    `position_m` is north-east-down from home, with down 0 at sea level. `mode` is the name that ground
    stations show. `companion_flies`: the mode accepts a companion's commands (GUIDED, OFFBOARD);
    `on_mission`: the mode flies the mission (AUTO, MISSION). `uncontrolled`: the controller's setpoint is
    invalid, and commands have no effect.
    """

    time_s: float
    place: GeoPoint
    position_m: Vec3
    velocity_mps: Vec3
    airspeed_mps: float
    heading_rad: float
    bank_rad: float
    mode: str
    companion_flies: bool
    on_mission: bool
    uncontrolled: bool
    armed: bool
    on_ground: bool
    mission_sequence: int
    mission_completed: bool
