"""A scenario that comes with the project, with an early conflict and a short mission."""

from dataclasses import replace
from pathlib import Path

from sim.scenario import SCENARIO_FOLDER, Scenario, load_scenario

MEET_AT_S, NORTH_M = 72.0, 2300.0


def shorter(name: str) -> Scenario:
    """A scenario of one intruder, flown in half of its time."""
    scenario = load_scenario(name)
    (conflict,) = scenario.intruders
    ahead = replace(scenario.mission.waypoints[-1], north_m=NORTH_M)
    return replace(
        scenario,
        duration_s=180.0,
        intruders=(replace(conflict, meet_at_s=MEET_AT_S),),
        mission=replace(scenario.mission, waypoints=(ahead,)),
    )


def write_short_head_on(folder: Path) -> Path:
    """The same of head-on as a file; its path."""
    path, text = folder / "short.yaml", (SCENARIO_FOLDER / "head-on.yaml").read_text()
    changes = {"meet_at_s: 100": f"meet_at_s: {MEET_AT_S:g}", "north_m: 4500": f"north_m: {NORTH_M:g}"}
    for usual, short in changes.items():
        assert usual in text
        text = text.replace(usual, short)
    path.write_text(text)
    return path
