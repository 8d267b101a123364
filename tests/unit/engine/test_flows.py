"""Calls and files of three flows, counted by `tests.tools.flows`."""

import pytest

from sim.scenario import Autopilot
from tests.tools.flows import Flow, in_room, measure, modules

AUTOPILOTS: tuple[Autopilot, ...] = ("ardupilot", "px4")
# What changes rarely is made only on a change: limits of the place, fence, the leg flown back to, tracks of
# obstacles. What serves others than the setpoint, as what is forwarded or of concern, comes after it. What is
# rare is asked only where it applies: an echo near us, a fence, a refusal. CONTRIBUTING.md lists the steps.
MOST_FILES_OF_A_REPORT = 37


@pytest.fixture(scope="module", params=AUTOPILOTS)
def flows(request: pytest.FixtureRequest) -> dict[str, Flow]:
    return measure(request.param)


def test_a_pilots_mode_change_runs_no_function_of_the_avoidance(flows: dict[str, Flow]) -> None:
    assert in_room(flows["pilot"].calls, "avoidance") == []


def test_a_pilots_mode_change_takes_at_most_thirteen_functions_of_control(flows: dict[str, Flow]) -> None:
    functions = {name for _, name in in_room(flows["pilot"].before, "control") if "<locals>" not in name}
    assert len(functions) <= 13


def test_a_traffic_report_crosses_at_most_37_files(flows: dict[str, Flow]) -> None:
    assert len(modules(flows["report"].before)) <= MOST_FILES_OF_A_REPORT


def test_an_operators_parameter_is_answered_in_the_same_tick(flows: dict[str, Flow]) -> None:
    assert [sent.get_type() for sent in flows["parameter"].sent].count("PARAM_VALUE") == 1
