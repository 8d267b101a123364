"""What all tests share."""

import pytest
from hypothesis import HealthCheck, settings
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

# A busy machine must not fail a test: no deadlines in wall time.
settings.register_profile("any-machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any-machine")

# Tests of these folders take seconds each: they come first, and are handed to the processes one by one. All
# others take less than the handing over, and go file by file, as do those that share a fixture of seconds.
_ONE_BY_ONE = ("tests/integration/", "tests/closed_loop/")
_SHARE_A_FIXTURE = ("/test_paper_command.py", "/test_installed_package.py", "/test_campaign.py")


def _goes_alone(nodeid: str) -> bool:
    path, _, _ = nodeid.partition("::")
    return path.startswith(_ONE_BY_ONE) and not path.endswith(_SHARE_A_FIXTURE)


class _Scheduling(LoadScopeScheduling):
    def _split_scope(self, nodeid: str) -> str:
        """The tests that one process runs together."""
        return nodeid if _goes_alone(nodeid) else nodeid.partition("::")[0]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the long tests first: a long one at the end would be waited for."""
    items.sort(key=lambda item: not item.nodeid.startswith(_ONE_BY_ONE))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadScopeScheduling:
    """Hand out the tests in their order."""
    return _Scheduling(config, log)
