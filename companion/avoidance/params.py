"""The parameters of the avoidance; those of its parts stand with their maths."""

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated

from annotated_types import Ge, Gt, Le

from companion.avoidance.control import ALL_CONTROLS, Control
from companion.avoidance.cost import CostWeights
from companion.avoidance.envelope import Envelope
from companion.avoidance.group.formation import FormationParams
from companion.avoidance.maneuvers import SurpriseParams
from companion.avoidance.outer import FieldParams, OuterMethod


class Layers(StrEnum):
    """Which layers there are (paper §2.3); one alone is for comparisons."""

    BOTH = "both"
    OUTER = "outer"
    INNER = "inner"


@dataclass(frozen=True)
class AvoidanceParams:
    """Volumes, layers and prices. Radii are measured from the protected volume's surface (paper §2.3)."""

    # Well clear for small UAS against crewed aircraft (ASTM F3442).
    well_clear_horizontal_m: Annotated[float, Gt(0), Le(20_000)] = 609.6
    well_clear_vertical_m: Annotated[float, Gt(0), Le(2_000)] = 76.2
    # Masts and other things that stand on the ground need less room: there is nobody to be startled.
    obstacle_horizontal_m: Annotated[float, Gt(0), Le(20_000)] = 150.0
    obstacle_vertical_m: Annotated[float, Gt(0), Le(2_000)] = 50.0
    # The volume is kept larger than required by these shares, against what is not predicted.
    horizontal_margin: Annotated[float, Ge(0), Le(5)] = 0.15
    vertical_margin: Annotated[float, Ge(0), Le(5)] = 0.25
    # Of that margin, by this share of the volume it counts as lost already: neither we nor others fly to the
    # metre what is predicted, and who plans to graze a volume enters it every other time.
    lost_margin: Annotated[float, Ge(0), Le(1)] = 0.06
    # Each layer reaches as far as its length or its time at the closing speed, whichever is larger.
    outer_radius_m: Annotated[float, Gt(0)] = 1500.0
    outer_time_s: Annotated[float, Ge(0), Le(80)] = 60.0
    inner_radius_m: Annotated[float, Gt(0)] = 300.0
    inner_time_s: Annotated[float, Ge(0), Le(80)] = 20.0
    # Transition domain: the cone is this much wider for whoever is in it.
    delta_beta_rad: Annotated[float, Ge(0), Le(math.pi)] = math.radians(90.0)
    # An avoidance begins when the mission would come nearer than this share of the volume with its margin:
    # the first when closest approach is within `inner_time_s`, or the volume is entered now; the second from
    # `outer_time_s` on.
    begin_near: Annotated[float, Gt(0), Le(1)] = 0.87
    begin_far: Annotated[float, Gt(0), Le(1)] = 0.55
    # Back to the mission only when its flight keeps clear by this share more, for this long.
    release_margin: Annotated[float, Ge(0), Le(5)] = 0.2
    release_after_s: Annotated[float, Ge(0), Le(60)] = 3.0
    # Who flies on beside us, on our course and at our speed, could keep us off the mission for ever. After
    # this, the release margin is given up, what is left to pass counts more and more, and passing him faster
    # or slower comes into question.
    patience_s: Annotated[float, Gt(0), Le(600)] = 75.0
    # Where the fence is in the way of the mission, it is followed for so long before the mission is flown.
    return_within_s: Annotated[float, Ge(0), Le(600)] = 90.0
    # An avoidance goes no further up or down than this from where it would otherwise be.
    largest_height_change_m: Annotated[float, Gt(0), Le(3_000)] = 300.0
    # No row may leave the fence within so many times what turning around takes. One is enough to stay inside:
    # who turns around never gets further ahead than who flies on for the same time, so that where flying on
    # is allowed there is room to turn; the rest is for the time until the next decision.
    fence_look_ahead_turns: Annotated[float, Ge(0.5), Le(4)] = 1.2
    # Rows are priced against the most pressing tracks; the others still count for the layers.
    priced_tracks: Annotated[int, Gt(0), Le(200)] = 16
    # What the paper compares: layers, ways to steer in the outer one, controls (P9, P10) in the inner one.
    layers: Layers = Layers.BOTH
    outer_method: OuterMethod = OuterMethod.PRICED
    controls: frozenset[Control] = ALL_CONTROLS
    envelope: Envelope = field(default_factory=Envelope)
    formation: FormationParams = field(default_factory=FormationParams)
    field_gains: FieldParams = field(default_factory=FieldParams)
    weights: CostWeights = field(default_factory=CostWeights)
    surprises: SurpriseParams = field(default_factory=SurpriseParams)

    @property
    def clears_inner_layer(self) -> bool:
        """Whether the inner layer is a sphere to be kept clear of (§2.3), not only where emergencies are."""
        return self.weights.nearness > 0.0

    def __post_init__(self) -> None:
        if self.inner_radius_m > self.outer_radius_m or self.inner_time_s > self.outer_time_s:
            raise ValueError("the inner layer must not reach further than the outer layer")
