"""Tests that open sockets run one after the other, whatever runs beside them."""

import pytest


@pytest.hookimpl(tryfirst=True)  # before the workers share out what they find
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All of them go to one worker; those of one file of commands share what the commands made."""
    for item in items:
        if item.get_closest_marker("wire") is not None:
            item.add_marker(pytest.mark.xdist_group("wire"))
        elif "integration" in item.path.parts:
            item.add_marker(pytest.mark.xdist_group(item.path.stem))
