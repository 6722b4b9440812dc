"""Claims: a misuse spoils what it says, and leaves the rest of a record alone."""

from __future__ import annotations

import numpy as np
import pytest

from studies.misuse import KINDS, cases, draw_misused, write
from studies.misuse.records import MisuseCase


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_spoils_a_record(kind):
    right, spoilt = draw_misused(MisuseCase(kind, KINDS[kind].plants[0], "square", 7))
    columns = {"time": right.time, **right.inputs, **right.outputs}
    assert list(spoilt.everything) == list(columns)
    assert len({len(values) for values in spoilt.everything.values()}) == 1
    assert all(np.isfinite(values).all() for values in spoilt.everything.values())
    assert any(
        len(values) != len(columns[name]) or not np.allclose(values, columns[name])
        for name, values in spoilt.everything.items()
    )


def test_another_unit_is_a_factor_of_one_column():
    right, spoilt = draw_misused(MisuseCase("speed in rpm", "Motor", "square", 7))
    assert spoilt.outputs["speed"] == pytest.approx(right.outputs["speed"] * 60 / (2 * np.pi))
    for name in ("time", "voltage", "current"):
        assert (
            spoilt.everything[name] is {**right.inputs, **right.outputs, "time": right.time}[name]
        )


def test_cases_are_drawn_once_and_files_hold_what_was_spoilt(tmp_path):
    drawn = cases(2, 5)
    assert drawn == cases(2, 5) != cases(2, 6)
    assert len({case.seed for case in drawn}) == len(drawn) == 2 * len(KINDS)
    right, spoilt = draw_misused(drawn[0])
    path = write(right, spoilt, tmp_path / "record.csv")
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    assert table == pytest.approx(np.column_stack(list(spoilt.everything.values())), rel=1e-8)
