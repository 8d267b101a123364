"""What a fake vehicle shows of itself: its messages on the way out, and the truth for scoring."""

from dataclasses import dataclass
from typing import NamedTuple

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message
from companion.model import Vec3


class Outgoing(NamedTuple):
    """A message to send on a channel, from the vehicle's `system_id`, component 1."""

    channel: int
    message: Message


@dataclass(frozen=True, slots=True)
class Truth:
    """What really happens, for scoring. `position_m` is north-east-down from home, down 0 at sea level.

    `mode` is the name that ground stations show. `companion_flies`: it is the mode that takes a companion's
    commands (GUIDED, OFFBOARD); `on_mission`: it is the one that flies the mission (AUTO, MISSION).
    `uncontrolled`: the controller has gone wrong and flies nothing that is asked of it.
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
