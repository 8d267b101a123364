"""Formations flown through the engines: radio, clocks, arrival, the campaign and its report."""

import io
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from companion.errors import ConfigError
from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import FrameSplitter
from companion.output.effects import Transmit
from sim.campaign.flight import FIRST_ICAO
from sim.campaign.plane import Plane
from sim.campaign.results import read_results
from sim.formation.command import available, page_of, print_figures, run, show_crossing
from sim.formation.crossing import crossing
from sim.formation.engines import AVOIDERS, NONE, Separation, engine_of
from sim.formation.flight import Conditions, fly
from sim.formation.member import Member
from sim.formation.plan import FormationPlan
from sim.formation.radio import RadioQuality

LOSSY = Conditions(RadioQuality(0.3, 1.0), ticks_hz=2)
CROSSING = crossing(2, 5, 1, 50.0)


def made(number: int, avoider: str = "companion") -> Member:
    mission = CROSSING.missions[number - 1]
    plane = Plane(mission.start_m, mission.airspeed_mps, mission.route, mission.limits, number)
    return Member(number, plane, engine_of(avoider, number, mission.limits, Separation()))


def test_a_member_hears_the_other_as_another_system_with_its_own_clock() -> None:
    """The engine takes its own aircraft's system id; the other is traffic, wherever its clock stands."""
    first, second = made(1), made(2)
    for step in range(50):
        time_s = step * 0.2
        for member in (first, second):
            for raw in member.telemeter(time_s, heartbeat=step % 5 == 0, rare=step % 10 == 0):
                (second if member is first else first).hear(raw, time_s + 0.05)
            member.decide(time_s)
            member.plane.fly(2, 0.1)
    for member, other in ((first, "SYS-2"), (second, "SYS-1")):
        assert member.engine is not None
        assert member.engine.sender == (member.system_id, 196)
        assert [track.track_id for track in member.engine.snapshot(0.0).tracks] == [other]


def test_intents_are_real_frames_for_all_but_the_station() -> None:
    member = made(2)
    message = mavlink.MAVLink_v2_extension_message(0, 0, 0, 0xCA91, list(range(249)))
    sender = member.engine.sender if member.engine else (2, 196)
    effects = [Transmit(sender, message, to) for to in ("all", "station")]
    raws = member._intents(effects, 1.0)
    (frame,) = FrameSplitter().feed_datagram(raws[0])
    assert len(raws) == 1
    assert (frame.message_id, frame.system_id, frame.component_id) == (248, sender[0], 196)
    assert replace(member, shares_intent=False)._intents(effects, 1.0) == []


def test_without_avoidance_the_members_come_too_near_and_arrive() -> None:
    flown = fly(CROSSING, NONE, LOSSY)
    apart_m = np.linalg.norm(flown.position_m[:, 0] - flown.position_m[:, 1], axis=1)
    assert apart_m.min() < 50.0
    nominal_s = [mission.nominal_s for mission in CROSSING.missions]
    assert flown.arrived_s == pytest.approx(nominal_s, abs=5.0)


def test_a_flight_is_repeatable_and_kept_apart() -> None:
    first, again = (fly(CROSSING, "companion", LOSSY, 3) for _ in range(2))
    assert first.position_m.tobytes() == again.position_m.tobytes()
    apart_m = np.linalg.norm(first.position_m[:, 0] - first.position_m[:, 1], axis=1)
    assert apart_m.min() > 50.0
    assert min(first.engagements) > 0
    assert first.reasons[0]


def test_a_stranger_is_heard_by_the_receiver_on_board() -> None:
    member = made(1)
    for step in range(30):
        time_s = step * 0.2
        member.telemeter(time_s, heartbeat=step % 5 == 0, rare=step % 10 == 0)
        if step % 5 == 0:
            heard = 0, time_s - 1.0, (0.0, 50.0 * time_s, -300.0), (0.0, 50.0, 0.0), 1.0
            member.hear_traffic(heard, time_s)
        member.decide(time_s)
    assert member.engine is not None
    (track,) = member.engine.snapshot(0.0).tracks
    assert track.icao == FIRST_ICAO


PLAN = FormationPlan(2, 2, seed=5, avoiders=("none",), losses=(0.0, 0.3), delays_s=(0.3,), ticks_hz=2)


def test_a_campaign_continues_and_reports_each_radio(tmp_path: Path) -> None:
    out, console = tmp_path / "f.ndjson", Console(width=100, record=True, quiet=True)
    run(replace(PLAN, encounters=1), out, console, workers=1)
    report = run(PLAN, out, console, workers=1)
    assert report == run(PLAN, out, console, workers=1)
    assert len(list(read_results(out))) == PLAN.flights == 4
    none = report["avoiders"]["none"]
    assert none["flights"] == 4
    assert none["collisions"] == none["arrived"] == 1.0
    assert list(none["by_radio"]) == ["0 % lost, 0.3 s", "30 % lost, 0.3 s"]
    more = replace(PLAN, encounters=1, avoiders=("none", "inner"), losses=(0.3,))
    report = run(more, out, console, workers=1)
    assert report["avoiders"]["inner"]["decision_ms"]["p99"] > 0.0
    print_figures(console, json.loads(json.dumps(report)))
    with pytest.raises(ConfigError, match="another campaign"):
        run(replace(PLAN, seed=6), out, console, workers=1)


def test_flights_are_drawn_and_listed_again(tmp_path: Path) -> None:
    plan, out = replace(PLAN, encounters=1, losses=(0.3,)), tmp_path / "f.ndjson"
    console = Console(width=200, record=True, file=io.StringIO())
    report = run(plan, out, console, workers=1)
    text = page_of(plan, out, report)
    assert "<td>30 % lost, 0.3 s</td>" in text
    assert text.count("<img") == 1
    show_crossing(replace(plan, avoiders=("inner",)), 0, console, tmp_path / "f.png")
    assert (tmp_path / "f.png").stat().st_size > 10_000
    words = console.export_text()
    assert "pairs_lost: " in words
    assert "member 2 " in words


def test_what_cannot_be_flown_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match="2 to 10 members"):
        replace(PLAN, members=11)
    with pytest.raises(ConfigError, match="companion-silent"):
        replace(PLAN, avoiders=("mvp",))
    monkeypatch.setitem(sys.modules, "pyrvo", None)
    console = Console(width=200, record=True, file=io.StringIO())
    assert set(available((), console, PLAN).avoiders) == set(AVOIDERS) - {"orca"}
    assert "pyrvo" in console.export_text()
