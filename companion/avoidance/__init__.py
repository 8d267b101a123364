"""The maths of collision avoidance. Pure: no socket, no clock, no file."""

from companion.avoidance.avoider import Avoider
from companion.avoidance.fence import Fence, Zone
from companion.avoidance.params import AvoidanceParams
from companion.avoidance.trajectory import ALL_CONTROLS, Control, Envelope

__all__ = ["ALL_CONTROLS", "AvoidanceParams", "Avoider", "Control", "Envelope", "Fence", "Zone"]
