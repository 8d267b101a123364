"""The state as JSON, statistics of several snapshots, the pipe, and a replay."""

import asyncio
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from companion.airspace.fences import FenceZone
from companion.engine import Engine
from companion.gcs.traffic_conditions import traffic_conditions
from companion.model import Track, TrackState
from companion.output.notice import Condition
from companion.recording.recorder import Recorder
from companion.traffic import Concern, ConcernKind
from companion.web import Observers
from companion.web import state as state_module
from companion.web.display import pack, unpack
from companion.web.health import Health, LinkCount, LoopTimes, ReceiverCount
from companion.web.live_snapshot import live_snapshot_of
from companion.web.replay_server import RecordedSource
from companion.web.rolling_stats import RollingStats
from companion.web.settings import Settings
from companion.web.state import state_of
from tests.support.web_bench import health, snapshot_after


def test_an_engine_without_data_has_a_state() -> None:
    state = state_of(live_snapshot_of(Engine(), 1_700_000_000.0, health()), 1, RollingStats())
    assert state["own"] is None
    assert state["tracks"] == state["cones"] == state["predicted"] == []
    assert state["mission"] is None
    assert state["service"]["position_age_s"] is None
    json.dumps(state, allow_nan=False)


def test_a_conflict_has_threat_track_and_cone() -> None:
    state = state_of(snapshot_after(70.0), 7, RollingStats())
    json.dumps(state, allow_nan=False)
    assert (state["sequence"], state["aircraft"]["mode"]) == (7, "GUIDED")
    assert state["decision"]["layer"] == "outer"
    (threat,) = state["decision"]["threats"]
    (track,) = state["tracks"]
    (cone,) = state["cones"]
    assert threat["track"] == track["track"] == cone["track"] == track["icao"] == "A00001"
    assert track["level"] == "caution"
    assert cone["inside"] is True
    # The volume of the intruder ahead, with its margin, has a radius of 701 m.
    assert cone["half_angle_deg"] == pytest.approx(
        math.degrees(math.asin(701.04 / track["distance_m"])), abs=0.1
    )
    assert cone["transition_deg"] == 90.0
    assert 0.0 <= cone["bearing_deg"] < 360.0
    assert track["north_m"] - state["own"]["north_m"] == pytest.approx(track["distance_m"], abs=1.0)
    assert [item["sequence"] for item in state["mission"]["items"]] == [0, 2]
    # One minute at 22 m/s plus wind.
    first, last = state["predicted"][0], state["predicted"][-1]
    assert math.dist(first[:2], last[:2]) == pytest.approx(60.0 * 24.0, rel=0.02)
    assert last[2] == pytest.approx(state["decision"]["guidance"]["altitude_m"], abs=1.0)


def test_only_near_traffic_is_proximate() -> None:
    snapshot = snapshot_after(20.0)
    own = snapshot.snapshot.ownship
    assert own is not None
    north_m, east_m, down_m = own.position_m

    def at(off_m: float, above_m: float) -> Track:
        return Track(
            f"{off_m},{above_m}", own.time_s, (north_m + off_m, east_m, down_m - above_m), (0.0, 9.0, 0.0)
        )

    shown = replace(snapshot.snapshot, tracks=(at(2000.0, 0.0), at(4000.0, 0.0), at(2000.0, 500.0)))
    state = state_of(replace(snapshot, snapshot=shown), 1, RollingStats())
    assert [track["level"] for track in state["tracks"]] == ["proximate", "other", "other"]


def test_rates_cover_the_last_seconds_and_silence_is_measured() -> None:
    now_s = [100.0]
    stats = RollingStats(lambda: now_s[0])
    for second in range(11):
        now_s[0] = 100.0 + second
        frames = 50 * min(second, 8)
        stats.add(health(links=(LinkCount("udpin:x:1", frames, second, 0, 0, 0),), tick_s=0.001 * second))
    (link,) = stats.links()
    assert link["silent_s"] == pytest.approx(2.0)
    assert link["frames_per_s"] == pytest.approx(30.0), "150 in five seconds"
    assert link["lost_share"] == pytest.approx(5 / 155, abs=1e-4)
    assert link["connected"] is True
    assert stats.tick_ms_p99() == pytest.approx(9.0)


def test_ticks_are_counted_by_their_duration() -> None:
    times = LoopTimes()
    for seconds in (0.0001, 0.0005, 0.004, 3.0):
        times.observe(seconds)
    assert times.below == (2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 4)
    assert times.last_s == 3.0
    assert times.total_s == pytest.approx(3.0046)


async def test_a_snapshot_passes_through_the_pipe_unchanged() -> None:
    snapshot = snapshot_after(40.0)
    reader = asyncio.StreamReader()
    reader.feed_data(pack(Settings()) + pack(snapshot)[:-1])
    assert await unpack(reader) == Settings()
    reader.feed_eof()
    with pytest.raises(EOFError):
        await unpack(reader)
    reader = asyncio.StreamReader()
    reader.feed_data(pack(snapshot))
    again = await unpack(reader)
    assert state_of(again, 1, RollingStats()) == state_of(snapshot, 1, RollingStats())


def recorded() -> RecordedSource:
    source = RecordedSource()
    for tick in range(100):
        layer = "clear" if tick < 50 else "outer"
        source.add(
            tick / 10.0, {"sequence": tick, "decision": {"layer": layer, "because": "so", "announced": ""}}
        )
    return source


async def test_a_recorded_flight_plays_pauses_and_seeks() -> None:
    source = recorded()
    assert source.layers() == [(0.0, "clear", "so"), (5.0, "outer", "so")]
    view = source.view()
    states = view.states()

    async def shown() -> dict[str, object]:
        state: dict[str, object] = json.loads(await anext(states))
        return state

    assert (await shown())["sequence"] == 0
    view.control({"play": False, "seek_s": 7.25})
    state = await shown()
    assert state["sequence"] == 72
    assert state["replay"] == {"at_s": 7.25, "duration_s": 9.9, "playing": False, "speed": 1.0}
    view.control({"seek_s": 1e9})
    assert (await shown())["sequence"] == 99
    view.control({"play": True, "speed": 10})
    assert (await shown())["sequence"] == 0, "from the beginning again"
    later = await shown()
    assert 5 <= later["sequence"] <= 40  # type: ignore[operator]


@pytest.mark.parametrize(
    "message", [{"speed": "fast"}, {"seek_s": math.nan}, {"play": 1}, {"seek_s": True}, {}]
)
async def test_an_invalid_message_changes_nothing(message: dict[str, object]) -> None:
    view = recorded().view()
    states = view.states()
    before = json.loads(await anext(states))["replay"]
    view.control({"play": False})
    await anext(states)
    view.control(message)
    assert json.loads(await anext(states))["replay"] == {**before, "playing": False}


def test_without_links_there_are_no_statistics_of_links() -> None:
    stats = RollingStats(lambda: 1.0)
    assert stats.links() == []
    assert stats.tick_ms_p99() is None
    stats.add(Health.of(0.0, LoopTimes(), ()))
    assert stats.links() == []


class BrokenEngine:
    """Stands in for an engine; every access fails."""


def test_a_failing_observer_is_logged_once_and_never_raises(caplog: pytest.LogCaptureFixture) -> None:
    lines: list[str] = []

    class Lines(Recorder):
        def __init__(self) -> None:
            """Nothing to open."""

        def state(self, time_us: int, line: str) -> None:  # noqa: ARG002
            lines.append(line)

    observers = Observers(None, Lines())
    for tick in range(3):
        observers.look(BrokenEngine(), tick * 10_000_000, health)  # type: ignore[arg-type]
    assert [r.getMessage() for r in caplog.records] == ["state in the record: switched off"]
    observers = Observers(None, Lines())
    for tick in range(250):
        observers.look(Engine(), 1_700_000_000_000_000 + tick * 100_000, health)
    assert [json.loads(line)["sequence"] for line in lines] == [1, 2, 3], "every ten seconds"


def test_state_md_explains_every_key() -> None:
    text = (Path(state_module.__file__).parent / "state.md").read_text()
    explained = set(re.findall(r"`(\w+)`", text)) | set(re.findall(r"\b(\w+_(?:m|deg))\b", text))
    snapshot = snapshot_after(40.0)
    zone = FenceZone(inclusion=True, centre_deg=(-35.0, 149.0), radius_m=100.0)
    links = (LinkCount("udpin:x:1", 1, 0, 0, 0, 0),)
    receivers = (ReceiverCount("sbs:tcp:a:1", "SBS", "", 0, 0, (), 0, 0, 0.0, None),)
    concerns = (Concern(ConcernKind.LOST, "N1"),)
    conditions = tuple(traffic_conditions(concerns, None))
    snapshot = replace(snapshot, concerns=concerns, conditions=conditions)
    snapshot = replace(snapshot, zones=(zone,), health=health(links=links, receivers=receivers))
    stats = RollingStats()
    stats.add(snapshot.health)
    assert keys_of(state_of(snapshot, 1, stats)) <= explained


def test_the_state_has_the_evidence_of_each_track_and_what_is_not_avoided() -> None:
    snapshot = snapshot_after(40.0)
    (track,) = snapshot.snapshot.tracks
    sources = ("ADS-B", "flarm:udpin:0.0.0.0:1")
    coasted = replace(
        track,
        state=TrackState.COASTED,
        sources=sources,
        position_sigma_m=math.inf,
        velocity_sigma_mps=1.54,
        vertical_uncertainty_m=61.23,
        alarm=2,
    )
    shadow = Concern(ConcernKind.OWN_SHADOW, "S1", 40.0, math.pi, 6.0)
    concerns = (shadow, Concern(ConcernKind.LEFT_OUT, "900"))
    conditions = (
        *traffic_conditions(concerns, snapshot.snapshot.ownship),
        Condition("low", 4, "Avoidance off: low"),
    )
    shown = replace(snapshot.snapshot, tracks=(coasted,))
    snapshot = replace(snapshot, snapshot=shown, concerns=concerns, conditions=conditions)
    state = state_of(snapshot, 1, RollingStats())
    json.dumps(state, allow_nan=False)
    (seen,) = state["tracks"]
    assert (seen["state"], seen["sources"], seen["alarm"]) == ("coasted", list(sources), 2)
    assert (seen["position_sigma_m"], seen["velocity_sigma_mps"]) == (None, 1.5)
    assert seen["vertical_uncertainty_m"] == 61.2
    first, left_out = state["concerns"]
    assert first == {
        "kind": "own shadow", "name": "S1", "avoided": False, "distance_m": 40, "bearing_deg": 180.0,
        "seconds": 6.0,
    }  # fmt: skip
    assert (left_out["name"], left_out["distance_m"], left_out["bearing_deg"]) == ("900", None, None)
    of_traffic = [one.get("of_traffic") for one in state["companion"]["conditions"]]
    assert of_traffic == [True, True, None]


def keys_of(value: object) -> set[str]:
    if isinstance(value, dict):
        return {*value} | {key for inside in value.values() for key in keys_of(inside)}
    if isinstance(value, list):
        return {key for inside in value for key in keys_of(inside)}
    return set()


def test_receivers_are_listed_with_their_rates() -> None:
    stats = RollingStats(clock_s=iter(range(100)).__next__)
    one = ReceiverCount("sbs:tcp:a:1", "SBS", "speed", 0, 0, (("truncated", 2),), 3, 4, 0.25, None)
    for second in range(4):
        stats.add(health(receivers=(replace(one, messages=20 * second, reports=10 * second),)))
    assert stats.receivers() == [
        {
            "address": "sbs:tcp:a:1", "title": "SBS", "lacks": "speed", "problem": None,
            "messages_per_s": 20.0, "reports_per_s": 10.0, "aircraft": 4, "bad": 2,
            "dropped": 3, "silent_s": 0.2,
        }
    ]  # fmt: skip
