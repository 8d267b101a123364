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
    max_examples=sample(50, 400),
)
settings.load_profile("any-machine")

# Tests of these folders take seconds each: they come first, and are handed to the processes one by one. All
# others take less than the handing over, and go file by file, as do those that share a fixture of seconds.
_ONE_BY_ONE = ("tests/integration/", "tests/closed_loop/")
_SHARE_A_FIXTURE = ("/test_paper_command.py", "/test_installed_package.py", "/test_campaign.py")

# The tests of one flight of these files have its parameters, and run together: it is flown once.
_SHARE_A_FLIGHT = ("/test_scenarios.py",)


def _goes_alone(nodeid: str) -> bool:
    path, _, _ = nodeid.partition("::")
    return path.startswith(_ONE_BY_ONE) and not path.endswith(_SHARE_A_FIXTURE)


class _Scheduling(LoadScopeScheduling):
    def _split_scope(self, nodeid: str) -> str:
        """The tests that one process runs together."""
        path, _, test = nodeid.partition("::")
        if path.endswith(_SHARE_A_FLIGHT):
            return f"{path}[{test.partition('[')[2]}"
        return nodeid if _goes_alone(nodeid) else path


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the long tests first: a long one at the end would be waited for."""
    items.sort(key=lambda item: not item.nodeid.startswith(_ONE_BY_ONE))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadScopeScheduling:
    """Hand out the tests in their order."""
    return _Scheduling(config, log)


def pytest_collection_finish() -> None:
    """Leave out of garbage collection what lasts as long as the process: it is walked again and again."""
    gc.collect()
    gc.freeze()
