"""Claims: the result of a sweep is a table."""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from tests.support.hosts import build_one_state_fmu


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Sweep a lag of which the last value is ``u (1 - exp(-stop / tau))``."""
    fmu = str(build_one_state_fmu(tmp_path_factory.mktemp("lag")))

    def sweep(over, keep="last", **options):
        return ppy.sweep(fmu, over, stop="2s", step="100 ms", keep=keep, **options)

    return sweep


def test_a_grid_has_a_row_for_each_case_and_a_picture(swept):
    found = swept({"tau": "1, 2", "u": "1, 3"})
    frame = found.to_frame()
    expected = frame["u"] * (1.0 - np.exp(-2.0 / frame["tau"]))
    assert len(frame) == 4
    assert frame["x_last"].to_numpy() == pytest.approx(expected.to_numpy())
    (axis,) = found.plot().axes
    assert axis.get_xlabel() == "tau [s]"
    assert axis.get_ylabel() == "x last"


def test_a_list_has_its_parameters_beside_its_numbers(swept):
    frame = swept({"tau": "1, 2"}, kind="list", settings={"u": 1.0}).to_frame()
    assert frame["tau"].tolist() == [1.0, 2.0]
    assert list(frame["case"]) == [0, 1]


def test_traces_alone_are_a_table_over_time(swept):
    frame = swept({"tau": "1, 2"}, settings={"u": 1.0}, keep="trace").to_frame()
    expected = 1.0 - np.exp(-frame["time"] / frame["tau"])
    assert len(frame) == 2 * 21
    assert frame["x"].to_numpy() == pytest.approx(expected.to_numpy(), abs=1e-12)
