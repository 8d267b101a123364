"""The parameters of the avoidance. Those of its parts are defined beside their maths."""

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated

from annotated_types import Ge, Gt, Le

from companion.avoidance.cost_weights import CostWeights
from companion.avoidance.envelope import ALL_CONTROLS, Control, Envelope
from companion.avoidance.group.formation import FormationParams
from companion.avoidance.maneuvers import ManeuverParams
from companion.avoidance.potential import FieldParams


class Layers(StrEnum):
    """Which layers there are (paper §2.3); one alone is for comparisons."""

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
    """Volumes, layers and prices. Radii are measured from the protected volume's surface (paper §2.3)."""

    # Well clear for small UAS against crewed aircraft (ASTM F3442).
    well_clear_horizontal_m: Annotated[float, Gt(0), Le(20_000)] = 609.6
    well_clear_vertical_m: Annotated[float, Gt(0), Le(2_000)] = 76.2
    # Fixed obstacles need smaller volumes than aircraft.
    obstacle_horizontal_m: Annotated[float, Gt(0), Le(20_000)] = 150.0
    obstacle_vertical_m: Annotated[float, Gt(0), Le(2_000)] = 50.0
    # Margins, as shares of the required volume, against what is not predicted.
    horizontal_margin: Annotated[float, Ge(0), Le(5)] = 0.15
    vertical_margin: Annotated[float, Ge(0), Le(5)] = 0.25
    # The volume counts as lost this share of itself before its edge: no aircraft flies to the metre as
    # predicted, and of flights planned to graze a volume every other one enters it.
    lost_margin: Annotated[float, Ge(0), Le(1)] = 0.06
    # Each layer reaches as far as its radius, or its time at the closing speed, whichever is larger.
    outer_radius_m: Annotated[float, Gt(0)] = 1500.0
    outer_time_s: Annotated[float, Ge(0), Le(80)] = 60.0
    inner_radius_m: Annotated[float, Gt(0)] = 300.0
    inner_time_s: Annotated[float, Ge(0), Le(80)] = 20.0
    # Transition domain: once we are inside a collision cone, it is this much wider.
    delta_beta_rad: Annotated[float, Ge(0), Le(math.pi)] = math.radians(90.0)
    # An avoidance begins when the mission would come nearer than this share of the volume with its margin.
    # The first share applies when closest approach is within `inner_time_s`, or when the volume is entered
    # now; the second applies from `outer_time_s` on.
    begin_near: Annotated[float, Gt(0), Le(1)] = 0.87
    begin_far: Annotated[float, Gt(0), Le(1)] = 0.55
    # The mission is resumed when its flight has kept clear by this share more, for this long.
    release_margin: Annotated[float, Ge(0), Le(5)] = 0.2
    release_after_s: Annotated[float, Ge(0), Le(60)] = 3.0
    # An aircraft beside us, on our course and at our speed, could keep us off the mission for ever. After
    # this time the release margin is given up, the price `unresolved` grows, and passing it faster or slower
    # becomes possible.
    patience_s: Annotated[float, Gt(0), Le(600)] = 75.0
    # Where the fence is in the way of the mission, it is followed for at most this long.
    return_within_s: Annotated[float, Ge(0), Le(600)] = 90.0
    # An avoidance changes height by no more than this, from the present height or the mission's.
    largest_height_change_m: Annotated[float, Gt(0), Le(3_000)] = 300.0
    # No row may leave the fence within this many times the time to turn around. Once is enough to stay
    # inside: an aircraft that turns around never gets further ahead than one that flies on for the same time,
    # so that there is room to turn wherever flying on is allowed. The rest is for the time until the next
    # decision.
    fence_look_ahead_turns: Annotated[float, Ge(0.5), Le(4)] = 1.2
    # Rows are priced against this many tracks, the most urgent first. All tracks count for the layers.
    priced_tracks: Annotated[int, Gt(0), Le(200)] = 16
    # What the paper compares: layers, ways to steer in the outer one, controls (P9, P10) in the inner one.
    layers: Layers = Layers.BOTH
    outer_method: OuterMethod = OuterMethod.PRICED
    controls: frozenset[Control] = ALL_CONTROLS
    envelope: Envelope = field(default_factory=Envelope)
    formation: FormationParams = field(default_factory=FormationParams)
    field_gains: FieldParams = field(default_factory=FieldParams)
    weights: CostWeights = field(default_factory=CostWeights)
    surprises: ManeuverParams = field(default_factory=ManeuverParams)

    def __post_init__(self) -> None:
        if self.inner_radius_m > self.outer_radius_m or self.inner_time_s > self.outer_time_s:
            raise ValueError("the inner layer must not reach further than the outer layer")
