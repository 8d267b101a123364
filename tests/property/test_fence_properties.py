"""The geometry of fences against other computations, in any frame, for simple polygons of any shape."""

import math

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.avoidance import Envelope, Fence, Zone
from companion.avoidance.trajectory import Array, Commands, OwnState, fly_ahead, times_until
from companion.model import Guidance, Vec2

# Single precision over some kilometres.
ROUNDING_M = 2e-3

places = st.tuples(st.floats(-1500.0, 1500.0), st.floats(-1500.0, 1500.0))


@st.composite
def polygons(draw: st.DrawFn) -> tuple[Vec2, ...]:
    """Simple polygons, mostly concave: a star around some place, of either orientation."""
    centre = draw(places)
    radii = draw(st.lists(st.floats(50.0, 1000.0), min_size=3, max_size=9))
    angles = np.linspace(0.0, 2.0 * math.pi, len(radii), endpoint=False) + draw(st.floats(0.0, 1.0))
    star = [
        (centre[0] + r * math.cos(a), centre[1] + r * math.sin(a)) for r, a in zip(radii, angles, strict=True)
    ]
    return tuple(star if draw(st.booleans()) else reversed(star))


def winding(place: Vec2, vertices: tuple[Vec2, ...]) -> int:
    """The winding number of the polygon around the place: the sum of the angles of its edges."""
    total = 0.0
    for (an, ae), (bn, be) in zip(vertices, (*vertices[1:], vertices[0]), strict=True):
        one, other = complex(an - place[0], ae - place[1]), complex(bn - place[0], be - place[1])
        total += math.atan2((other * one.conjugate()).imag, (other * one.conjugate()).real)
    return round(total / (2.0 * math.pi))


def to_edge_m(place: Vec2, start: Vec2, end: Vec2) -> float:
    """Distance to the nearest point of an edge, by golden section."""

    def off_m(share: float) -> float:
        return math.dist(place, [s + share * (e - s) for s, e in zip(start, end, strict=True)])

    low, high = 0.0, 1.0
    for _ in range(70):
        a, b = low + 0.382 * (high - low), low + 0.618 * (high - low)
        low, high = (low, b) if off_m(a) < off_m(b) else (a, high)
    return off_m(low)


def to_edges_m(place: Vec2, vertices: tuple[Vec2, ...]) -> float:
    edges = zip(vertices, (*vertices[1:], vertices[0]), strict=True)
    return min(to_edge_m(place, start, end) for start, end in edges)


def inside_m(zone: Zone, place: Vec2) -> float:
    return float(zone.inside_m(np.array(place)))


@settings(deadline=None, derandomize=True, max_examples=200)
@given(polygons(), places)
def test_a_place_is_inside_if_the_winding_number_is_not_zero(vertices: tuple[Vec2, ...], place: Vec2) -> None:
    inside = inside_m(Zone(True, vertices), place)
    away_m = to_edges_m(place, vertices)
    assert math.isclose(abs(inside), away_m, abs_tol=ROUNDING_M)
    assume(away_m > ROUNDING_M)
    assert (inside > 0.0) is (winding(place, vertices) != 0)


@settings(deadline=None, derandomize=True)
@given(
    polygons(), places, st.floats(-math.pi, math.pi), st.tuples(st.floats(-2e4, 2e4), st.floats(-2e4, 2e4))
)
def test_a_rotated_and_shifted_frame_does_not_change_the_distance(
    vertices: tuple[Vec2, ...], place: Vec2, angle_rad: float, shift: Vec2
) -> None:
    def seen(at: Vec2) -> Vec2:
        cos, sin = math.cos(angle_rad), math.sin(angle_rad)
        return at[0] * cos - at[1] * sin + shift[0], at[0] * sin + at[1] * cos + shift[1]

    first = inside_m(Zone(True, vertices), place)
    second = inside_m(Zone(True, tuple(seen(vertex) for vertex in vertices)), seen(place))
    assume(abs(first) > ROUNDING_M)
    assert math.isclose(first, second, abs_tol=ROUNDING_M)


@settings(deadline=None, derandomize=True)
@given(polygons(), st.integers(0, 20), places)
def test_which_vertex_comes_first_means_nothing(vertices: tuple[Vec2, ...], first: int, place: Vec2) -> None:
    rolled = (*vertices[first % len(vertices) :], *vertices[: first % len(vertices)])
    one, other = inside_m(Zone(True, vertices), place), inside_m(Zone(True, rolled), place)
    assert math.isclose(one, other, abs_tol=ROUNDING_M)


@settings(deadline=None, derandomize=True)
@given(polygons(), places, places)
def test_a_depth_changes_no_faster_than_the_place(vertices: tuple[Vec2, ...], one: Vec2, other: Vec2) -> None:
    zone = Zone(True, vertices)
    assert abs(inside_m(zone, one) - inside_m(zone, other)) <= math.dist(one, other) + ROUNDING_M


zones = st.builds(
    lambda inclusion, vertices, circle, radius, low, high: Zone(
        inclusion,
        () if circle else vertices,
        vertices[0] if circle else None,
        radius if circle else None,
        low,
        high,
    ),
    st.booleans(),
    polygons(),
    st.booleans(),
    st.floats(10.0, 1500.0),
    st.none() | st.floats(0.0, 200.0),
    st.none() | st.floats(250.0, 600.0),
)


def is_kept(zone: Zone, place: Array) -> bool:
    """Whether a place is allowed by a zone without margin."""
    within = inside_m(zone, (place[0], place[1])) >= 0.0 and bool(zone.between_m(-place[2:])[0] >= 0.0)
    return within if zone.inclusion else not within


@settings(deadline=None, derandomize=True, max_examples=200)
@given(st.lists(zones, max_size=4), places, st.floats(0.0, 700.0), st.booleans())
def test_zones_count_together_as_documented(
    some: list[Zone], place: Vec2, altitude_m: float, any_inclusion: bool
) -> None:
    at = np.array([*place, -altitude_m])
    fence = Fence(tuple(some), 0.0, 0.0, any_inclusion)
    inclusions = [is_kept(zone, at) for zone in some if zone.inclusion]
    one_is_enough = any_inclusion and bool(inclusions)
    kept = any(inclusions) if one_is_enough else all(inclusions)
    kept = kept and all(is_kept(zone, at) for zone in some if not zone.inclusion)
    depth_m = float(fence.depth_m(at[None])[0])
    assume(depth_m == 0.0 or depth_m > 1e-6)
    limits_m = [limit for zone in some for limit in (zone.min_altitude_m, zone.max_altitude_m)]
    assume(all(limit_m is None or abs(altitude_m - limit_m) > 1e-6 for limit_m in limits_m))
    # Exactly on the edge both results are right.
    assume(all(abs(inside_m(zone, place)) > 1e-6 for zone in some))
    assert (depth_m == 0.0) is kept


@settings(deadline=None, derandomize=True)
@given(st.lists(zones, min_size=1, max_size=4), places, st.floats(0.0, 700.0), st.floats(1.0, 80.0))
def test_a_wider_margin_is_at_least_as_strict(
    some: list[Zone], place: Vec2, altitude_m: float, margin_m: float
) -> None:
    at = np.array([[*place, -altitude_m]])
    bare, wide = Fence(tuple(some), 0.0, 0.0), Fence(tuple(some), margin_m, margin_m)
    assert wide.depth_m(at)[0] >= bare.depth_m(at)[0]


@settings(deadline=None, derandomize=True, max_examples=60)
@given(
    st.lists(zones, min_size=1, max_size=4),
    st.floats(-math.pi, math.pi),
    st.booleans(),
    st.tuples(st.floats(-12.0, 12.0), st.floats(-12.0, 12.0)),
)
def test_no_zone_that_a_row_enters_is_left_out(
    some: list[Zone], course_rad: float, any_inclusion: bool, wind: Vec2
) -> None:
    """Zones too far away are skipped; the depth of each row is that of its places one by one."""
    own = OwnState(np.array([30.0, -20.0, -300.0]), course_rad, 22.0, 0.0, np.array(wind))
    ways = [
        Guidance(course_rad + turn, 22.0, height)
        for turn in (-2.0, -0.3, 0.0, 1.1)
        for height in (200.0, 350.0)
    ]
    paths = fly_ahead(own, Commands.of(ways), Envelope())
    fence = Fence(tuple(some), any_inclusion=any_inclusion)
    breach = fence.breach(paths, 16.0, 60.0)
    times_s = times_until(60.0)
    for row in range(len(ways)):
        depth_m = fence.depth_m(paths.row_m(row)[: len(times_s)])
        assert breach.deepest_m[row] >= depth_m[times_s <= 16.0].max() - 0.05
        assert (breach.deepest_m[row] > 0.0) <= (breach.first_s[row] <= 18.0)
        if depth_m.max() > 150.0:
            assert math.isfinite(breach.first_s[row])
