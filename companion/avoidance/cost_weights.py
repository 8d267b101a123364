"""The prices of rows: what each of their properties costs."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge


@dataclass(frozen=True)
class CostWeights:
    """Prices. Losing the protected volume outweighs everything else together."""

    margin: Annotated[float, Ge(0)] = 30.0  # times the penetration of the margin, 0 at its edge
    loss: Annotated[float, Ge(0)] = 40.0  # flat, for entering the protected volume itself
    depth: Annotated[float, Ge(0)] = 300.0  # times the deepest penetration, 0 at the edge, 1 at contact
    exposure: Annotated[float, Ge(0)] = 100.0  # times the mean penetration, so that leaving soon is better
    # Times the mean depth in the worst inner layer, 0 at its edge and 1 at the volume. The paper clears the
    # whole sphere of the inner layer. For traffic that would be miles, and missing the volume by its margin
    # is enough.
    nearness: Annotated[float, Ge(0)] = 0.0
    turn: Annotated[float, Ge(0)] = 0.6  # times the turn from the present course, per half circle
    deviation: Annotated[float, Ge(0)] = 6.0  # times the angle off the mission's course, per half circle
    # Times the distance from where the mission would be when all threats are passed, per 100 m.
    aside: Annotated[float, Ge(0)] = 0.6
    # Times how deep the mission would lead into a volume from there, 0 at its edge, 1 through its middle.
    unresolved: Annotated[float, Ge(0)] = 8.0
    height: Annotated[float, Ge(0)] = 0.8  # times the difference from the mission's height, per 100 m
    descent: Annotated[float, Ge(0)] = 0.2  # flat, for going below the mission, towards the ground
    # Flat, for leaving the mission's height where that is a risk in itself (`Avoider.prefers_turns`): more
    # than any turn costs, less than the loss of the protected volume.
    spared_height: Annotated[float, Ge(0)] = 12.0
    speed: Annotated[float, Ge(0)] = 0.5  # times the difference from the mission's speed, per 10 m/s
    # Flat, for anything but the present guidance. Twice that while the closest approach is far off: there is
    # time, and what looks cheaper now may not be a moment later.
    switch: Annotated[float, Ge(0)] = 2.0
    ease: Annotated[float, Ge(0)] = 0.6  # instead of `switch`, for less of the present guidance
    wrong_side: Annotated[float, Ge(0)] = 0.3  # flat, for turning left where the rules of the air say right
    # Times the use of the fence's margin, 1 at the fence itself and beyond. Leaving the fence outweighs the
    # loss of many volumes: the autopilot then takes over or ends the flight, and people beyond the fence have
    # not agreed to the risk. Only a near mid-air collision outweighs the fence.
    fence: Annotated[float, Ge(0)] = 10_000.0
    near_miss: Annotated[float, Ge(0)] = 30_000.0  # flat, and again times the depth, 1 at contact
    outside: Annotated[float, Ge(0)] = 100.0  # times the mean depth outside, per 100 m: back soon is better
    # For a row that would leave the fence later, before the threat is passed: the whole price if at once.
    not_to_the_end: Annotated[float, Ge(0)] = 3.0
