"""Columns of an archive have names of their own."""

from __future__ import annotations

import pytest

from fmus.kit import UserError
from orchestration.rig.archive import columns_of


@pytest.mark.parametrize("name", ["time", "wall", "number", "missed", "voltage_age"])
def test_a_signal_that_is_called_as_a_column_is_refused(name):
    with pytest.raises(UserError, match=name):
        columns_of({name: "A"}, {"voltage": "V"})
