"""The maths of collision avoidance. Pure: no socket, no clock, no file."""

from companion.avoidance.avoider import Avoider
from companion.avoidance.envelope import Control, Envelope
from companion.avoidance.fence import Fence, Zone
from companion.avoidance.params import AvoidanceParams

__all__ = ["AvoidanceParams", "Avoider", "Control", "Envelope", "Fence", "Zone"]
