"""The strategies that the paper compares, as parameters of the product's avoider."""

import math
from dataclasses import dataclass, replace

from companion.avoidance import AvoidanceParams, Control, Envelope
from companion.avoidance.group.formation import FormationParams
from companion.avoidance.intruders import NO_MANEUVERS
from companion.avoidance.params import FieldParams, Layers, OuterMethod
from sim.paper.scene import Scene, Uav

# Cost weight of the inner sphere. On random fields 10000 to 10059, weights of 10, 20 and 30 gave a clearance
# of 0.77, 1.05 and 1.09 lengths with two layers, at path ratios of 1.23, 1.31 and 1.37.
NEARNESS = 10.0
DEFAULTS = AvoidanceParams()
_FLAT = frozenset({Control.HEADING, Control.SPEED})  # figure 6: the experiments stay at one height


@dataclass(frozen=True, slots=True)
class Method:
    """One strategy; `layers` is `None` for straight flight."""

    name: str
    label: str
    layers: Layers | None
    outer: OuterMethod = OuterMethod.PRICED
    controls: frozenset[Control] = _FLAT
    cooperate: bool = False  # True: members of a group use the joint table
    nearness: float = NEARNESS
    delta_beta_rad: float | None = None  # `None`: the default of the avoidance

    def params(self, scene: Scene, uav: Uav) -> AvoidanceParams:
        """The avoidance parameters of this strategy, on the scale of a scene.

        Forces are measured in units of the outer radius; the paper's gains are converted with its powers in
        eq. 5 and 7.
        """
        assert self.layers is not None
        scale, defaults = scene.scale, DEFAULTS
        priced = self.outer is OuterMethod.PRICED
        gains = (
            FieldParams()
            if priced
            else FieldParams(
                attraction_gain=scene.attraction_gain * scene.outer_radius,
                repulsion_gain=scene.repulsion_gain / scene.outer_radius**3,
            )
        )
        delta = defaults.delta_beta_rad if self.delta_beta_rad is None else self.delta_beta_rad
        return replace(
            defaults,
            outer_radius_m=scene.outer_radius * scale.unit_m,
            inner_radius_m=scene.inner_radius * scale.unit_m,
            outer_time_s=0.0,
            inner_time_s=0.0,
            delta_beta_rad=delta,
            # The paper releases as soon as the distance allows; the default waits a little.
            release_after_s=defaults.release_after_s if priced else 0.0,
            layers=self.layers,
            outer_method=self.outer,
            controls=self.controls,
            field_gains=gains,
            # The paper's obstacles fly straight and pass soon: no intruder maneuvers are considered, and a
            # course is judged by its angle. A conflict begins where its cone does.
            begin_near=1.0,
            begin_far=1.0,
            surprises=NO_MANEUVERS,
            weights=replace(defaults.weights, nearness=self.nearness, aside=0.0, unresolved=0.0, switch=0.6),
            envelope=envelope_of(scene, uav),
            formation=FormationParams(
                own_id=uav.id,
                cooperate=self.cooperate,
                separation_m=scene.inner_radius * scale.unit_m,
                # For both, the paper's radius of influence.
                influence_m=scene.outer_radius * scale.unit_m,
                reach_m=scene.outer_radius * scale.unit_m,
                # The paper's group is who is within this radius now, and it looks as far ahead as one UAV.
                group_within_s=0.0,
                horizon_s=90.0,
                smallest_m=2.0 * scene.uav_radius * scale.unit_m,
            ),
        )


def envelope_of(scene: Scene, uav: Uav) -> Envelope:
    """The envelope of a UAV of this speed; bank, climb and response are the defaults."""
    cruise_mps = scene.scale.speed_mps(uav.step)
    return Envelope(
        min_airspeed_mps=scene.slowest * cruise_mps,
        max_airspeed_mps=scene.fastest * cruise_mps,
        max_turn_rate_radps=math.radians(20.0),
    )


NONE = Method("none", "no avoidance", None)
FIELD = Method("field", "plain field", Layers.OUTER, OuterMethod.FIELD)
CONE = Method("cone", "field and cone", Layers.OUTER, OuterMethod.CONE)
OUTER = Method("outer", "outer layer only", Layers.OUTER, OuterMethod.TRANSITION)
INNER = Method("inner", "inner layer only", Layers.INNER)
TWO_LAYER = Method("two_layer", "two layers", Layers.BOTH, cooperate=True)

# Further strategies for comparison.
OUTER_PRICED = Method("outer_priced", "outer layer only, priced", Layers.OUTER)
TWO_LAYER_PLAIN = Method("two_layer_plain", "two layers, field unpriced", Layers.BOTH, OuterMethod.TRANSITION)
TWO_LAYER_ALONE = Method("two_layer_alone", "two layers, not cooperating", Layers.BOTH)
AS_FLOWN = Method("as_flown", "two layers, inner sphere not cleared", Layers.BOTH, nearness=0.0)
CONTROLS = (
    *(
        Method(f"inner_{c}", f"inner layer only, {c} alone", Layers.INNER, controls=frozenset({c}))
        for c in Control
    ),
    Method("inner_integrated", "inner layer only, all controls", Layers.INNER, controls=frozenset(Control)),
)

REPORTED = (NONE, OUTER, INNER, TWO_LAYER)
MORE = {
    "single": (FIELD, CONE, OUTER_PRICED, TWO_LAYER_PLAIN, AS_FLOWN, *CONTROLS),
    "group": (FIELD, CONE, OUTER_PRICED, TWO_LAYER_PLAIN, TWO_LAYER_ALONE),
}
