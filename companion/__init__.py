"""Collision-avoidance companion for fixed-wing MAVLink autopilots."""

__version__ = "0.2.0"
