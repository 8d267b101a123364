"""The paper's flights: arrival, collisions, limits, local minima, and consistent group decisions."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.avoidance import Avoider
from companion.avoidance.group.formation import MemberState, group_around
from companion.avoidance.group.joint_table import JointResponse, joint_response
from companion.avoidance.trajectory import position_at
from companion.model import Decision, Goal, Layer, Ownship, Track
from companion.units import STANDARD_GRAVITY_MPS2
from sim.paper.flight import LAYERS, Flight, UavFlight, fly
from sim.paper.measures import Measures, measure
from sim.paper.methods import (
    CONE,
    FIELD,
    INNER,
    NONE,
    OUTER,
    TWO_LAYER,
    TWO_LAYER_PLAIN,
    Method,
    envelope_of,
)
from sim.paper.scene import Scene, load_scene, minima_scenes

SCENES: dict[str, Scene] = {
    "single": load_scene("single"),
    "group": load_scene("group"),
    **minima_scenes(),
}
MANY = [
    pytest.param(scene, method, id=f"{scene}-{method.name}")
    for scene, method in (
        ("single", TWO_LAYER),
        ("single", INNER),
        ("single", OUTER),
        ("group", TWO_LAYER),
        ("group", OUTER),
    )
]

# Tolerance for the accumulated rounding of ten substeps a step.
ROUNDING = 1e-6


@cache
def flown(scene: str, method: Method) -> Flight:
    if (scene, method) == ("group", TWO_LAYER):
        return observed().flight
    return fly(SCENES[scene], method)


def measured(scene: str, method: Method) -> Measures:
    return measure(flown(scene, method))


def turned_rad(one: UavFlight) -> NDArray[np.float64]:
    """The turn in each step [rad]."""
    turned: NDArray[np.float64] = np.abs(np.diff(np.unwrap(one.course)))
    return turned


@pytest.mark.parametrize("scene", SCENES)
def test_two_layers_arrive_without_collision(scene: str) -> None:
    measures = measured(scene, TWO_LAYER)
    assert measures.arrived
    assert measures.collisions == 0
    assert measures.min_clearance is not None
    assert measures.min_clearance > 0.0
    assert measures.path_ratio < 1.5


@pytest.mark.parametrize("scene", ["single", "group", "in-line", "u-shape"])
def test_without_avoidance_it_collides(scene: str) -> None:
    """The scenes do need avoidance."""
    assert measured(scene, NONE).collisions > 0


@pytest.mark.parametrize(("scene", "method"), MANY)
def test_every_strategy_of_the_report_has_no_collision(scene: str, method: Method) -> None:
    assert measured(scene, method).collisions == 0
    assert measured(scene, method).arrived


@pytest.mark.parametrize(("scene", "method"), MANY)
def test_bank_and_speed_are_within_the_envelope(scene: str, method: Method) -> None:
    at = SCENES[scene]
    for one in flown(scene, method).uavs:
        limits, speed_mps = envelope_of(at, one.uav), one.speed * at.scale.speed_mps(1.0)
        # A coordinated turn at the bank limit, at the slower of the speeds before and after.
        slower_mps = np.minimum(speed_mps[1:], speed_mps[:-1])
        fastest_radps = STANDARD_GRAVITY_MPS2 * math.tan(limits.max_bank_rad) / slower_mps
        assert (turned_rad(one) <= fastest_radps * at.step_s + ROUNDING).all()
        assert (speed_mps >= limits.min_airspeed_mps - ROUNDING).all()
        assert (speed_mps <= limits.max_airspeed_mps + ROUNDING).all()
        assert (np.abs(np.diff(speed_mps)) <= limits.max_acceleration_mps2 * at.step_s + ROUNDING).all()


@pytest.mark.parametrize(("scene", "method"), MANY)
def test_turn_rates_are_within_the_envelope(scene: str, method: Method) -> None:
    at = SCENES[scene]
    for one in flown(scene, method).uavs:
        most_rad = envelope_of(at, one.uav).max_turn_rate_radps * at.step_s
        assert turned_rad(one).max() <= most_rad + ROUNDING


@pytest.mark.parametrize("scene", ["single", "group"])
def test_commands_are_within_the_envelope(scene: str) -> None:
    at = SCENES[scene]
    for one in flown(scene, TWO_LAYER).uavs:
        commanded = one.uav.step + one.speed_command
        assert (commanded >= at.slowest * one.uav.step - ROUNDING).all()
        assert (commanded <= at.fastest * one.uav.step + ROUNDING).all()
        assert (np.abs(one.turn_command) <= math.pi).all()
        assert np.abs(one.height).max() < ROUNDING, "the experiments stay at one height"


def shortened(scene: Scene) -> Scene:
    """The scene with the goals moved towards the starts."""
    nearer = [
        replace(
            uav, goal=(0.92 * uav.start[0] + 0.08 * uav.goal[0], 0.92 * uav.start[1] + 0.08 * uav.goal[1])
        )
        for uav in scene.uavs
    ]
    return replace(scene, uavs=tuple(nearer))


def same(one: Flight, other: Flight) -> bool:
    """True if both flights are the same bit for bit."""
    return all(
        a.arrived_step == b.arrived_step
        and all(
            getattr(a, name).tobytes() == getattr(b, name).tobytes()
            for name in ("position", "height", "course", "speed", "turn_command", "speed_command", "layer")
        )
        for a, b in zip(one.uavs, other.uavs, strict=True)
    )


def test_the_same_flight_twice_is_the_same_bit_for_bit() -> None:
    group = shortened(SCENES["group"])
    assert same(fly(group, TWO_LAYER), fly(group, TWO_LAYER))
    assert same(flown("single", TWO_LAYER), fly(SCENES["single"], TWO_LAYER))
    assert not same(flown("single", TWO_LAYER), flown("single", INNER))


def layers(scene: str, method: Method) -> set[Layer]:
    return {LAYERS[place] for place in flown(scene, method).uavs[0].layer.tolist()}


def test_both_layers_decide() -> None:
    """By distance as in figure 6: the mission, the outer layer, the inner layer."""
    assert layers("single", TWO_LAYER_PLAIN) == set(Layer)
    assert layers("single", OUTER) == {Layer.CLEAR, Layer.OUTER}


def test_the_inner_layer_alone_flies_no_outer_layer() -> None:
    assert layers("single", INNER) == {Layer.CLEAR, Layer.INNER}


def test_the_plain_field_is_trapped_in_a_minimum_that_two_layers_leave() -> None:
    """A fixed wing cannot stop in a minimum: it circles there until the flight is given up."""
    assert not measured("gap", FIELD).arrived
    assert measured("gap", FIELD).path_ratio > 2.5
    assert measured("gap", TWO_LAYER).path_ratio < 1.5


def test_the_cone_passes_a_gap_that_the_field_closes() -> None:
    """A path between two obstacles is in neither cone (§3.1)."""
    for method in (CONE, OUTER):
        assert measured("gap", method).arrived
        assert measured("gap", method).collisions == 0


def test_the_transition_domain_reduces_jitter() -> None:
    """Without it the aircraft oscillates along the edge of the cone (figure 3)."""
    assert measured("single", OUTER).jitter < 0.5 * measured("single", CONE).jitter


def test_cooperation_increases_the_separation() -> None:
    together, alone = measured("group", TWO_LAYER), measured("group", OUTER)
    assert together.safety_value is not None
    assert alone.safety_value is not None
    assert together.safety_value > 1.2 * alone.safety_value
    assert together.min_separation is not None
    assert together.min_separation >= SCENES["group"].inner_radius


@dataclass(frozen=True)
class Observation:
    """One UAV's inputs and decision at one moment."""

    avoider: Avoider
    now_s: float
    own: Ownship
    tracks: Sequence[Track]
    goal: Goal
    decision: Decision

    @property
    def own_id(self) -> str:
        return self.avoider.params.formation.own_id

    def joint(self) -> JointResponse | None:
        """The group's answer, computed from this UAV's inputs alone."""
        states = [
            MemberState(
                self.own_id,
                position_at(self.own, self.now_s),
                self.own.velocity_mps,
                self.avoider.member(self.own, self.goal),
            )
        ]
        for track in self.tracks:
            assert track.member is not None
            states.append(
                MemberState(track.track_id, position_at(track, self.now_s), track.velocity_mps, track.member)
            )
        params = self.avoider.params.formation
        return joint_response(group_around(states, params.reach_m), params)


@dataclass(frozen=True)
class ObservedFlight:
    """A flight, with all inputs and decisions by time."""

    flight: Flight
    by_time: dict[float, list[Observation]]


@cache
def observed() -> ObservedFlight:
    """The group's flight with two layers."""
    by_time: dict[float, list[Observation]] = defaultdict(list)
    decide = Avoider.decide

    def observing(
        avoider: Avoider, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal
    ) -> Decision:
        decision = decide(avoider, now_s, own, tracks, goal)
        by_time[now_s].append(Observation(avoider, now_s, own, tracks, goal, decision))
        return decision

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Avoider, "decide", observing)
        return ObservedFlight(fly(SCENES["group"], TWO_LAYER), by_time)


def test_each_uav_computes_the_same_joint_decision() -> None:
    """The joint table computed from one UAV's inputs holds the decisions of all others."""
    together = [group for group in observed().by_time.values() if len(group) > 1][::20]
    assert len(together) >= 10
    answered = 0
    for group in together:
        answers = {one.own_id: one.joint() for one in group}
        for one in group:
            answer = answers[one.own_id]
            if answer is None:
                continue
            # Bit for bit the same for every member of the answer.
            assert all(answers[other] == answer for other in answer.guidance)
            if one.decision.guidance is not None:
                assert one.decision.guidance == answer.guidance[one.own_id]
                assert one.decision.layer is not Layer.CLEAR
                answered += 1
    assert answered >= 20


def test_the_last_uav_flies_on_without_avoidance() -> None:
    last = [group[0] for group in observed().by_time.values() if len(group) == 1]
    assert last, "the arrivals are at different times"
    assert all(one.decision.layer is Layer.CLEAR for one in last)
