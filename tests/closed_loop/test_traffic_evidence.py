"""Traffic that is reported wrongly is avoided by what adds up: identity, category, velocity, age, echo."""

import math
import random
from dataclasses import replace

import pytest

from companion.mavlink.dialect import Message, mavlink
from companion.model import TrackState, Vec3
from sim.scenario import load_scenario
from tests.support.thorough import pairs, sample
from tests.support.traffic_cases import ReportedWrongly, Reports, altered, is_time_of, unheard

CLEAR_M = 90.0  # slant, by which a head-on aircraft is passed at least: well clear by height is enough


def assert_passed(loop: ReportedWrongly, engagements: int = 1) -> None:
    """The intruder is passed well, in one engagement, and the mission goes on."""
    flight = loop.run()
    assert not loop.encounter.lowc
    assert loop.encounter.min_slant_m > CLEAR_M
    assert flight.engagements == engagements
    assert flight.mission_completed


def texts(loop: ReportedWrongly) -> str:
    return "\n".join(loop.flight.texts)


# --- identity


def test_one_address_of_two_aircraft_is_two_tracks_and_the_operator_knows() -> None:
    def behind(loop: ReportedWrongly, time_s: float) -> Reports:
        if not is_time_of(1.0, time_s - 0.5):
            return []
        away_m = (-9000.0 - 30.0 * time_s, 2000.0, -884.0)
        return [loop.report(0xA00001, away_m, (-30.0, 0.0))]

    loop = ReportedWrongly(add=behind)
    assert_passed(loop)
    assert {track.track_id for _, tracks in loop.tracks for track in tracks} == {"A00001", "A00001/2"}
    assert "reported in two places" in texts(loop)


PLACES = [(2000.0, 0.5), (-3000.0, 0.2), (2500.0, 0.2)]


@pytest.mark.parametrize(("aside_m", "period_s"), sample(PLACES[1:2], PLACES))
def test_a_second_place_of_an_address_does_not_hide_the_first(aside_m: float, period_s: float) -> None:
    def aside(loop: ReportedWrongly, time_s: float) -> Reports:
        if not is_time_of(period_s, time_s):
            return []
        (intruder,) = loop.world.intruders
        (north_m, east_m, down_m), velocity_mps = intruder.state_at(loop.start_us / 1e6 + time_s)
        there_m = north_m, east_m + aside_m, down_m
        return [loop.report(0xA00001, there_m, velocity_mps[:2], emitter_type=17)]

    assert_passed(ReportedWrongly(add=aside))


def test_an_aircraft_without_an_address_is_avoided() -> None:
    assert_passed(ReportedWrongly(change=lambda _, message: [altered(message, ICAO_address=0)]))


BOUNCES = [(400.0, 0.3), (400.0, 0.5), (-250.0, 0.3), (-250.0, 0.5)]


@pytest.mark.parametrize(("above_m", "share"), sample(BOUNCES[:1], BOUNCES))
def test_heights_that_bounce_are_two_tracks_and_one_engagement(share: float, above_m: float) -> None:
    chance = random.Random(5)

    def bounce(_: ReportedWrongly, message: Message) -> Reports:
        off_m = above_m if chance.random() < share else 0.0
        return [altered(message, altitude=message.altitude + round(off_m * 1000.0))]

    loop = ReportedWrongly(change=bounce)
    assert_passed(loop)
    assert "reported at two heights" in texts(loop)


def test_an_address_that_is_said_to_be_ours_and_comes_head_on_is_avoided() -> None:
    def claim(_: ReportedWrongly, time_s: float) -> Reports:
        message = mavlink.MAVLink_uavionix_adsb_out_cfg_message(0xA00001, b"OWN", 14, 0, 0, 0, 0, 0)
        message.get_header().srcSystem = message.get_header().srcComponent = 1
        return [message] if is_time_of(2.0, time_s) else []

    loop = ReportedWrongly(add=claim)
    assert_passed(loop)
    assert texts(loop).count("A00001 is not our address, flies elsewhere") == 1


# --- what it says of itself


@pytest.mark.parametrize("emitter_type", sample([17], [17, 18, 19, 20, 21]))
def test_what_moves_flies_whatever_its_category(emitter_type: int) -> None:
    assert_passed(ReportedWrongly(change=lambda _, message: [altered(message, emitter_type=emitter_type)]))


@pytest.mark.parametrize(("scenario", "share"), pairs(["head-on", "crossing-right"], [0.0, 0.5]))
def test_positions_win_over_a_stated_velocity(scenario: str, share: float) -> None:
    loop = ReportedWrongly(
        scenario,
        change=lambda _, message: [altered(message, hor_velocity=round(message.hor_velocity * share))],
    )
    flight = loop.run()
    assert not loop.encounter.lowc
    assert flight.engagements == 1


@pytest.mark.parametrize("off_deg", sample([180], [90, 180]))
def test_positions_win_over_a_stated_course(off_deg: int) -> None:
    def turned(_: ReportedWrongly, message: Message) -> Reports:
        return [altered(message, heading=(message.heading + off_deg * 100) % 36_000)]

    assert_passed(ReportedWrongly(change=turned))


def test_an_aircraft_without_a_height_is_told_and_not_avoided() -> None:
    def heightless(_: ReportedWrongly, message: Message) -> Reports:
        return [altered(message, flags=message.flags & ~mavlink.ADSB_FLAGS_VALID_ALTITUDE)]

    loop = ReportedWrongly(change=heightless)
    loop.run(65.0)
    assert loop.flight.engagements == 0
    told = [text for text in loop.flight.texts if "height unknown" in text]
    assert len(told) >= 2
    assert all("HEAD1 12 o'clock" in text for text in told)


@pytest.mark.parametrize("from_s", [0.0, 6.0], ids=["from the start", "once our heights are known"])
def test_parked_aircraft_are_no_threat_to_one_above_them(from_s: float) -> None:
    """Three at home's height, without speed, below the mission that starts 60 m above home."""
    scenario = load_scenario("clear")
    low = replace(
        scenario,
        start=replace(scenario.start, where="air", height_m=60.0),
        intruders=(),
        mission=replace(
            scenario.mission,
            waypoints=tuple(replace(one, height_m=60.0) for one in scenario.mission.waypoints),
        ),
    )

    def parked(loop: ReportedWrongly, time_s: float) -> Reports:
        if time_s < from_s or not is_time_of(1.0, time_s):
            return []
        home_m = -low.home.altitude_m
        places = [(1500.0 + 100.0 * number, 20.0 * number, home_m) for number in range(3)]
        return [loop.report(0xD00001 + number, place_m, (0.0, 0.0)) for number, place_m in enumerate(places)]

    loop = ReportedWrongly(low, add=parked)
    flight = loop.run(100.0)
    assert flight.engagements == 0
    assert any(track.icao == 0xD00001 for _, tracks in loop.tracks for track in tracks), "they are shown"


# --- ourselves


@pytest.mark.parametrize("icao", sample([0xBEEF01], [0xBEEF01, 0]))
def test_our_own_shadow_is_told_and_not_fled_from(icao: int) -> None:
    """Ourselves, 4 s late, 120 m aside, every 5 s."""
    trail: list[tuple[float, Vec3, Vec3]] = []

    def shadow(loop: ReportedWrongly, time_s: float) -> Reports:
        truth = loop.world.vehicle.truth
        trail.append((time_s, truth.position_m, truth.velocity_mps))
        if time_s < 6.0 or not is_time_of(5.0, time_s):
            return []
        _, (north_m, east_m, down_m), velocity_mps = min(trail, key=lambda one: abs(one[0] - (time_s - 4.0)))
        return [loop.report(icao, (north_m, east_m + 120.0, down_m), velocity_mps[:2])]

    loop = ReportedWrongly(change=unheard, add=shadow)
    flight = loop.run()
    assert flight.engagements == 0
    assert flight.mission_completed
    assert "own shadow" in texts(loop)


@pytest.mark.parametrize("own_known", sample([False], [True, False]))
def test_an_aircraft_that_closes_in_from_behind_is_no_echo(own_known: bool) -> None:
    """It follows 60 m behind, and comes 1 m/s nearer."""
    start: list[tuple[float, Vec3, Vec3]] = []
    nearest_m = [math.inf]

    def follow(loop: ReportedWrongly, time_s: float) -> Reports:
        if time_s < 20.0:
            return []
        truth = loop.world.vehicle.truth
        if not start:
            start.append((time_s, truth.position_m, truth.velocity_mps))
        since_s, (north_m, east_m, down_m), (north_mps, east_mps, _) = start[0]
        speed_mps = math.hypot(north_mps, east_mps)
        flown_m = (speed_mps + 1.0) * (time_s - since_s) - 60.0
        share = flown_m / speed_mps
        there_m = north_m + north_mps * share, east_m + east_mps * share, down_m
        nearest_m[0] = min(nearest_m[0], math.dist(there_m, truth.position_m))
        faster = (speed_mps + 1.0) / speed_mps
        velocity_mps = north_mps * faster, east_mps * faster
        return [loop.report(0xBEEF01, there_m, velocity_mps)] if is_time_of(1.0, time_s) else []

    loop = ReportedWrongly(change=unheard, add=follow)
    if own_known:
        assert loop.engine is not None
        loop.engine.tracker.add_own_address(0xAAAAAA)
    flight = loop.run()
    assert flight.engagements >= 1
    assert nearest_m[0] > 40.0


def test_our_own_report_before_our_own_position_is_no_conflict() -> None:
    def utm(loop: ReportedWrongly, time_s: float) -> Reports:
        if not is_time_of(1.0, time_s):
            return []
        truth = loop.world.vehicle.truth
        place = loop.scenario.frame.to_geo(*truth.position_m)
        north_mps, east_mps, down_mps = (round(one * 100.0) for one in truth.velocity_mps)
        message = mavlink.MAVLink_utm_global_position_message(
            0, b"A" * 18, round(place.lat_deg * 1e7), round(place.lon_deg * 1e7),
            round(place.altitude_m * 1000.0), 0, north_mps, east_mps, down_mps, 0, 0, 0, 0, 0, 0, 0, 3, 127,
        )  # fmt: skip
        message.get_header().srcSystem = 5
        return [message]

    loop = ReportedWrongly(change=unheard, add=utm)
    flight = loop.run(60.0)
    assert flight.engagements == 0
    assert not loop.flight.layers


# --- age


@pytest.mark.parametrize("last_s", sample([12.0, 25.0], [12.0, 18.0, 25.0, 40.0]))
def test_a_conflict_is_coasted_past_its_meeting_and_silence_is_not_clear(last_s: float) -> None:
    def until(loop: ReportedWrongly, message: Message) -> Reports:
        return [message] if loop.time_s < last_s else []

    loop = ReportedWrongly(change=until)
    flight = loop.run()
    assert not loop.encounter.lowc
    assert flight.engagements == 1
    assert flight.mission_completed
    assert "Clear of" not in texts(loop)
    assert "not heard for" in texts(loop)
    states = {track.state for _, tracks in loop.tracks for track in tracks}
    assert TrackState.COASTED in states


def test_the_tracker_keeps_what_is_in_conflict_before_it_is_avoided() -> None:
    """A conflict that waits is a threat: it is kept through silence and before others."""
    loop = ReportedWrongly()
    kept: list[list[str]] = []
    note = loop.engine.tracker.note_threats

    def noted(track_ids: list[str], now_s: float) -> None:
        kept.append(track_ids)
        note(track_ids, now_s)

    loop.engine.tracker.note_threats = noted  # type: ignore[method-assign]
    loop.run(20.0)
    (awaited,) = loop.engine.decision.awaited
    assert loop.engine.decision.guidance is None
    assert kept[-1] == [awaited.track_id]


def test_an_age_that_counts_up_without_new_positions_is_silence() -> None:
    last: list[tuple[float, Message]] = []

    def frozen(loop: ReportedWrongly, message: Message) -> Reports:
        if loop.time_s < 20.0:
            last[:] = [(loop.time_s, message)]
            return [message]
        since_s, newest = last[0]
        return [altered(newest, tslc=min(int(loop.time_s - since_s), 254))]

    loop = ReportedWrongly(change=frozen)
    loop.run()
    assert not loop.encounter.nmac
    assert "Clear of" not in texts(loop)
    assert "not heard for" in texts(loop)


@pytest.mark.parametrize("kind", sample(["since the first"], ["unknown", "since the first"]))
def test_an_age_that_is_none_does_not_matter_while_the_positions_change(kind: str) -> None:
    def wrong(loop: ReportedWrongly, message: Message) -> Reports:
        return [altered(message, tslc=255 if kind == "unknown" else min(30 + int(loop.time_s), 254))]

    assert_passed(ReportedWrongly(change=wrong))


def test_reports_that_are_too_old_are_told_where_they_are_near() -> None:
    loop = ReportedWrongly(change=lambda _, message: [altered(message, tslc=60)])
    loop.run(100.0)
    assert "reports 60 s old" in texts(loop)
