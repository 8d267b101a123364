"""Fake autopilots: MAVLink messages in, MAVLink messages out; no sockets, no clock."""

from sim.vehicle.ardupilot import FakeArduPlane, Outgoing, Truth
from sim.vehicle.mission import MissionItem, takeoff_item, waypoint_item
from sim.vehicle.modes import Mode

__all__ = [
    "FakeArduPlane",
    "MissionItem",
    "Mode",
    "Outgoing",
    "Truth",
    "takeoff_item",
    "waypoint_item",
]
