"""A master is shown to work by two components; the others follow at night."""

from __future__ import annotations

import pytest

from tests.support.pace import names_other_components


def pytest_itemcollected(item: pytest.Item) -> None:
    """Leave one more component to the slow tests."""
    if hasattr(item, "callspec") and names_other_components(item.callspec.params):
        item.add_marker(pytest.mark.slow)
