"""A formation as `companion-sim demo` flies it: vehicles and companions on their own, over sockets."""

import asyncio
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.engine import Engine
from companion.replay import replay
from companion.web.settings import Settings
from sim.cli.app import app
from sim.members.demo import FormationOptions, FormationState, fly_formation_demo
from sim.members.engines import engine_config
from tests.support.faulty_flight import free_ports
from tests.support.two_members import two_members
from tests.support.web_bench import Site

pytestmark = pytest.mark.wire


async def flown(options: FormationOptions) -> FormationState:
    return await asyncio.wait_for(fly_formation_demo(options), 300.0)


async def test_two_members_avoid_each_other_and_their_recordings_replay_the_same(tmp_path: Path) -> None:
    scenario = two_members(network={"loss": 0.1, "delay_s": 0.3})
    state = await flown(FormationOptions(scenario, speedup=10.0, record=tmp_path, compare=False))
    report = state.report()
    assert state.passed
    assert report["mission_completed"]
    (pair,) = report["pairs"]  # type: ignore[misc]
    assert pair["members"] == ["NORTH", "EAST"]
    assert not pair["separation_lost"]
    assert pair["min_slant_m"] > 50.0
    for member, name in zip(report["members"], ("NORTH", "EAST"), strict=True):  # type: ignore[call-overload]
        assert member["name"] == name
        assert member["resumed"]
        assert member["setpoints_sent"] > 50
    (value,) = report["safety_value"].values()  # type: ignore[attr-defined]
    assert value["each_second_m"][0] == pytest.approx(1250.0 * 2**0.5, abs=1.0)
    for (_, flight), member in zip(state.named, scenario.formation, strict=True):
        assert flight.recording is not None
        replayed: list[str] = []
        replay(flight.recording, Engine(engine_config(member)), on_decision=replayed.append)
        lines = flight.recording.with_suffix(".jsonl").read_text().splitlines()
        assert len(lines) > 800
        assert replayed == lines[: len(replayed)]


async def test_the_page_shows_each_member_by_name() -> None:
    (port,) = free_ports(1)
    options = FormationOptions(
        two_members(), speedup=8.0, compare=False, display=Settings(port=port, title="two")
    )
    flying = asyncio.create_task(flown(options))
    at, systems = Site(port, []), {}
    async with asyncio.timeout(120.0):
        while set(systems.values()) != {7, 8}:
            await asyncio.sleep(0.2)
            try:
                answer = await at.ask("/api/members")
            except OSError:
                continue  # not started yet
            systems = {one["name"]: one.get("system_id") for one in answer.json}
    for name in systems:
        state = await at.ask(f"/api/state?member={name}")
        assert state.json["aircraft"]["system_id"] == systems[name]
    flying.cancel()
    with pytest.raises(asyncio.CancelledError):
        await flying


async def test_without_avoidance_they_meet() -> None:
    state = await flown(FormationOptions(two_members(), speedup=40.0, avoidance=False))
    assert state.score.separation_lost
    assert not state.passed
    assert list(state.report()["safety_value"]) == ["none"]  # type: ignore[call-overload]


def test_an_autopilot_for_all_members_is_refused() -> None:
    result = CliRunner().invoke(app, ["demo", "--scenario", "formation-5", "--autopilot", "px4"])
    assert result.exit_code == 2
    assert "names its members' autopilots" in " ".join(result.output.split())


def test_the_command_writes_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = json.dumps(
        {
            "description": "two that never meet",
            "duration_s": 30,
            "home": {"lat_deg": 47.0, "lon_deg": 8.0, "altitude_m": 400.0},
            "formation": [
                {
                    "name": f"U{number}",
                    "system_id": number,
                    "start": {"where": "air", "east_m": 8000.0 * number, "height_m": 300},
                    "mission": {
                        "takeoff_height_m": 60,
                        "waypoints": [{"north_m": 300, "east_m": 8000.0 * number, "height_m": 300}],
                    },
                }
                for number in (1, 2)
            ],
        }
    )
    (tmp_path / "apart.yaml").write_text(text)
    arguments = ["demo", "--scenario", "apart.yaml", "--speedup", "20", "--no-web", "--report", "r.json"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "Closest approaches of members" in result.output
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["mission_completed"]
    assert len(report["members"]) == 2
    assert len(report["pairs"]) == 1
    assert list(report["safety_value"]) == ["companion", "outer", "inner"]
    assert all(value["mean_m"] == pytest.approx(8000.0, abs=1.0) for value in report["safety_value"].values())
    assert {path.name for path in (tmp_path / "recordings").iterdir()} == {"U1", "U2"}
