"""Tests that open sockets run one after the other, whatever runs beside them."""

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All of them go to one worker."""
    for item in items:
        if item.get_closest_marker("wire") is not None or "integration" in item.path.parts:
            item.add_marker(pytest.mark.xdist_group("wire"))
