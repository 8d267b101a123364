"""Encounters of every kind, variants of the avoidance to fly them with, and frames to observe them in."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from companion.avoidance import AvoidanceParams, Envelope
from companion.avoidance.cost import CostContext
from companion.avoidance.intruders import Tracks
from companion.avoidance.params import CostWeights, Layers, OuterMethod
from companion.avoidance.senses import WrongWays
from companion.avoidance.trajectory import ALL_CONTROLS, HORIZON_S, Control, OwnState, Pace
from companion.geodesy import wrap_pi
from companion.model import Goal, Guidance, Ownship, Track, Vec3

ENVELOPE = Envelope(min_altitude_m=100.0, max_altitude_m=600.0)
PARAMS = AvoidanceParams(envelope=ENVELOPE)
TIMES_S = np.concatenate([np.arange(0.0, 12.0), np.arange(12.0, 60.0, 2.0), np.arange(60.0, 91.0, 3.0)])
MISSION = Guidance(math.radians(10.0), 22.0, 320.0)

LAYER_VARIANTS = [
    replace(PARAMS, outer_method=method, layers=layers) for method in OuterMethod for layers in Layers
]
CONTROL_VARIANTS = [
    replace(PARAMS, layers=layers, controls=frozenset({control}))
    for layers in (Layers.BOTH, Layers.INNER)
    for control in Control
]
SPHERE_VARIANTS = [replace(PARAMS, weights=replace(PARAMS.weights, nearness=10.0))]
ALL_VARIANTS = [*LAYER_VARIANTS, *CONTROL_VARIANTS, *SPHERE_VARIANTS]


def variant_name(params: AvoidanceParams) -> str:
    """The name of a variant as a test id."""
    controls = "+".join(sorted(params.controls)) if params.controls != ALL_CONTROLS else "all"
    return f"{params.outer_method}-{params.layers}-{controls}-{params.weights.nearness:.0f}"


def make_context(**changes: object) -> CostContext:
    """A context in wind, on a course a little right of the mission's, with these changes."""
    usual = CostContext(
        own=OwnState((0.0, 0.0, -300.0), math.radians(20.0), 21.0, 0.5, (2.0, -3.0)),
        mission=MISSION,
        over_m=410.0,
        under_m=190.0,
        wrong=WrongWays(left=True, up=True),
        horizon_s=HORIZON_S,
        goal_distance=1.0,
        breach_ratio=1.0 / 1.15,
        envelope=ENVELOPE,
        weights=CostWeights(),
        rule_course_rad=math.radians(130.0),
        rule_pace=Pace.SLOWEST,
    )
    return usual._replace(**changes)  # type: ignore[arg-type]


def random_tracks(chance: np.random.Generator, count: int, buffer_m: float = 0.0) -> Tracks:
    """Tracks around the origin, about a third of them obstacles."""
    return Tracks(
        tuple(f"T{i}" for i in range(count)),
        np.column_stack([chance.uniform(-1500.0, 1500.0, (count, 2)), chance.uniform(-400.0, -200.0, count)]),
        np.column_stack([chance.uniform(-40.0, 40.0, (count, 2)), chance.uniform(-2.0, 2.0, count)]),
        chance.uniform(150.0, 700.0, count),
        chance.uniform(40.0, 90.0, count),
        chance.random(count) < 0.3,
        np.full(count, buffer_m),
        np.zeros(count),
    )


def one_track(position_m: Vec3, velocity_mps: Vec3, horizontal_m: float, vertical_m: float) -> Tracks:
    """A single aircraft that flies straight, with its protected volume."""
    return Tracks(
        ("T",),
        np.array([position_m]),
        np.array([velocity_mps]),
        np.array([horizontal_m]),
        np.array([vertical_m]),
        np.zeros(1, dtype=bool),
        np.zeros(1),
        np.zeros(1),
    )


places = st.tuples(st.floats(-5000.0, 5000.0), st.floats(-5000.0, 5000.0))
velocities = st.tuples(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0))

Case = tuple[Ownship, list[Track], Goal]


def degrees(fraction: float) -> st.SearchStrategy[float]:
    """Angles of whole degrees plus a fraction, so that nothing lies exactly on an edge or opposite [rad]."""
    return st.integers(-179, 179).map(lambda whole: math.radians(whole + fraction))


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """An aircraft and threats that it will meet, or nearly meet, in general positions."""
    course, airspeed = draw(degrees(0.137)), draw(st.integers(18, 26)) + 0.3
    velocity = np.array([airspeed * math.cos(course), airspeed * math.sin(course), 0.0])
    own = Ownship(0.0, (11.0, -7.0, -300.0), (velocity[0], velocity[1], 0.0), airspeed, course, (0.0, 0.0))
    tracks = []
    for i in range(draw(st.integers(1, 3))):
        meet_s, miss_m = draw(st.integers(5, 50)), draw(st.integers(10, 300))
        speed, track_rad = draw(st.integers(0, 50)) * 1.01, draw(degrees(0.371 + 0.1 * i))
        aside_rad = draw(degrees(0.529 + 0.1 * i))
        other = np.array([speed * math.cos(track_rad), speed * math.sin(track_rad), 0.0])
        aside = miss_m * np.array([math.cos(aside_rad), math.sin(aside_rad), 0.05])
        north, east, down = np.array(own.position_m) + (velocity - other) * meet_s + aside
        tracks.append(
            Track(
                f"T{i}",
                0.0,
                (float(north), float(east), float(down)),
                (float(other[0]), float(other[1]), 0.0),
                protected_horizontal_m=draw(st.integers(60, 400)) + 0.7,
                protected_vertical_m=60.0,
            )
        )
    if draw(st.booleans()):
        to_rad, far_m = course + 0.2 * draw(degrees(0.211)), draw(st.integers(800, 6000)) + 0.9
        place = (11.0 + far_m * math.cos(to_rad), -7.0 + far_m * math.sin(to_rad), -310.0)
        return own, tracks, Goal(airspeed_mps=21.7, position_m=place, is_end=draw(st.booleans()))
    return (
        own,
        tracks,
        Goal(course_rad=course + 0.2 * draw(degrees(0.211)), airspeed_mps=21.7, altitude_m=310.0),
    )


@st.composite
def frames(draw: st.DrawFn) -> tuple[float, Vec3]:
    """A rotation about the vertical [rad], and a shift [m]."""
    return draw(degrees(0.713)), (
        draw(st.integers(-20_000, 20_000)) + 0.1,
        draw(st.integers(-20_000, 20_000)) + 0.1,
        0.0,
    )


def rotated(vector: Vec3, angle_rad: float, shift: Vec3 = (0.0, 0.0, 0.0)) -> Vec3:
    """The vector rotated clockwise from above, like a course, and shifted."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return (
        vector[0] * cos - vector[1] * sin + shift[0],
        vector[0] * sin + vector[1] * cos + shift[1],
        vector[2] + shift[2],
    )


def seen_from(case: Case, angle_rad: float, shift: Vec3) -> Case:
    """The case in a rotated and shifted frame."""
    own, tracks, goal = case
    course = None if goal.course_rad is None else wrap_pi(goal.course_rad + angle_rad)
    place = None if goal.position_m is None else rotated(goal.position_m, angle_rad, shift)
    return (
        replace(
            own,
            position_m=rotated(own.position_m, angle_rad, shift),
            velocity_mps=rotated(own.velocity_mps, angle_rad),
            heading_rad=wrap_pi(own.heading_rad + angle_rad),
        ),
        [
            replace(
                track,
                position_m=rotated(track.position_m, angle_rad, shift),
                velocity_mps=rotated(track.velocity_mps, angle_rad),
            )
            for track in tracks
        ],
        replace(goal, course_rad=course, position_m=place),
    )


def later(case: Case, seconds: float) -> Case:
    """The case after straight flight of ownship; tracks keep their time, and have to be extrapolated."""
    own, tracks, goal = case
    north, east, down = np.array(own.position_m) + seconds * np.array(own.velocity_mps)
    return replace(own, time_s=seconds, position_m=(float(north), float(east), float(down))), tracks, goal


def within_limits(guidance: Guidance, envelope: Envelope = ENVELOPE) -> bool:
    """Whether a guidance is a valid course, with speed and height within the limits."""
    assert envelope.min_altitude_m is not None
    assert envelope.max_altitude_m is not None
    return (
        0.0 <= guidance.course_rad < 2.0 * math.pi
        and envelope.min_airspeed_mps <= guidance.airspeed_mps <= envelope.max_airspeed_mps
        and envelope.min_altitude_m <= guidance.altitude_m <= envelope.max_altitude_m
    )
