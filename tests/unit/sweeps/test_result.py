"""Claims: the result of a sweep is drawn and tabulated, and so is that of its analysis."""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
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


def test_an_analysis_is_drawn_as_what_it_is(swept):
    over = {"tau": "1..2", "u": "1..3"}
    moved = ppy.tornado(swept(over, kind="tornado", settings={"u": 2.0, "tau": 1.5}))
    assert [one.get_text() for one in moved.plot().axes[0].get_yticklabels()] == [
        "tau: 1..2 s",
        "u: 1..3",
    ]
    shares = ppy.sensitivity(swept(over, kind="sobol-indices", samples=16))
    assert shares.plot().axes[0].get_xlabel() == "parameter"
    bands = ppy.bands(swept(over, kind="sobol", samples=16))
    with pytest.raises(UserError, match="bands are drawn over time"):
        bands.plot()  # of numbers
    for one in (moved, shares):
        assert one._repr_mimebundle_()["image/png"]
    assert list(bands._repr_mimebundle_()) == ["text/html"]


def test_a_part_has_no_picture(swept):
    found = swept({"tau": "1, 2", "u": "1, 3"})
    with pytest.raises(UserError, match="part of a sweep"):
        found.sel(u=3.0).plot()
    assert list(found.sel(u=3.0)._repr_mimebundle_()) == ["text/html"]
