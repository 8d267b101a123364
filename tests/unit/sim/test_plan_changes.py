"""Plans with changed parameters, and results files of earlier versions."""

import json
from pathlib import Path

import pytest

from companion.avoidance import AvoidanceParams
from companion.errors import ConfigError
from sim.campaign.changes import changed
from sim.campaign.plan import Plan
from sim.campaign.results import Results, read_results
from sim.campaign.runner import fly_task
from sim.campaign.summary import gather
from sim.encounters import KINDS


def test_values_are_changed_by_name_also_inside_a_part() -> None:
    params = changed(AvoidanceParams(), [("outer_time_s", 40.0), ("weights.turn", 2.0)])
    assert (params.outer_time_s, params.weights.turn) == (40.0, 2.0)
    assert params.weights.loss == AvoidanceParams().weights.loss


@pytest.mark.parametrize("name", ["colour", "weights.colour", "outer_time_s.more"])
def test_an_unknown_name_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="there is no"):
        changed(AvoidanceParams(), [(name, 1.0)])


def test_values_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ConfigError, match="inner_radius_m must not exceed"):
        changed(AvoidanceParams(), [("inner_radius_m", 9e9)])


def test_a_plan_changes_the_aircraft_and_the_avoidance() -> None:
    usual = Plan(2, own_limits=(("max_climb_mps", 1.0),), avoidance=(("begin_near", 0.5),))
    assert usual.limits.max_climb_mps == 1.0
    assert usual.identity()["avoidance"] == (("begin_near", 0.5),)
    (ours,), (calm,) = (fly_task((plan, "companion", "perfect", (1,))) for plan in (Plan(2), usual))
    assert ours["flown"] != calm["flown"]


def test_a_file_of_an_earlier_version_continues(tmp_path: Path) -> None:
    """Settings that came later are named only where they differ."""
    path, identity = tmp_path / "r.ndjson", Plan(1).identity()
    assert not identity.keys() & {"two_sided", "avoidance", "own_limits"}
    line = fly_task((Plan(1), "none", "perfect", (0,)))[0]
    assert line["source"] in KINDS
    older = {key: value for key, value in line.items() if key not in ("source", "altitude_m")}
    path.write_text(json.dumps({"campaign": identity}) + "\n" + json.dumps(older) + "\n")
    results = Results.open(path, identity)
    results.close()
    assert results.done == {("none", "perfect", 0)}
    assert len(gather(read_results(path))["none"]) == 1
