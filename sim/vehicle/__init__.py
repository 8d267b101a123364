"""Fake autopilots: MAVLink messages in, MAVLink messages out; no sockets, no clock."""

from sim.vehicle.ardupilot.modes import Mode
from sim.vehicle.ardupilot.vehicle import FakeArduPlane
from sim.vehicle.mission import MissionItem, takeoff_item, waypoint_item
from sim.vehicle.outputs import Outgoing, Truth
from sim.vehicle.px4.modes import Px4Mode
from sim.vehicle.px4.vehicle import FakePx4
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
