"""The peers: each follows its published description, within the limits."""

import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import ModuleType

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.errors import ConfigError
from companion.geodesy import wrap_pi
from companion.model import Decision, Goal, Guidance, Layer, Ownship, Track, TrafficKind, Vec3
from sim.dynamics import Airframe, FixedWing
from sim.peers import PEERS, Peer, PeerLimits, make_peer
from sim.peers.ardupilot import ArduPilot, ArduPilotParams, perpendicular
from sim.peers.mvp import Mvp, MvpParams, velocity_change_mps
from sim.peers.peer import Relative, mission_of, relatives

LIMITS = PeerLimits(
    min_airspeed_mps=20.0,
    max_airspeed_mps=30.0,
    max_bank_rad=math.radians(30.0),
    max_climb_mps=2.54,
    max_sink_mps=2.54,
    floor_m=50.0,
    ceiling_m=250.0,
)
FRAME = Airframe(
    bank_limit_rad=LIMITS.max_bank_rad,
    airspeed_min_mps=LIMITS.min_airspeed_mps,
    airspeed_max_mps=LIMITS.max_airspeed_mps,
    climb_limit_mps=LIMITS.max_climb_mps,
    sink_limit_mps=LIMITS.max_sink_mps,
)
NMAC_M = (152.4, 30.48)
NORTH = Goal(course_rad=0.0, airspeed_mps=25.0, altitude_m=150.0)
STEP_S = 0.05
MEETING_S = 80.0  # time of the collision without avoidance
AVOIDING = ["ardupilot", "mvp", "orca"]


def peer_of(name: str, limits: PeerLimits = LIMITS) -> Peer:
    """The peer; the test is skipped without its optional library."""
    if name == "orca":
        pytest.importorskip("pyrvo")
    return make_peer(name, limits)


def own(position_m: Vec3 = (0.0, 0.0, -150.0), velocity_mps: Vec3 = (25.0, 0.0, 0.0)) -> Ownship:
    return Ownship(0.0, position_m, velocity_mps, 25.0, math.atan2(velocity_mps[1], velocity_mps[0]))


def track(position_m: Vec3, velocity_mps: Vec3, name: str = "A") -> Track:
    return Track(name, 0.0, position_m, velocity_mps)


def meeting(course_deg: float, speed_mps: float, above_m: float = 0.0, aside_m: float = 0.0) -> Track:
    """An aircraft that meets us (north at 25 m/s, at 150 m) in `MEETING_S`, with this miss."""
    course_rad = math.radians(course_deg)
    velocity = speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), 0.0
    place = 25.0 * MEETING_S - velocity[0] * MEETING_S, aside_m - velocity[1] * MEETING_S, -150.0 - above_m
    return track(place, velocity)


@dataclass
class FlightResult:
    """The result of a flight: the closest approach relative to an NMAC (below 1: NMAC), and the decisions."""

    nearest: float
    decisions: list[Decision]
    furthest_aside_m: float
    end: FixedWing

    @property
    def guidance(self) -> list[Guidance]:
        return [decision.guidance for decision in self.decisions if decision.guidance is not None]


def fly(peer: Peer, tracks: Sequence[Track], seconds: float = 200.0) -> FlightResult:
    """A closed loop at 1 Hz on perfect reports; the mission is a course, an airspeed and a height."""
    wing = FixedWing((0.0, 0.0, -150.0), 0.0, 25.0, airframe=FRAME)
    flown = FlightResult(math.inf, [], 0.0, wing)
    for step in range(round(seconds / STEP_S)):
        now_s = step * STEP_S
        there = [
            replace(
                t,
                time_s=now_s,
                position_m=tuple(p + v * now_s for p, v in zip(t.position_m, t.velocity_mps, strict=True)),
            )
            for t in tracks
        ]
        if step % round(1.0 / STEP_S) == 0:
            me = Ownship(now_s, wing.position_m, wing.velocity_mps, wing.airspeed_mps, wing.heading_rad)
            flown.decisions.append(peer.decide(now_s, me, there, NORTH))
            wanted = flown.decisions[-1].guidance or Guidance(0.0, 25.0, 150.0)
            wing.hold_course(wanted.course_rad)
            wing.hold_airspeed(wanted.airspeed_mps)
            wing.hold_altitude(wanted.altitude_m)
        wing.step(STEP_S)
        for t in there:
            north, east, down = (a - b for a, b in zip(wing.position_m, t.position_m, strict=True))
            flown.nearest = min(
                flown.nearest, max(math.hypot(north, east) / NMAC_M[0], abs(down) / NMAC_M[1])
            )
        flown.furthest_aside_m = max(flown.furthest_aside_m, abs(wing.east_m))
    return flown


ENCOUNTERS = {
    "head-on": [meeting(180.0, 40.0)],
    "head-on, slightly aside": [meeting(180.0, 40.0, aside_m=40.0)],
    "crossing from the right": [meeting(270.0, 40.0)],
    "crossing from the left": [meeting(90.0, 40.0)],
    "converging": [meeting(225.0, 50.0, above_m=10.0)],
    "overtaking us": [meeting(10.0, 50.0)],
    "two at once": [meeting(270.0, 40.0), replace(meeting(180.0, 40.0), track_id="B")],
}


@pytest.mark.parametrize("encounter", ENCOUNTERS)
@pytest.mark.parametrize("name", AVOIDING)
def test_every_peer_avoids_the_collision_and_resumes_the_mission(name: str, encounter: str) -> None:
    assert fly(make_peer("none", LIMITS), ENCOUNTERS[encounter]).nearest < 1.0
    flown = fly(peer_of(name), ENCOUNTERS[encounter], seconds=300.0)
    assert flown.nearest >= 1.0
    assert flown.guidance
    assert flown.decisions[-1].guidance is None
    assert wrap_pi(flown.end.course_rad) == pytest.approx(0.0, abs=0.02)
    assert flown.end.altitude_m == pytest.approx(150.0, abs=1.0)


@pytest.mark.parametrize("encounter", ENCOUNTERS)
@pytest.mark.parametrize("name", AVOIDING)
def test_commands_keep_the_limits(name: str, encounter: str) -> None:
    limits = replace(LIMITS, floor_m=140.0, ceiling_m=160.0)
    for guidance in fly(peer_of(name, limits), ENCOUNTERS[encounter]).guidance:
        assert 20.0 <= guidance.airspeed_mps <= 30.0
        assert 140.0 <= guidance.altitude_m <= 160.0
        assert 0.0 <= guidance.course_rad < math.tau


@pytest.mark.parametrize("name", AVOIDING)
@given(
    place=st.tuples(*(st.floats(-3000.0, 3000.0) for _ in range(3))),
    velocity=st.tuples(*(st.floats(-80.0, 80.0) for _ in range(3))),
    own_velocity=st.tuples(*(st.floats(-40.0, 40.0) for _ in range(3))),
    wind=st.none() | st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0)),
)
@settings(derandomize=True, deadline=None, max_examples=200)
def test_every_input_gives_a_finite_answer_within_the_limits(
    name: str, place: Vec3, velocity: Vec3, own_velocity: Vec3, wind: tuple[float, float] | None
) -> None:
    me = replace(own(velocity_mps=own_velocity), wind_mps=wind)
    guidance = peer_of(name).decide(0.0, me, [track(place, velocity)], NORTH).guidance
    if guidance is not None:
        assert 0.0 <= guidance.course_rad < math.tau
        assert 20.0 <= guidance.airspeed_mps <= 30.0
        assert 50.0 <= guidance.altitude_m <= 250.0


@pytest.mark.parametrize("name", AVOIDING)
@pytest.mark.parametrize(
    "harmless",
    [
        [],
        [track((-3000.0, 0.0, -150.0), (-25.0, 0.0, 0.0))],
        [meeting(180.0, 40.0, above_m=400.0)],
        [replace(meeting(180.0, 40.0), kind=TrafficKind.SURFACE_VEHICLE)],
        [track((math.nan, 0.0, 0.0), (0.0, 0.0, 0.0))],
    ],
    ids=["no traffic", "flying away", "high above", "on the ground", "not a number"],
)
def test_harmless_traffic_is_not_avoided(name: str, harmless: list[Track]) -> None:
    decision = peer_of(name).decide(0.0, own(), harmless, NORTH)
    assert (decision.layer, decision.guidance) == (Layer.CLEAR, None)


@pytest.mark.parametrize("name", AVOIDING)
def test_the_threat_is_named_and_a_reset_clears_it(name: str) -> None:
    peer = peer_of(name)
    decision = peer.decide(0.0, own(), [track((900.0, 0.0, -150.0), (-40.0, 0.0, 0.0))], NORTH)
    assert decision.layer is Layer.OUTER
    (threat,) = decision.threats
    assert (threat.track_id, threat.distance_m, threat.closing_mps) == ("A", 900.0, 65.0)
    assert threat.time_to_closest_s == pytest.approx(900.0 / 65.0)
    peer.reset()
    assert peer.decide(0.1, own(), [], NORTH).guidance is None


def test_the_unmitigated_flight_never_avoids() -> None:
    flown = fly(make_peer("none", LIMITS), [meeting(180.0, 40.0)])
    assert not flown.guidance
    assert flown.furthest_aside_m < 1.0
    assert flown.nearest < 0.1


# ArduPilot


def seen(position_m: Vec3, velocity_mps: Vec3) -> Relative:
    (relative,) = relatives(0.0, own(), [track(position_m, velocity_mps)])
    return relative


@pytest.mark.parametrize(
    ("position_m", "velocity_mps", "expected"),
    [
        # We are 100 m west of the line of a southbound intruder, and level with it: west, and down.
        ((500.0, 100.0, -150.0), (-40.0, 0.0, 0.0), (0.0, -100.0, -1e-6)),
        # A north-eastbound intruder 100 m south of us: its line passes 100 m / sqrt(2) from us.
        ((-100.0, 0.0, -130.0), (30.0, 30.0, 0.0), (50.0, -50.0, 20.0)),
        # On the line itself, head-on: to the right of our course.
        ((500.0, 0.0, -150.0), (-40.0, 0.0, 0.0), (0.0, 1.0, -1e-6)),
        # A hovering intruder: straight away.
        ((300.0, -400.0, -160.0), (0.0, 0.0, 0.0), (-300.0, 400.0, -10.0)),
        # An intruder 100 m ahead that climbs 1 in 1: (50, -50) is perpendicular to its path.
        ((100.0, 0.0, -150.0), (-30.0, 0.0, -30.0), (-50.0, 0.0, -50.0)),
    ],
)
def test_ardupilot_flies_perpendicular_to_the_intruders_path(
    position_m: Vec3, velocity_mps: Vec3, expected: Vec3
) -> None:
    away = perpendicular(seen(position_m, velocity_mps), own())
    assert away == pytest.approx(expected)
    if math.hypot(*velocity_mps) > 1.0 and abs(away[2]) > 1e-3:
        up = (velocity_mps[0], velocity_mps[1], -velocity_mps[2])
        assert math.fsum(a * v for a, v in zip(away, up, strict=True)) == pytest.approx(0.0, abs=1e-9)


def test_ardupilot_turns_across_and_climbs_or_sinks_at_full_rate() -> None:
    intruder = track((800.0, 100.0, -140.0), (-40.0, 0.0, 0.0))
    guidance = ArduPilot(LIMITS).decide(0.0, own(), [intruder], NORTH).guidance
    assert guidance == Guidance(pytest.approx(1.5 * math.pi), 25.0, 160.0)


@pytest.mark.parametrize(
    ("params", "aside_m", "above_m", "range_m", "threat"),
    [
        (ArduPilotParams(), 299.0, 0.0, 1900.0, True),
        (ArduPilotParams(), 301.0, 0.0, 1900.0, False),
        (ArduPilotParams(), 0.0, 99.0, 1900.0, True),
        (ArduPilotParams(), 0.0, 101.0, 1900.0, False),
        (ArduPilotParams(), 0.0, 0.0, 65.0 * 30.0 + 299.0, True),  # enters within the 30 s
        (ArduPilotParams(), 0.0, 0.0, 65.0 * 30.0 + 301.0, False),
        (ArduPilotParams.well_clear(), 609.0, 76.0, 1900.0, True),
        (ArduPilotParams.well_clear(), 609.0, 77.0, 1900.0, False),
        (ArduPilotParams.well_clear(), 610.0, 76.0, 1900.0, False),
    ],
)
def test_ardupilots_threat_is_near_in_both_ways_within_the_horizon(
    params: ArduPilotParams, aside_m: float, above_m: float, range_m: float, threat: bool
) -> None:
    intruder = track((range_m, aside_m, -150.0 - above_m), (-40.0, 0.0, 0.0))
    decision = ArduPilot(LIMITS, params).decide(0.0, own(), [intruder], NORTH)
    assert (decision.guidance is not None) is threat


def test_ardupilot_avoids_the_most_imminent_and_recovers_after_two_seconds() -> None:
    peer = ArduPilot(LIMITS)
    far = track((1500.0, 50.0, -150.0), (-40.0, 0.0, 0.0), "far")
    soon = track((700.0, -50.0, -150.0), (-40.0, 0.0, 0.0), "soon")
    decision = peer.decide(0.0, own(), [far, soon], NORTH)
    assert [threat.track_id for threat in decision.threats] == ["soon", "far"]
    assert decision.guidance is not None
    assert decision.guidance.course_rad == pytest.approx(math.pi / 2.0)
    assert peer.decide(1.0, own(), [], NORTH).guidance == decision.guidance
    assert peer.decide(2.0, own(), [], NORTH).guidance is None


def test_ardupilot_ignores_old_tracks() -> None:
    intruder = replace(track((800.0, 100.0, -140.0), (-40.0, 0.0, 0.0)), age_s=6.0)
    assert ArduPilot(LIMITS).decide(0.0, own(), [intruder], NORTH).guidance is None


# MVP


def test_mvp_moves_the_closest_approach_to_the_rim_of_the_zone() -> None:
    # 3000 m ahead and 300 m to the east, closing at 60 m/s: closest in 50 s, 300 m to the east, 20 m above.
    change = velocity_change_mps(
        seen((3000.0, 300.0, -170.0), (-35.0, 0.0, 0.0)), MvpParams(600.0, 70.0, resolution_factor=1.0), 0.0
    )
    d = math.sqrt(3000.0**2 + 300.0**2)
    factor = 1.0 / abs(math.cos(math.asin(600.0 / d) - math.asin(300.0 / d)))
    assert factor == pytest.approx(1.00509, abs=1e-5)
    assert change == pytest.approx((0.0, -(600.0 - 300.0) / 50.0 * factor, (70.0 - 20.0) / 50.0))


def test_mvps_new_relative_track_touches_the_zone() -> None:
    # The published cosine is a first-order correction: the miss is the radius within one per cent.
    relative = seen((3000.0, 300.0, -150.0), (-35.0, 0.0, 0.0))
    north, east, _ = velocity_change_mps(relative, MvpParams(), 0.0)
    v_north, v_east, v_down = relative.velocity_mps
    after = replace(relative, velocity_mps=(v_north - north, v_east - east, v_down))
    assert after.as_threat().miss_horizontal_m == pytest.approx(1.05 * 609.6, rel=0.01)


def test_mvp_adds_up_the_changes_of_all_intruders_in_height_and_sideways() -> None:
    first = track((2400.0, 400.0, -160.0), (-35.0, 0.0, 0.0), "A")
    second = track((1800.0, -300.0, -145.0), (-35.0, 0.0, 0.0), "B")
    params = MvpParams()
    one, two = (velocity_change_mps(r, params, 0.0) for r in relatives(0.0, own(), [first, second]))
    guidance = Mvp(LIMITS, params).decide(0.0, own(), [first, second], NORTH).guidance
    assert guidance is not None
    east_mps, climb_mps = one[1] + two[1], -(one[2] + two[2])
    assert guidance.course_rad == pytest.approx(math.atan2(east_mps, 25.0) % math.tau)
    assert guidance.airspeed_mps == pytest.approx(math.hypot(25.0, east_mps))
    assert guidance.altitude_m == pytest.approx(150.0 + climb_mps * 30.0)


def test_mvp_goes_to_the_right_head_on_and_holds_until_past() -> None:
    flown = fly(Mvp(LIMITS), [meeting(180.0, 40.0)])
    assert 0.0 < flown.guidance[0].course_rad < math.pi / 2.0
    guided = [decision.guidance is not None for decision in flown.decisions]
    assert guided.index(True) == pytest.approx(MEETING_S - 60.0 - 609.6 / 65.0, abs=1.0)
    assert sum(a != b for a, b in pairwise(guided)) == 2, "one avoidance without interruption"
    assert flown.nearest > 0.95 * 609.6 / NMAC_M[0]


def test_mvps_look_ahead_is_a_parameter() -> None:
    intruder = track((609.6 + 60.0 * 30.5, 0.0, -150.0), (-35.0, 0.0, 0.0))  # in the zone in 30.5 s
    assert Mvp(LIMITS, MvpParams(look_ahead_s=30.0)).decide(0.0, own(), [intruder], NORTH).guidance is None
    assert (
        Mvp(LIMITS, MvpParams(look_ahead_s=31.0)).decide(0.0, own(), [intruder], NORTH).guidance is not None
    )


# ORCA


def test_orca_takes_its_half_of_the_change_and_keeps_the_missions_height() -> None:
    # Head-on at 1500 m, closing at 50 m/s: the relative track must turn by asin(1.05 * 609.6 / 1500).
    intruder = track((1500.0, 0.0, -150.0), (-25.0, 0.0, 0.0))
    guidance = peer_of("orca").decide(0.0, own(), [intruder], NORTH).guidance
    assert guidance is not None
    # Its half-plane lies half the whole change u away from our velocity, |u| = 50 sin(angle).
    angle_rad = math.asin(1.05 * 609.6 / 1500.0)
    half_mps = 0.5 * 50.0 * math.sin(angle_rad)
    away = half_mps * math.cos(angle_rad), half_mps * math.sin(angle_rad)
    assert abs(wrap_pi(guidance.course_rad)) == pytest.approx(math.atan2(away[0], 25.0 - away[1]), abs=1e-3)
    assert guidance.airspeed_mps == pytest.approx(math.hypot(away[0], 25.0 - away[1]), abs=1e-2)
    assert guidance.altitude_m == 150.0


def test_orca_accounts_for_the_wind() -> None:
    ahead = 1500.0, 100.0, -150.0
    calm, windy = own(), replace(own(velocity_mps=(25.0, 8.0, 0.0)), wind_mps=(0.0, 8.0))
    goal = replace(NORTH, course_rad=math.atan2(8.0, 25.0))
    still = peer_of("orca").decide(0.0, calm, [track(ahead, (-20.0, 0.0, 0.0))], NORTH).guidance
    blown = track(ahead, (-20.0, 8.0, 0.0))
    carried = peer_of("orca").decide(0.0, windy, [blown], goal).guidance
    assert still is not None
    assert carried is not None
    assert carried.airspeed_mps == pytest.approx(still.airspeed_mps, abs=1e-3)
    north_mps = still.airspeed_mps * math.cos(still.course_rad)
    east_mps = still.airspeed_mps * math.sin(still.course_rad) + 8.0
    assert wrap_pi(carried.course_rad) == pytest.approx(math.atan2(east_mps, north_mps), abs=1e-3)


def test_without_its_library_orca_reports_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> ModuleType:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(ConfigError) as caught:
        make_peer("orca", LIMITS)
    assert str(caught.value).startswith("orca needs the pyrvo package: make orca")


# All of them


def test_an_unknown_peer_is_refused_in_one_line_with_the_known_ones() -> None:
    with pytest.raises(ConfigError) as caught:
        make_peer("tcas", LIMITS)
    assert str(caught.value) == (
        "avoider 'tcas' is not known: there are companion, none, ardupilot, ardupilot-610, mvp, orca"
    )
    assert list(PEERS) == ["none", "ardupilot", "ardupilot-610", "mvp", "orca"]


def test_a_goal_with_a_position_gives_course_and_height() -> None:
    assert mission_of(0.0, own(), Goal(position_m=(0.0, 100.0, -80.0))) == Guidance(math.pi / 2.0, 25.0, 80.0)
    assert mission_of(0.0, own(), Goal()) == Guidance(0.0, 25.0, 150.0)
