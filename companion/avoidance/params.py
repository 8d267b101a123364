"""Parameters of the avoidance, and the weights of its costs."""

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated

from annotated_types import Ge, Gt, Le

from companion.avoidance.group.formation import FormationParams
from companion.avoidance.intruders import ManeuverParams
from companion.avoidance.trajectory import ALL_CONTROLS, Control, Envelope


@dataclass(frozen=True)
class FieldParams:
    """Gains of the potential field (paper, eq. 5-8); the unit of length is the reach rho_o."""

    attraction_gain: Annotated[float, Gt(0)] = 1.0
    repulsion_gain: Annotated[float, Gt(0)] = 1.0
    # Larger turns are left to the inner layer.
    largest_deflection_rad: Annotated[float, Gt(0), Le(math.pi)] = math.radians(100.0)


@dataclass(frozen=True)
class CostWeights:
    """Prices. Losing the protected volume outweighs everything else together."""

    margin: Annotated[float, Ge(0)] = 30.0  # times the penetration of the margin, 0 at its edge
    loss: Annotated[float, Ge(0)] = 40.0  # flat, for entering the protected volume itself
    depth: Annotated[float, Ge(0)] = 300.0  # times the deepest penetration, 0 at the edge, 1 at contact
    exposure: Annotated[float, Ge(0)] = 100.0  # times the mean penetration, so that leaving soon is better
    # Times the mean depth in the worst inner layer, 0 at its edge and 1 at the volume. The paper clears the
    # whole sphere of the inner layer. Among real traffic that sphere would be miles wide, and missing the
    # volume by its margin is enough.
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
    spared_height: Annotated[float, Ge(0), Le(100)] = 12.0
    speed: Annotated[float, Ge(0)] = 0.5  # times the difference from the mission's speed, per 10 m/s
    # Flat, for anything but the present guidance. Twice that while the closest approach is far off: there is
    # time, and what looks cheaper now may not be a moment later.
    switch: Annotated[float, Ge(0)] = 2.0
    ease: Annotated[float, Ge(0)] = 0.6  # instead of `switch`, for less of the present guidance
    later: Annotated[float, Ge(0)] = 0.5  # an avoidance waits while that costs no more than this
    wrong_side: Annotated[float, Ge(0)] = 1.0  # flat, for turning to the side against the rules of the air
    # Flat, for leaving the mission's height towards a stranger's: it may avoid too, to the other side.
    wrong_sense: Annotated[float, Ge(0)] = 3.0
    # Times the use of the fence's margin, 1 at the fence itself and beyond. Leaving the fence outweighs the
    # loss of many volumes: the autopilot then takes over or ends the flight, and people beyond the fence have
    # not agreed to the risk. Only a near mid-air collision outweighs the fence.
    fence: Annotated[float, Ge(0)] = 10_000.0
    near_miss: Annotated[float, Ge(0)] = 30_000.0  # flat, and again times the depth, 1 at contact
    outside: Annotated[float, Ge(0)] = 100.0  # times the mean depth outside, per 100 m: back soon is better
    # For a row that would leave the fence later, before the threat is passed: the whole price if at once.
    not_to_the_end: Annotated[float, Ge(0)] = 3.0


class Layers(StrEnum):
    """The layers in use (paper §2.3); one alone is for comparisons."""

    BOTH = "both"
    OUTER = "outer"
    INNER = "inner"


class OuterMethod(StrEnum):
    """How the outer layer steers; all but the last follow the direction of the summed force (eq. 9)."""

    FIELD = "field"  # every obstacle within reach repels
    CONE = "cone"  # only those whose collision cone our relative velocity points into
    TRANSITION = "transition"  # the same, with the memory of the transition domain
    PRICED = "priced"  # the same, strengthened to both sides, flown ahead and priced: what flies by default


@dataclass(frozen=True)
class AvoidanceParams:
    """Volumes, layers and prices. Radii are measured from the protected volume's surface (paper §2.3).

    The ranges hold for configuration files and for settings in flight; studies may go beyond them.
    """

    # Well clear for small UAS against crewed aircraft (ASTM F3442).
    well_clear_horizontal_m: Annotated[float, Ge(50), Le(5000)] = 609.6
    well_clear_vertical_m: Annotated[float, Ge(15), Le(1000)] = 76.2
    # Fixed obstacles need smaller volumes than aircraft.
    obstacle_horizontal_m: Annotated[float, Ge(20), Le(2000)] = 150.0
    obstacle_vertical_m: Annotated[float, Ge(10), Le(500)] = 50.0
    # Margins, as shares of the required volume, against what is not predicted.
    horizontal_margin: Annotated[float, Ge(0), Le(2)] = 0.15
    vertical_margin: Annotated[float, Ge(0), Le(2)] = 0.25
    # The volume counts as lost within this share of it outside its edge: no aircraft flies exactly as
    # predicted, and half of the flights that are planned to graze a volume enter it.
    lost_margin: Annotated[float, Ge(0), Le(1)] = 0.06
    # Each layer reaches as far as its radius, or its time at the closing speed, whichever is larger.
    outer_radius_m: Annotated[float, Ge(300), Le(20_000)] = 1500.0
    outer_time_s: Annotated[float, Ge(10), Le(80)] = 60.0
    inner_radius_m: Annotated[float, Ge(50), Le(5000)] = 300.0
    inner_time_s: Annotated[float, Ge(5), Le(60)] = 20.0
    # Transition domain: once we are inside a collision cone, it is this much wider.
    delta_beta_rad: Annotated[float, Ge(0), Le(math.pi)] = math.radians(90.0)
    # An avoidance begins when the mission would come nearer than this share of the volume with its margin.
    # The first share applies when closest approach is within `inner_time_s`, or when the volume is entered
    # now; the second applies from `outer_time_s` on.
    begin_near: Annotated[float, Ge(0.3), Le(1)] = 0.87
    begin_far: Annotated[float, Ge(0.2), Le(1)] = 0.87
    # It begins when beginning this much later would no longer keep the volume with its margin, or would cost
    # more. A longer reserve begins earlier: fewer losses to intruders that turn late, more needless
    # avoidances.
    reserve_s: Annotated[float, Ge(0), Le(60)] = 6.0
    # The mission is resumed when flying it on has been clear, by this share in addition, for this long.
    release_margin: Annotated[float, Ge(0), Le(2)] = 0.2
    release_after_s: Annotated[float, Ge(0), Le(60)] = 3.0
    # An aircraft beside us, on our course and at our speed, could keep us off the mission for ever. After
    # this time the release margin is given up, the price `unresolved` grows, and passing it faster or slower
    # becomes possible.
    patience_s: Annotated[float, Gt(0), Le(600)] = 75.0
    # If the fence blocks the way back to the mission, the aircraft flies along it for at most this long.
    return_within_s: Annotated[float, Ge(0), Le(600)] = 90.0
    # Avoidances, also several in a row, leave the mission's height by no more than this.
    largest_height_change_m: Annotated[float, Ge(30), Le(1000)] = 300.0
    # No row may leave the fence within this many times the time to turn around. Once is enough to stay
    # inside: an aircraft that turns around never gets further ahead than one that flies on for the same time,
    # so that there is room to turn wherever flying on is allowed. The rest is for the time until the next
    # decision.
    fence_look_ahead_turns: Annotated[float, Ge(0.5), Le(4)] = 1.2
    # Rows are priced against at most this many tracks, the most urgent first. All tracks count for layers.
    priced_tracks: Annotated[int, Gt(0), Le(200)] = 16
    # The paper compares layers, ways to steer in the outer one, and controls (P9, P10) in the inner one.
    layers: Layers = Layers.BOTH
    outer_method: OuterMethod = OuterMethod.PRICED
    controls: frozenset[Control] = ALL_CONTROLS
    envelope: Envelope = field(default_factory=Envelope)
    formation: FormationParams = field(default_factory=FormationParams)
    field_gains: FieldParams = field(default_factory=FieldParams)
    weights: CostWeights = field(default_factory=CostWeights)
    surprises: ManeuverParams = field(default_factory=ManeuverParams)

    def __post_init__(self) -> None:
        if self.inner_radius_m > self.outer_radius_m:
            raise ValueError("inner_radius_m must not exceed outer_radius_m")
        if self.inner_time_s > self.outer_time_s:
            raise ValueError("inner_time_s must not exceed outer_time_s")
