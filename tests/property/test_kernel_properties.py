"""The kernels against the same maths written plainly in numpy, in random situations."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.intruders import (
    IntruderManeuvers,
    Tracks,
    approach_angle_rad,
    heights_to_pass,
    losses,
    outcomes,
    relative_motion,
    separation,
)
from companion.avoidance.params import CostWeights
from companion.avoidance.senses import WrongWays
from companion.avoidance.trajectory import (
    HORIZON_S,
    TIMES_S,
    Array,
    Commands,
    Envelope,
    OwnState,
    Paths,
    fly_ahead,
    ground_velocity_mps,
    index_at,
)
from companion.compiled import kernels
from companion.model import Guidance, Vec2, Vec3
from companion.units import STANDARD_GRAVITY_MPS2

STEPS_S = np.diff(TIMES_S)
MIDDLES_S = TIMES_S[:-1] + 0.5 * STEPS_S
TURN_DECAY_S = 35.0  # time constant of a rate of turn

STILL = (0.0, 0.0, 0.0)

seeds = st.integers(0, 2**32 - 1)


def random_tracks(rng: np.random.Generator) -> Tracks:
    count = int(rng.integers(0, 6))
    turn_radps = rng.normal(0.0, 0.03, count)
    turn_radps[rng.random(count) < 0.4] = 0.0
    return Tracks(
        tuple(str(i) for i in range(count)),
        rng.normal(0.0, 1.0, (count, 3)) * (3000.0, 3000.0, 150.0) - (0.0, 0.0, 300.0),
        rng.normal(0.0, 1.0, (count, 3)) * (60.0, 60.0, 3.0),
        rng.uniform(50.0, 900.0, count),
        rng.uniform(20.0, 150.0, count),
        rng.random(count) < 0.2,
        rng.uniform(0.0, 300.0, count),
        turn_radps,
    )


def three(values: Array) -> Vec3:
    first, second, third = values.tolist()
    return first, second, third


def two(values: Array) -> Vec2:
    first, second = values.tolist()
    return first, second


def random_own(rng: np.random.Generator) -> OwnState:
    """A random state; in calm air the heading is the course."""
    calm = rng.random() < 0.5
    wind = (0.0, 0.0) if calm else two(rng.normal(0.0, 6.0, 2))
    return OwnState(
        (*two(rng.normal(0.0, 100.0, 2)), -300.0),
        float(rng.uniform(-math.pi, math.pi)),
        float(rng.uniform(14.0, 30.0)),
        float(rng.normal(0.0, 1.5)),
        wind,
        None if calm or rng.random() < 0.5 else float(rng.uniform(-math.pi, math.pi)),
    )


def random_commands(rng: np.random.Generator) -> Commands:
    grounds, heights, rows = (int(n) for n in rng.integers(1, (9, 4, 20)))
    return Commands(
        rng.uniform(-4.0, 4.0, grounds),
        rng.uniform(14.0, 30.0, grounds),
        rng.uniform(100.0, 500.0, heights),
        rng.integers(0, grounds, rows).astype(np.intp),
        rng.integers(0, heights, rows).astype(np.intp),
    )


def plain_tracks_m(tracks: Tracks) -> Array:
    """Positions, (N, T, 2): the rate of turn decays, and each step has the course at its middle."""
    turned_s = TURN_DECAY_S * (1.0 - np.exp(-MIDDLES_S / TURN_DECAY_S))
    velocity = tracks.velocity_mps[:, :1] + 1j * tracks.velocity_mps[:, 1:2]
    flown = np.cumsum(velocity * np.exp(1j * tracks.turn_radps[:, None] * turned_s) * STEPS_S, axis=1)
    flown = np.concatenate([np.zeros((len(tracks), 1)), flown], axis=1)
    ahead: Array = tracks.position_m[:, None, :2] + np.stack([flown.real, flown.imag], axis=2)
    return ahead


def plain_ground_m(own: OwnState, commands: Commands, envelope: Envelope) -> Array:
    """Ground paths by eq. 2, carried along by the wind, (H, T, 2), without any shortcut."""
    target_rad, target_mps = commands.course_rad[:, None], commands.airspeed_mps[:, None]
    fastest_mps = np.maximum(np.maximum(target_mps, own.airspeed_mps), 1.0)
    bank_limited = STANDARD_GRAVITY_MPS2 * math.tan(envelope.max_bank_rad) / fastest_mps
    most_rad = np.minimum(bank_limited, envelope.max_turn_rate_radps) * np.maximum(
        MIDDLES_S - envelope.response_s, 0.0
    )
    gained_mps = envelope.max_acceleration_mps2 * MIDDLES_S
    airspeed_mps = own.airspeed_mps + np.clip(target_mps - own.airspeed_mps, -gained_mps, gained_mps)
    across_mps = own.wind_mps[1] * np.cos(target_rad) - own.wind_mps[0] * np.sin(target_rad)
    crab_rad = np.arcsin(np.clip(across_mps / np.maximum(airspeed_mps, 1e-3), -1.0, 1.0))
    around_rad = (target_rad - own.course_rad + math.pi) % math.tau - math.pi
    turn_rad = np.clip(around_rad + own.crab_rad - crab_rad, -most_rad, most_rad)
    heading_rad = own.course_rad - own.crab_rad + turn_rad
    through_m = np.cumsum(STEPS_S * airspeed_mps * np.exp(1j * heading_rad), axis=1)
    through_m = np.concatenate([np.zeros((len(target_rad), 1)), through_m], axis=1)
    carried_m = TIMES_S[:, None] * np.array(own.wind_mps)
    path: Array = (
        np.array(own.position_m[:2]) + carried_m + np.stack([through_m.real, through_m.imag], axis=2)
    )
    return path


def plain_ratio(paths: Paths, tracks: Tracks) -> Array:
    """Separation in protected volumes, for all rows, tracks and times, (K, N, T)."""
    off_m = paths.ground_m[paths.ground_of][:, None] - plain_tracks_m(tracks)
    down_m = tracks.position_m[:, 2:] + tracks.velocity_mps[:, 2:] * TIMES_S
    above_m = paths.altitude_m[paths.height_of][:, None] + down_m
    vertical_m = np.where(tracks.grounded[:, None], np.maximum(above_m, 0.0), np.abs(above_m))
    return np.maximum(
        np.hypot(off_m[..., 0], off_m[..., 1]) / tracks.protected_horizontal_m[:, None],
        vertical_m / tracks.protected_vertical_m[:, None],
    )


@given(seeds)
def test_predicted_tracks_are_those_of_the_plain_maths(seed: int) -> None:
    tracks = random_tracks(np.random.default_rng(seed))
    assert tracks.ground_m() == pytest.approx(plain_tracks_m(tracks), rel=1e-9, abs=1e-6)


@given(seeds)
def test_predicted_rows_are_those_of_the_plain_maths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    own, commands, envelope = (
        random_own(rng),
        random_commands(rng),
        Envelope(response_s=float(rng.uniform(0, 2))),
    )
    paths = fly_ahead(own, commands, envelope)
    assert paths.ground_m == pytest.approx(plain_ground_m(own, commands, envelope), rel=1e-9, abs=1e-6)
    acting_s = np.maximum(TIMES_S - envelope.response_s, 0.0)
    climb_mps = np.clip(own.climb_mps, -2.0 * envelope.max_sink_mps, 2.0 * envelope.max_climb_mps)
    before_m = 300.0 + climb_mps * np.minimum(TIMES_S, envelope.response_s)
    to_go_m = commands.altitude_m[:, None] - (300.0 + climb_mps * envelope.response_s)
    gained_m = np.clip(to_go_m, -envelope.max_sink_mps * acting_s, envelope.max_climb_mps * acting_s)
    assert paths.altitude_m == pytest.approx(before_m + gained_m, rel=1e-9, abs=1e-6)


@given(seeds, st.floats(0.0, HORIZON_S))
def test_separation_is_that_of_every_row_track_and_time(seed: int, horizon_s: float) -> None:
    rng = np.random.default_rng(seed)
    tracks = random_tracks(rng)
    paths = fly_ahead(random_own(rng), random_commands(rng), Envelope())
    kept = separation(paths, tracks, horizon_s=horizon_s, buffers=True)
    count = max(int((horizon_s >= TIMES_S).sum()), 2)
    ratio = plain_ratio(paths, tracks)[..., :count]
    share = STEPS_S[: count - 1] / HORIZON_S
    assert kept.closest == pytest.approx(ratio.min(axis=2), rel=1e-9)
    depth = np.maximum(1.0 - ratio[..., 1:], 0.0)
    assert kept.exposure == pytest.approx(depth @ share, rel=1e-9, abs=1e-12)
    volumes = (tracks.protected_horizontal_m / np.maximum(tracks.buffer_m, 1.0))[:, None]
    in_buffer = np.clip(1.0 - (ratio[..., 1:] - 1.0) * volumes, 0.0, 1.0)
    assert kept.nearness == pytest.approx(in_buffer @ share, rel=1e-9, abs=1e-9)
    within = ratio < 1.0
    entered_s = np.where(within.any(axis=2), TIMES_S[within.argmax(axis=2)], np.inf)
    assert (kept.entered_s == entered_s).all()


@given(seeds, st.floats(0.0, HORIZON_S), st.floats(0.0, HORIZON_S))
def test_losses_are_the_prices_of_separation_weighted_with_probabilities(
    seed: int, horizon_s: float, soon_s: float
) -> None:
    rng = np.random.default_rng(seed)
    tracks = random_tracks(rng)
    maneuvers = random_maneuvers(rng, len(tracks))
    weights = CostWeights(*rng.uniform(0.0, 100.0, 4).tolist())
    paths = fly_ahead(random_own(rng), random_commands(rng), Envelope())
    cost, closest = losses(paths, tracks, maneuvers, weights, 0.8, horizon_s=horizon_s, soon_s=soon_s)
    expected = np.zeros(len(paths.ground_of))
    each = [
        (separation(paths, tracks.subset(np.array([n])), horizon_s=horizon_s), 1.0)
        for n in range(len(tracks))
    ]
    each += [
        (separation(paths, one, horizon_s=soon_s), likely)
        for one, likely in maneuvering_tracks(tracks, maneuvers)
    ]
    for kept, likely in each:
        depth = np.maximum(0.8 - kept.closest[:, 0], 0.0)
        price = weights.margin * np.maximum(1.0 - kept.closest[:, 0], 0.0) + weights.loss * (depth > 0.0)
        price += weights.depth * depth + weights.exposure * kept.exposure[:, 0]
        expected += likely * price
    assert cost == pytest.approx(expected, rel=1e-9, abs=1e-9)
    kept = separation(paths, tracks, horizon_s=horizon_s)
    assert closest == pytest.approx(kept.closest.min(axis=1, initial=math.inf)), (
        "from predicted flights alone"
    )


def random_maneuvers(rng: np.random.Generator, tracks: int) -> IntruderManeuvers:
    count = int(rng.integers(0, 6)) if tracks else 0
    of = rng.integers(0, max(tracks, 1), count).astype(np.intp)
    return IntruderManeuvers(of, rng.normal(0.0, 0.05, count), rng.normal(0.0, 3.0, count), rng.random(count))


def maneuvering_tracks(tracks: Tracks, maneuvers: IntruderManeuvers) -> list[tuple[Tracks, float]]:
    """Each maneuver as a track of its own, and its probability."""
    made = []
    for of, turn_radps, sink_mps, likely in zip(*maneuvers, strict=True):
        one = tracks.subset(np.array([of]))
        velocity_mps = np.column_stack([one.velocity_mps[:, :2], [sink_mps]])
        made.append((replace(one, turn_radps=np.array([turn_radps]), velocity_mps=velocity_mps), likely))
    return made


@given(seeds, st.floats(1.0, HORIZON_S))
def test_outcomes_are_the_distance_from_the_mission_and_the_closest_approach_after_it(
    seed: int, then_s: float
) -> None:
    rng = np.random.default_rng(seed)
    tracks, own, then = random_tracks(rng), random_own(rng), index_at(then_s)
    paths = fly_ahead(own, random_commands(rng), Envelope())
    onward_mps = ground_velocity_mps(1.0, 22.0, own.wind_mps)
    mission_m = rng.normal(0.0, 500.0, 2)
    aside, unresolved = rng.uniform(0.0, 9.0, 2).tolist()
    cost = outcomes(paths, tracks, then, mission_m, onward_mps, 310.0, aside=aside, unresolved=unresolved)
    ahead_m = plain_tracks_m(tracks)
    expected = np.zeros(len(paths.ground_m))
    for n in range(len(tracks)):
        approach_mps = (ahead_m[n, then] - ahead_m[n, then - 1]) / STEPS_S[then - 1] - onward_mps
        for h in range(len(expected)):
            start_m = ahead_m[n, then] - paths.ground_m[h, then]
            to_go_s = max(-(start_m @ approach_mps) / max(approach_mps @ approach_mps, 1.0), 0.0)
            across_m = np.hypot(*(start_m + approach_mps * to_go_s))
            above_m = 310.0 + tracks.position_m[n, 2] + tracks.velocity_mps[n, 2] * TIMES_S[then]
            vertical_m = max(above_m, 0.0) if tracks.grounded[n] else abs(above_m)
            ratio = max(
                across_m / tracks.protected_horizontal_m[n], vertical_m / tracks.protected_vertical_m[n]
            )
            expected[h] = max(expected[h], 1.0 - ratio)
    off_m = np.hypot(*(paths.ground_m[:, then] - mission_m).T)
    assert cost == pytest.approx(aside * off_m + unresolved * expected, rel=1e-9, abs=1e-9)


@given(seeds)
def test_efforts_are_those_of_the_plain_maths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    commands, mission = random_commands(rng), random_guidance(rng)
    held = random_guidance(rng) if rng.random() < 0.5 else None
    if held is not None:
        commands = commands.preceded_by(held)
    weights, flown_rad = CostWeights(*rng.uniform(0.0, 9.0, 17).tolist()), float(rng.uniform(-4.0, 4.0))
    spares, wrong = bool(rng.random() < 0.5), WrongWays(*(bool(x) for x in rng.random(4) < 0.5))
    of_outcome, before = rng.random(len(commands.course_rad)), rng.random(len(commands))
    cost = before.copy()
    kernels.add_efforts(
        cost,
        commands,
        weights,
        of_outcome,
        mission.course_rad,
        mission.airspeed_mps,
        mission.altitude_m,
        flown_rad,
        wrong,
        spares,
        held,
        0.1,
        5.0,
        7.0,
    )
    for row in range(len(commands)):
        ground, height = commands.ground_of[row], commands.height_of[row]
        off_rad = around_rad(commands.course_rad[ground], mission.course_rad)
        off_m = commands.altitude_m[height] - mission.altitude_m
        expected = before[row] + of_outcome[ground]
        expected += weights.turn / math.pi * abs(around_rad(commands.course_rad[ground], flown_rad))
        expected += weights.deviation / math.pi * abs(off_rad)
        expected += weights.speed / 10.0 * abs(commands.airspeed_mps[ground] - mission.airspeed_mps)
        expected += weights.wrong_side * (wrong.left and off_rad < -math.radians(1.0))
        expected += weights.wrong_side * (wrong.right and off_rad > math.radians(1.0))
        expected += weights.wrong_sense * ((wrong.up and off_m > 5.0) or (wrong.down and off_m < -5.0))
        expected += weights.height / 100.0 * abs(off_m) + weights.descent * (off_m < -1.0)
        expected += weights.spared_height * (spares and abs(off_m) > 5.0)
        if held is not None and row > 0:
            held_rad = around_rad(held.course_rad, mission.course_rad)
            held_m = held.altitude_m - mission.altitude_m
            eases = min(held_rad, 0.0) - 0.1 <= off_rad <= max(held_rad, 0.0) + 0.1
            eases &= min(held_m, 0.0) - 5.0 <= off_m <= max(held_m, 0.0) + 5.0
            expected += weights.ease if eases else 7.0
        assert cost[row] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def random_guidance(rng: np.random.Generator) -> Guidance:
    return Guidance(*rng.uniform((-4.0, 14.0, 100.0), (4.0, 30.0, 500.0)).tolist())


def around_rad(course_rad: float, from_rad: float) -> float:
    return math.remainder(course_rad - from_rad, math.tau)


@given(seeds)
def test_relative_motion_is_that_of_the_plain_maths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks, own_m, own_mps = random_tracks(rng), rng.normal(0.0, 100.0, 3), rng.normal(0.0, 20.0, 3)
    motion = relative_motion(tracks.position_m, tracks.velocity_mps, three(own_m), three(own_mps))
    for n in range(len(tracks)):
        away_m, towards_mps = tracks.position_m[n] - own_m, own_mps - tracks.velocity_mps[n]
        assert motion.position_m[n] == pytest.approx(away_m)
        assert motion.own_velocity_mps[n] == pytest.approx(towards_mps)
        distance_m, along = math.hypot(*away_m[:2]), float(away_m[:2] @ towards_mps[:2])
        assert motion.distance_m[n] == pytest.approx(distance_m)
        assert motion.closing_mps[n] == pytest.approx(max(along / distance_m, 0.0))
        assert motion.time_to_closest_s[n] == pytest.approx(along / (towards_mps[:2] @ towards_mps[:2]))
        assert motion.approach_rad[n] == approach_angle_rad(away_m[None], towards_mps[None])[0]


@given(seeds)
def test_heights_to_pass_are_beyond_every_threat_while_it_is_near(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks = random_tracks(rng)
    motion = relative_motion(tracks.position_m, tracks.velocity_mps, STILL, (20.0, 0.0, 0.0))
    conflict = rng.random(len(tracks)) < 0.7
    over_m, under_m, passed_s = heights_to_pass(tracks, motion, conflict)
    tops, feet, until = [-math.inf], [math.inf], [0.0]
    for n in np.flatnonzero(conflict):
        speed_mps = max(math.hypot(*motion.own_velocity_mps[n, :2]), 1.0)
        crossing_s = min(tracks.protected_horizontal_m[n] / speed_mps, 30.0)
        closest_s = min(max(motion.time_to_closest_s[n], 0.0), HORIZON_S)
        near_s = np.linspace(max(closest_s - crossing_s, 0.0), closest_s + crossing_s, 7)
        heights_m = -tracks.position_m[n, 2] - tracks.velocity_mps[n, 2] * near_s
        tops.append(float(heights_m.max()) + 1.02 * tracks.protected_vertical_m[n])
        feet.append(float(heights_m.min()) - 1.02 * tracks.protected_vertical_m[n])
        until.append(float(near_s[-1]))
    assert over_m == pytest.approx(max(tops))
    assert under_m == pytest.approx(min(feet))
    assert passed_s == pytest.approx(min(max(until), HORIZON_S))


@given(seeds)
def test_the_mean_velocity_leads_to_the_closest_place_of_a_track(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks = random_tracks(rng)
    path_m = fly_ahead(random_own(rng), random_commands(rng), Envelope()).ground_m[0]
    mean_mps = tracks.velocity_until_closest_mps(path_m)
    ahead_m = plain_tracks_m(tracks)
    for n in range(len(tracks)):
        if tracks.turn_radps[n] == 0.0:
            assert mean_mps[n] == pytest.approx(tracks.velocity_mps[n])
            continue
        closest = max(int(np.hypot(*(ahead_m[n] - path_m).T).argmin()), 1)
        there_m = tracks.position_m[n, :2] + mean_mps[n, :2] * TIMES_S[closest]
        assert there_m == pytest.approx(ahead_m[n, closest], rel=1e-9, abs=1e-6)
        assert mean_mps[n, 2] == tracks.velocity_mps[n, 2]


def test_arrays_that_do_not_match_are_refused_and_nothing_is_read_beyond_them() -> None:
    rng = np.random.default_rng(1)
    tracks = random_tracks(rng)
    while len(tracks) < 2:
        tracks = random_tracks(rng)
    paths, more = fly_ahead(random_own(rng), random_commands(rng), Envelope()), np.zeros((len(tracks) + 1, 3))
    with pytest.raises(ValueError, match="do not match"):
        separation(paths._replace(ground_of=paths.ground_of + 1000), tracks)
    with pytest.raises(ValueError, match="do not match"):
        separation(paths._replace(height_of=paths.height_of - 1000), tracks)
    with pytest.raises(ValueError, match="do not match"):
        kernels.Times(TIMES_S, np.zeros(3), STEPS_S)
    with pytest.raises(ValueError, match="do not match"):
        tracks.velocity_until_closest_mps(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="do not match"):
        relative_motion(np.zeros((2, 2)), np.zeros((2, 2)), STILL, STILL)
    with pytest.raises(ValueError, match="do not match"):
        heights_to_pass(tracks, relative_motion(more, more, STILL, STILL), tracks.grounded)
    with pytest.raises(ValueError, match="do not match"):
        outcomes(paths, tracks, 1000, np.zeros(2), (0.0, 0.0), 0.0, aside=0.0, unresolved=0.0)
    with pytest.raises(ValueError, match="do not match"):
        add_nothing(np.zeros(2), Commands.of([random_guidance(rng)]))
    with pytest.raises(ValueError, match="do not match"):
        add_nothing(np.zeros(1), replace(Commands.of([random_guidance(rng)]), height_of=np.array([1])))
    with pytest.raises(ValueError, match="do not match"):
        kernels.half_angles(np.zeros(3), np.zeros(2))
    with pytest.raises(ValueError, match="do not match"):
        kernels.repulsion(np.zeros((3, 2)), np.zeros(2))
    for of, turns, sinks, shares in ((len(tracks), 1, 1, 1), (0, 2, 1, 1), (0, 1, 2, 1), (0, 1, 1, 2)):
        some = IntruderManeuvers(np.array([of]), np.zeros(turns), np.zeros(sinks), np.zeros(shares))
        with pytest.raises(ValueError, match="do not match"):
            losses(paths, tracks, some, CostWeights(), 0.8, horizon_s=90.0, soon_s=40.0)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("position_m", np.zeros((2, 2))),
        ("velocity_mps", np.zeros((1, 3))),
        ("turn_radps", np.zeros(1)),
        ("protected_horizontal_m", np.zeros(3)),
        ("protected_vertical_m", np.zeros(1)),
        ("buffer_m", np.zeros(3)),
        ("grounded", np.zeros(1, dtype=bool)),
    ],
)
def test_tracks_are_not_made_from_arrays_that_do_not_match(name: str, wrong: Array) -> None:
    two_rows, two_of = np.zeros((2, 3)), np.ones(2)
    tracks = Tracks(("A", "B"), two_rows, two_rows, two_of, two_of, two_of > 1.0, two_of, two_of)
    with pytest.raises(ValueError, match="do not match"):
        replace(tracks, **{name: wrong})


def add_nothing(cost: Array, commands: Commands) -> None:
    of_outcome = np.zeros(len(commands.course_rad))
    kernels.add_efforts(
        cost,
        commands,
        CostWeights(),
        of_outcome,
        0.0,
        20.0,
        300.0,
        0.0,
        WrongWays(),
        False,
        None,
        0.1,
        5.0,
        2.0,
    )
