"""Two-sided encounters: the intruder's mission, what each receives of the other, and mirrored maneuvers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.campaign.flight import unmitigated
from sim.campaign.mirroring import SIDEWAYS, VERTICAL, mirrored
from sim.campaign.plan import Plan
from sim.campaign.plane import Limits, Plane
from sim.campaign.route import along, straight
from sim.campaign.trail import LiveReceiver, Trail
from sim.campaign.two_sided import is_flyable, sides_of
from sim.encounters import SURVEILLANCE_PRESETS, Path, Surveillance, generate

LEVEL = generate("level", 3, 1)


def straight_path(velocity_mps: tuple[float, float, float], duration_s: int = 120) -> Path:
    times_s = np.arange(duration_s + 1, dtype=float)
    velocity = np.tile(velocity_mps, (len(times_s), 1))
    return Path(times_s, times_s[:, None] * velocity, velocity)


@given(st.integers(0, 200))
def test_encounters_of_the_plan_can_be_flown_by_both(number: int) -> None:
    encounter = Plan(1, seed=8, two_sided=True).source()(number)
    assert is_flyable(encounter)
    again = Plan(1, seed=8, two_sided=True).source()(number)
    assert again.encounter_id == encounter.encounter_id


@pytest.mark.parametrize("kind", ["turning", "climbing", "level", "accelerating"])
def test_the_intruders_mission_leads_along_its_path(kind: str) -> None:
    """Flown without avoidance, both pass each other as in the encounter."""
    checked = 0
    for number in range(60):
        encounter = generate(kind, 12, number)
        if is_flyable(encounter):
            ours, theirs = sides_of(encounter, Limits())
            assert abs(unmitigated(ours.encounter).severity - unmitigated(encounter).severity) < 0.35
            assert theirs.limits.min_airspeed_mps < theirs.encounter.own_airspeed_mps
            assert ours.limits == Limits()
            checked += 1
    assert checked > 5


def test_both_sides_see_the_same_encounter() -> None:
    encounter = Plan(1, seed=8, two_sided=True).source()(4)
    ours, theirs = sides_of(encounter, Limits())
    seen = unmitigated(theirs.encounter, theirs.route, theirs.limits)
    assert seen.severity == pytest.approx(unmitigated(ours.encounter).severity, abs=0.02)


def test_legs_follow_a_path_with_few_corners() -> None:
    assert len(along(straight_path((30.0, 10.0, 0.0))).places_m) == 4
    turning = generate("turning", 12, 3).intruders[0]
    route = along(turning)
    off_m = route.off_m(turning.position_m)
    assert np.abs(off_m[:, 0]).max() < 25.0
    assert len(route.places_m) < 30


OURS, THEIRS = straight_path((25.0, 0.0, 0.0)), straight_path((-25.0, 0.0, 0.0)).moved((3000.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("own_m", "other_m", "ways"),
    [
        ((0.0, 0.0, -40.0), (0.0, 0.0, -30.0), (VERTICAL,)),
        ((0.0, 0.0, -40.0), (0.0, 0.0, 30.0), ()),
        ((0.0, 0.0, -40.0), (0.0, 0.0, -5.0), ()),
        ((0.0, 300.0, 0.0), (0.0, 90.0, 0.0), (SIDEWAYS,)),
        ((0.0, 300.0, 0.0), (0.0, -90.0, 0.0), ()),
        ((0.0, 300.0, 20.0), (0.0, 90.0, 20.0), (VERTICAL, SIDEWAYS)),
    ],
)
def test_maneuvers_to_the_same_side_are_mirrored(
    own_m: tuple[float, ...], other_m: tuple[float, ...], ways: tuple[str, ...]
) -> None:
    times_s = np.arange(1201) * 0.1
    flown = tuple(
        path.positions_m(times_s) + np.array(moved) for path, moved in ((OURS, own_m), (THEIRS, other_m))
    )
    assert mirrored((OURS, THEIRS), (flown[0], flown[1]), 0.1) == ways


def trails(seconds: int = 30) -> tuple[Trail, Trail]:
    ours, theirs = Trail(), Trail()
    own = Plane((0.0, 0.0, -300.0), 25.0, straight(LEVEL), Limits())
    other = Plane((0.0, 2000.0, -300.0), 25.0, straight(LEVEL), Limits())
    for step in range(0, 10 * seconds, 5):
        ours.note(step * 0.1, own)
        theirs.note(step * 0.1, other)
        own.fly(5, 0.1)
        other.fly(5, 0.1)
    return ours, theirs


@given(st.sampled_from([0.0, 0.5, 1.0, 1.7, 2.0]), st.sampled_from([0.5, 1.0, 2.0]))
def test_a_receiver_gives_each_report_once_and_as_it_was(latency_s: float, period_s: float) -> None:
    ours, theirs = trails()
    receiver = LiveReceiver(theirs, ours, 1, Surveillance(period_s=period_s, latency_s=latency_s), 4)
    heard = [one for step in range(60) for one in receiver.reports(step * 0.5)]
    assert len(heard) == math.floor(29.5 / period_s + 1e-9) + 1
    for index, sent_s, position_m, _, age_s in heard:
        assert index == 1
        assert age_s == latency_s
        assert math.dist(position_m, theirs.state_at(sent_s)[0]) < 1e-6


def test_reports_are_lost_and_wrong_as_the_preset_says() -> None:
    ours, theirs = trails(300)
    poor = SURVEILLANCE_PRESETS["poor"]
    receiver = LiveReceiver(theirs, ours, 0, poor, 4)
    heard = receiver.reports(299.0)
    assert 0.55 < len(heard) / 300.0 < 0.85
    off_m = [math.dist(place_m[:2], theirs.state_at(sent_s)[0][:2]) for _, sent_s, place_m, *_ in heard]
    assert 40.0 < float(np.mean(off_m)) < 90.0
    near = LiveReceiver(theirs, ours, 0, replace(poor, first_heard_m=1000.0), 4)
    assert near.reports(20.0) == []
