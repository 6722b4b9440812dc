"""Studies are judged at night."""

from __future__ import annotations

import pytest


def pytest_itemcollected(item: pytest.Item) -> None:
    """Leave them to the slow tests."""
    item.add_marker(pytest.mark.slow)
