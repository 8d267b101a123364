"""The paper's flights, whole: arrival, collisions, limits, local minima, and a group of one mind."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.avoidance import Avoider
from companion.avoidance.geometry import position_at
from companion.avoidance.group.formation import JointResponse, MemberState, group_around, joint_response
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

# A hair for the accumulated rounding of ten substeps a step.
ROUNDING = 1e-6


@cache
def flown(scene: str, method: Method) -> Flight:
    if (scene, method) == ("group", TWO_LAYER):
        return listened().flight
    return fly(SCENES[scene], method)


def measured(scene: str, method: Method) -> Measures:
    return measure(flown(scene, method))


def turned_rad(one: UavFlight) -> NDArray[np.float64]:
    """How far it turned in each step."""
    turned: NDArray[np.float64] = np.abs(np.diff(np.unwrap(one.course)))
    return turned


@pytest.mark.parametrize("scene", SCENES)
def test_two_layers_arrive_and_touch_nothing(scene: str) -> None:
    measures = measured(scene, TWO_LAYER)
    assert measures.arrived
    assert measures.collisions == 0
    assert measures.min_clearance is not None
    assert measures.min_clearance > 0.0
    assert measures.path_ratio < 1.5


@pytest.mark.parametrize("scene", ["single", "group", "in-line", "u-shape"])
def test_without_avoidance_it_collides(scene: str) -> None:
    """So that the flights without collisions have something to be proud of."""
    assert measured(scene, NONE).collisions > 0


@pytest.mark.parametrize(("scene", "method"), MANY)
def test_every_strategy_of_the_report_touches_nothing(scene: str, method: Method) -> None:
    assert measured(scene, method).collisions == 0
    assert measured(scene, method).arrived


@pytest.mark.parametrize(("scene", "method"), MANY)
def test_no_aircraft_banks_or_flies_faster_than_it_can(scene: str, method: Method) -> None:
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
def test_no_aircraft_turns_faster_than_its_envelope_says(scene: str, method: Method) -> None:
    at = SCENES[scene]
    for one in flown(scene, method).uavs:
        most_rad = envelope_of(at, one.uav).max_turn_rate_radps * at.step_s
        assert turned_rad(one).max() <= most_rad + ROUNDING


@pytest.mark.parametrize("scene", ["single", "group"])
def test_nobody_is_asked_for_what_he_cannot_fly(scene: str) -> None:
    at = SCENES[scene]
    for one in flown(scene, TWO_LAYER).uavs:
        asked = one.uav.step + one.speed_command
        assert (asked >= at.slowest * one.uav.step - ROUNDING).all()
        assert (asked <= at.fastest * one.uav.step + ROUNDING).all()
        assert (np.abs(one.turn_command) <= math.pi).all()
        assert np.abs(one.height).max() < ROUNDING, "the experiments stay at one height"


def shortened(scene: Scene) -> Scene:
    """The beginning of the same ways."""
    nearer = [
        replace(
            uav, goal=(0.92 * uav.start[0] + 0.08 * uav.goal[0], 0.92 * uav.start[1] + 0.08 * uav.goal[1])
        )
        for uav in scene.uavs
    ]
    return replace(scene, uavs=tuple(nearer))


def same(one: Flight, other: Flight) -> bool:
    """Bit for bit."""
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


def test_both_layers_have_their_part() -> None:
    """By distance as in figure 6: the mission, the outer layer, the inner layer."""
    assert layers("single", TWO_LAYER_PLAIN) == set(Layer)
    assert layers("single", OUTER) == {Layer.CLEAR, Layer.OUTER}


def test_the_inner_layer_alone_flies_no_outer_layer() -> None:
    assert layers("single", INNER) == {Layer.CLEAR, Layer.INNER}


def test_the_plain_field_is_caught_by_a_minimum_that_two_layers_get_out_of() -> None:
    """A fixed wing cannot stop in a minimum: it circles there until its patience ends."""
    assert not measured("gap", FIELD).arrived
    assert measured("gap", FIELD).path_ratio > 2.5
    assert measured("gap", TWO_LAYER).path_ratio < 1.5


def test_the_cone_lets_through_a_gap_that_the_field_closes() -> None:
    """Who flies between two obstacles is in neither cone (§3.1)."""
    for method in (CONE, OUTER):
        assert measured("gap", method).arrived
        assert measured("gap", method).collisions == 0


def test_the_transition_domain_calms_the_cone() -> None:
    """Without it the aircraft chatters along the edge of the cone (figure 3)."""
    assert measured("single", OUTER).jitter < 0.5 * measured("single", CONE).jitter


def test_who_cooperates_keeps_further_apart() -> None:
    together, alone = measured("group", TWO_LAYER), measured("group", OUTER)
    assert together.safety_value is not None
    assert alone.safety_value is not None
    assert together.safety_value > 1.2 * alone.safety_value
    assert together.min_separation is not None
    assert together.min_separation >= SCENES["group"].inner_radius


@dataclass(frozen=True)
class Said:
    """What one UAV saw and decided at one moment."""

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
        """The group's answer, from nothing but what this one saw."""
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
class Overheard:
    """A flight, and all that was seen and decided on it, by moment."""

    flight: Flight
    by_moment: dict[float, list[Said]]


@cache
def listened() -> Overheard:
    """The group's flight in two layers."""
    by_moment: dict[float, list[Said]] = defaultdict(list)
    decide = Avoider.decide

    def listening(
        avoider: Avoider, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal
    ) -> Decision:
        decision = decide(avoider, now_s, own, tracks, goal)
        by_moment[now_s].append(Said(avoider, now_s, own, tracks, goal, decision))
        return decision

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Avoider, "decide", listening)
        return Overheard(fly(SCENES["group"], TWO_LAYER), by_moment)


def test_each_decides_for_himself_and_all_come_to_the_same() -> None:
    """Everybody's own table, made of what he alone sees, holds what all the others really decide."""
    in_company = [said for said in listened().by_moment.values() if len(said) > 1][::20]
    assert len(in_company) >= 10
    answered = 0
    for said in in_company:
        answers = {one.own_id: one.joint() for one in said}
        for one in said:
            answer = answers[one.own_id]
            if answer is None:
                continue
            # Bit for bit, whoever of those in it asks.
            assert all(answers[other] == answer for other in answer.guidance)
            if one.decision.guidance is not None:
                assert one.decision.guidance == answer.guidance[one.own_id]
                assert one.decision.layer is not Layer.CLEAR
                answered += 1
    assert answered >= 20


def test_who_is_left_alone_flies_on_as_if_there_had_been_no_group() -> None:
    last = [said[0] for said in listened().by_moment.values() if len(said) == 1]
    assert last, "they do not arrive all at once"
    assert all(one.decision.layer is Layer.CLEAR for one in last)
