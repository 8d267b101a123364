"""What all tests share."""

import gc

import pytest
from hypothesis import HealthCheck, settings
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

from tests.support.thorough import sample

# A busy machine must not fail a test: no deadlines in wall time.
settings.register_profile(
    "any-machine",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    max_examples=sample(15, 400),
)
settings.load_profile("any-machine")

# Tests of these folders take seconds each: they come first, and are handed to the processes one by one.
# Those of the first wait most of their time, the others compute. All other tests take less than the handing
# over: they go file by file, as do those that share what takes seconds to make, which come before all.
_WAITING, _FLYING = "tests/integration/", "tests/closed_loop/"
_SHARE_SECONDS = tuple(
    f"/test_{name}.py"
    for name in (
        "paper_command", "installed_package", "browser", "campaign", "web", "fit_recordings",
        "paper_flights", "one_aircraft", "readme", "dump1090", "evidence",
    )
)  # fmt: skip

# The tests of one flight of these files have its parameters, and run together: it is flown once.
_SHARE_A_FLIGHT = ("/test_scenarios.py",)


def _goes_alone(nodeid: str) -> bool:
    path, _, _ = nodeid.partition("::")
    return path.startswith((_WAITING, _FLYING)) and not path.endswith(_SHARE_SECONDS)


class _Scheduling(LoadScopeScheduling):
    def _split_scope(self, nodeid: str) -> str:
        """The tests that one process runs together."""
        path, _, test = nodeid.partition("::")
        if path.endswith(_SHARE_A_FLIGHT):
            return f"{path}[{test.partition('[')[2]}"
        return nodeid if _goes_alone(nodeid) else path


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the long tests first, those that wait evenly among those that compute.

    A long one at the end would be waited for. Where all processes wait at once, the computer is idle.
    """
    together, waiting, flying, short = [], [], [], []
    for item in items:
        path = item.nodeid.partition("::")[0]
        group = waiting if path.startswith(_WAITING) else flying if path.startswith(_FLYING) else short
        (together if path.endswith(_SHARE_SECONDS) else group).append(item)
    items[:] = [*together, *_mixed(waiting, flying), *short]


def _mixed(one: list[pytest.Item], other: list[pytest.Item]) -> list[pytest.Item]:
    """Both in their order, each spread over the whole."""
    placed = [(place / len(items), item) for items in (one, other) for place, item in enumerate(items)]
    return [item for _, item in sorted(placed, key=lambda pair: pair[0])]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadScopeScheduling:
    """Hand out the tests in their order."""
    return _Scheduling(config, log)


def pytest_collection_finish() -> None:
    """Leave out of garbage collection what lasts as long as the process: it is walked again and again."""
    gc.collect()
    gc.freeze()
