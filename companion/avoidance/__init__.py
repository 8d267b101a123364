"""The maths of collision avoidance. Pure: no socket, no clock, no file."""

from companion.avoidance.avoider import AvoidanceParams, Avoider
from companion.avoidance.envelope import Envelope

__all__ = ["AvoidanceParams", "Avoider", "Envelope"]
