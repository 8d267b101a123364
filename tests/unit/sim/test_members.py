"""Scenarios of a formation, the network between its members, and the score of a flight."""

import itertools
import math
from pathlib import Path

import pytest

from companion.engine import EngineParams
from companion.errors import ConfigError
from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import FrameSplitter
from sim.files import checked_from
from sim.members.engines import engine_config
from sim.members.network import Network, is_broadcast, is_of_vehicle
from sim.members.scenario import FormationScenario, NetworkPlan, formation_names, load_any, load_formation
from sim.members.score import FormationScore, Moment
from sim.members.world import build_worlds
from sim.scenario import FORMATION_FOLDER, load_scenario, scenario_names
from sim.world import flown_by
from tests.support.thorough import sample
from tests.support.two_members import TWO, two_members

START_S = 1_800_000_000.0
ONE, OTHER = TWO["formation"]
INTRUDER = {
    "member": "EAST", "icao": "A00001", "callsign": "A1", "meet_at_s": 30, "from_deg": 0, "speed_mps": 50
}  # fmt: skip


# --- files


def test_the_documented_scenarios_exist() -> None:
    documented = {"formation-crossing", "formation-intruder", "formation-5", "formation-10"}
    assert set(formation_names()) >= documented
    assert not documented & set(scenario_names()), "those are of one vehicle"


def smallest_distances_m(name: str) -> dict[tuple[str, str], float]:
    """The smallest distance of each pair without avoidance."""
    scenario = load_formation(name)
    flown = {
        own.member.name: flown_by(own.world.vehicle, scenario.duration_s / 2.0, 0.2)
        for own in build_worlds(scenario, START_S)
    }
    return {
        (one, other): min(
            math.dist(a.position_m, b.position_m) for a, b in zip(flown[one], flown[other], strict=True)
        )
        for one, other in itertools.combinations(flown, 2)
    }


THREE = ["formation-crossing", "formation-5", "formation-10"]


@pytest.mark.parametrize("name", sample(THREE[:2], THREE))
def test_without_avoidance_members_come_too_near(name: str) -> None:
    closest_m = smallest_distances_m(name)
    assert min(closest_m.values()) < 20.0
    if name != "formation-crossing":
        assert max(closest_m.values()) < 60.0, "all converge on one point"


def test_abreast_only_the_intruder_is_in_the_way() -> None:
    assert min(smallest_distances_m("formation-intruder").values()) > 145.0


@pytest.mark.parametrize(
    "name", sample([name for name in formation_names() if name != THREE[2]], formation_names())
)
def test_missions_are_completed_in_time_from_separated_starts(name: str) -> None:
    scenario = load_formation(name)
    worlds = build_worlds(scenario, START_S)
    starts = [own.world.vehicle.truth.position_m for own in worlds]
    assert min(math.dist(a, b) for a, b in itertools.combinations(starts, 2)) > 140.0
    for own in worlds:
        last = flown_by(own.world.vehicle, 0.65 * scenario.duration_s, 1.0)[-1]
        assert last.mission_completed, "with time left for avoiding"
    assert {own.member.autopilot for own in worlds} & {"px4", "px4-1.18"}
    assert any(own.member.autopilot == "ardupilot" for own in worlds)


def test_the_intruder_meets_its_member_and_is_the_same_for_all() -> None:
    scenario = load_formation("formation-intruder")
    worlds = build_worlds(scenario, START_S, clock_errors_s=[0.0, 1.5, -1.0])
    (conflict,) = scenario.intruders
    places = set()
    for own in worlds:
        vehicle, at_s = own.world.vehicle, own.world.start_s + conflict.meet_at_s
        vehicle.step(at_s)
        place_m, _ = own.world.intruders[0].state_at(at_s)
        places.add(tuple(round(x, 3) for x in place_m))
        if own.member.name == conflict.member:
            assert math.dist(vehicle.truth.position_m, place_m) < 5.0
    assert len(places) == 1, "at the same time since the start, whatever the clocks show"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"formation": [ONE]}, "formation: "),
        ({"formation": [ONE, {**OTHER, "name": "NORTH"}]}, "two members have the same name"),
        ({"formation": [ONE, {**OTHER, "system_id": 7}]}, "two members have the same system_id"),
        ({"formation": [ONE, {**OTHER, "name": "a b"}]}, "formation.1: Value error, name 'a b' must be"),
        ({"formation": [ONE, {**OTHER, "system_id": 0}]}, "formation.1.system_id: "),
        ({"formation": [ONE, {**OTHER, "autopilot": "pilot"}]}, "formation.1.autopilot: "),
        ({"formation": [ONE, {**OTHER, "colour": "red"}]}, "formation.1.colour: unknown key"),
        ({"mission": ONE["mission"]}, "mission: unknown key"),
        ({"network": {"loss": 2.0}}, "network.loss: "),
        ({"network": {"jitter_s": 1.0}}, "network.jitter_s: unknown key"),
        (
            {"intruders": [{**INTRUDER, "member": "WEST"}]},
            "intruders: A1: no member 'WEST'; there are: NORTH, EAST",
        ),
        ({"intruders": [{**INTRUDER, "meet_at_s": 900}]}, "A1 meets us after duration_s"),
        ({"intruders": [INTRUDER, INTRUDER]}, "two of them have the same icao"),
        ({"intruders": [{k: v for k, v in INTRUDER.items() if k != "member"}]}, "intruders.0.member: "),
    ],
)
def test_an_error_is_named(change: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        checked_from({**TWO, **change}, FormationScenario, "two.yaml")
    assert str(caught.value).startswith("two.yaml: ")
    assert message in str(caught.value)


def test_each_kind_is_read_as_what_it_is() -> None:
    assert isinstance(load_any("formation-5"), FormationScenario)
    assert isinstance(load_any(FORMATION_FOLDER / "formation-5.yaml"), FormationScenario)
    assert load_any("head-on") == load_scenario("head-on")
    with pytest.raises(ConfigError, match=r"no such scenario; there are: .*head-on.*formation-crossing"):
        load_any("nowhere")
    for name in ("formation-5", FORMATION_FOLDER / "formation-5.yaml"):
        with pytest.raises(ConfigError, match="a scenario of a formation, which only `companion-sim demo`"):
            load_scenario(name)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml: No such file"):
        load_any(tmp_path / "none.yaml")


def test_each_member_has_the_engine_of_its_own_autopilot() -> None:
    configs = [engine_config(member) for member in two_members().formation]
    assert [config.engine for config in configs] == [
        EngineParams(system_id=number, autopilot_system_id=number) for number in (7, 8)
    ]


# --- the network


def text(words: bytes) -> mavlink.MAVLink_statustext_message:
    return mavlink.MAVLink_statustext_message(severity=6, text=words)


def heard(network: Network, receiver: int, now_s: float) -> list[tuple[int, int]]:
    """System and sequence number of what arrived."""
    splitter = FrameSplitter()
    frames = [frame for raw in network.arrived(receiver, now_s) for frame in splitter.feed_datagram(raw)]
    return [(frame.system_id, frame.sequence) for frame in frames]


def test_a_frame_reaches_all_others_after_the_delay() -> None:
    network = Network(NetworkPlan(delay_s=0.3), 3)
    network.send(0, text(b"one"), (7, 196), 10.0)
    network.send(0, text(b"two"), (7, 196), 10.1)
    assert heard(network, 1, 10.29) == []
    assert heard(network, 1, 10.3) == [(7, 0)]
    assert heard(network, 1, 10.5) == [(7, 1)]
    assert heard(network, 2, 10.5) == [(7, 0), (7, 1)]
    assert heard(network, 0, 99.0) == [], "not its own"
    assert network.sent_bytes[0] == 2 * (12 + 4), "each frame once: header, checksum, text"


def test_losses_are_those_of_the_seed_and_differ_by_receiver() -> None:
    def lost(seed: int) -> list[list[int]]:
        network = Network(NetworkPlan(loss=0.3), 3, seed=seed)
        for _ in range(200):
            network.send(0, text(b"one"), (7, 196), 0.0)
        return [[number for _, number in heard(network, receiver, 0.0)] for receiver in (1, 2)]

    first, second = lost(1)
    assert lost(1) == [first, second]
    assert first != second
    assert lost(2)[0] != first
    assert 110 < len(first) < 170


def test_what_has_a_target_is_not_for_the_others() -> None:
    assert is_broadcast(text(b"all"))
    assert is_broadcast(mavlink.MAVLink_v2_extension_message(0, 0, 0, 0xCA91, [0] * 249))
    assert not is_broadcast(mavlink.MAVLink_param_request_list_message(7, 1))
    assert is_of_vehicle(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    assert not is_of_vehicle(mavlink.MAVLINK_MSG_ID_ATTITUDE)


# --- the score


def score_of(*tracks: list[Moment]) -> FormationScore:
    """A score of members A, B, ... with these moments."""
    score = FormationScore("ABC"[: len(tracks)])
    for name, track in zip("ABC", tracks, strict=False):
        for moment in track:
            score.add(name, moment)
    return score


def along(north_mps: float, *, period_s: float, east_m: float = 0.0, down_m: float = 0.0) -> list[Moment]:
    """Ten seconds straight on, north through the origin after five."""
    times = [n * period_s for n in range(round(10.0 / period_s) + 1)]
    return [Moment(t, (north_mps * (t - 5.0), east_m, down_m), under_way=True) for t in times]


def test_distances_are_taken_at_common_times() -> None:
    score = score_of(along(20.0, period_s=0.05), along(-20.0, period_s=0.31, east_m=40.0, down_m=-10.0))
    (pair,) = score.pairs.values()
    assert pair.min_horizontal_m == pytest.approx(40.0, abs=0.01)
    assert pair.vertical_m == pytest.approx(10.0)
    assert pair.min_slant_m == pytest.approx(math.hypot(40.0, 10.0), abs=0.01)
    assert pair.min_slant_at_s == pytest.approx(5.0, abs=0.06)
    assert pair.separation_lost
    assert pair.report()["members"] == ["A", "B"]


@pytest.mark.parametrize(("east_m", "down_m"), [(51.0, 0.0), (0.0, 31.0)])
def test_separation_in_one_of_both_is_enough(east_m: float, down_m: float) -> None:
    score = score_of(along(20.0, period_s=0.1), along(-20.0, period_s=0.1, east_m=east_m, down_m=down_m))
    assert not score.separation_lost


def test_the_safety_value_is_the_mean_of_all_pairs_each_second() -> None:
    score = score_of(*(along(20.0, period_s=0.1, east_m=east_m) for east_m in (0.0, 100.0, 300.0)))
    assert score.safety.values_m == pytest.approx([200.0] * len(score.safety.values_m))
    assert len(score.safety.values_m) == 11
    assert score.closest_of("C").members == ("B", "C")


def test_a_member_at_its_goal_is_not_judged_any_more() -> None:
    arrived = [
        Moment(each.elapsed_s, each.position_m, under_way=each.elapsed_s < 3.0)
        for each in along(-20.0, period_s=0.1)
    ]
    score = score_of(along(20.0, period_s=0.1), arrived)
    assert not score.separation_lost
    assert len(score.safety.values_m) == 3
