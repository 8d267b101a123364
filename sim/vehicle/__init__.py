"""Fake autopilots: MAVLink messages in, MAVLink messages out; no sockets, no clock."""

from sim.vehicle.ardupilot import FakeArduPlane
from sim.vehicle.ardupilot_modes import Mode
from sim.vehicle.mission import MissionItem, takeoff_item, waypoint_item
from sim.vehicle.px4 import FakePx4
from sim.vehicle.px4_modes import Px4Mode
from sim.vehicle.truth import Outgoing, Truth
from sim.vehicle.vehicle import FakeVehicle

__all__ = [
    "FakeArduPlane",
    "FakePx4",
    "FakeVehicle",
    "MissionItem",
    "Mode",
    "Outgoing",
    "Px4Mode",
    "Truth",
    "takeoff_item",
    "waypoint_item",
]
