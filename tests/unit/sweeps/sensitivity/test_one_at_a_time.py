"""Tornado plots. Oracle: linear and bilinear laws in closed form."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

import orchestration as ppy
from fmus.kit import UserError
from orchestration.sweeps.sensitivity import one_at_a_time as tornado
from tests.support.command import PNG, works
from tests.support.sensitivity_laws import CALL, Laws, swept, words


def test_a_tornado_is_that_of_the_closed_form():
    over = {"a": "1..2", "b": "2..5", "u": "3..6"}
    call = {"kind": "tornado", "samples": None}
    found = ppy.tornado(swept(Laws, over, settings={"b": 4.0}, **call))
    assert float(found["product_last_start"]) == pytest.approx(16.0)
    expected = {"a": [16.0, 16.0], "b": [8.0, 20.0], "u": [12.0, 24.0]}
    for parameter, ends in expected.items():
        assert found["product_last_tornado"].sel(parameter=parameter).values == pytest.approx(ends)
    assert found["linear_last_tornado"].sel(parameter="a", end="from").item() == pytest.approx(
        2.0 + 4.0 - 4.0
    )
    assert found["ends"].sel(parameter="b").values.tolist() == [2.0, 5.0]
    assert (found["product_last_tornado"].units, found["parameter_units"].values.tolist()) == (
        "V",
        ["V", "ohm", "A"],
    )
    with pytest.raises(
        UserError, match=r"'b': '5..7'}: its start value 3 ohm is not in this range"
    ):
        swept(Laws, {"b": "5..7"}, **call)


def test_what_moves_most_stands_first():
    found = ppy.tornado(
        swept(Laws, {"a": "1..2", "u": "3..6", "b": "2..5"}, kind="tornado", samples=None)
    )
    rows = [*zip(*(column.cells for column in tornado.table(found).columns), strict=True)]
    assert [r[1] for r in rows if r[0] == "product_last"] == ["b", "u", "a"]
    assert [r[1] for r in rows if r[0] == "linear_last"] == ["b", "a", "u"]
    assert rows[[r[:2] for r in rows].index(("product_last", "u"))][2:] == (
        "3 A",
        "6 A",
        "12",
        "9",
        "18",
        "V",
    )


@pytest.mark.slow
def test_a_tornado_is_printed_written_and_drawn(folder):
    """``x(1) = u (1 - exp(-1 / tau))``."""
    call = [*CALL, "--over", "u=1..3", "--design", "tornado", "--keep", "last"]
    call += ["--set", "u=2", "--set", "tau=1"]
    said = works(*call, "--out", "t.nc", "--plot", "t.svg", cwd=folder)
    works(*call, "--plot", "t.png", cwd=folder)
    assert (folder / "t.png").read_bytes().startswith(PNG)
    read = xarray.load_dataset(folder / "t.nc", engine="scipy")
    exact = 2.0 * (1.0 - np.exp(-1.0 / np.array([0.5, 2.0])))
    assert read["x_last_tornado"].sel(parameter="tau").values == pytest.approx(exact)
    assert f"{exact[0]:.6g}" in said
    assert {"tau: 0.5..2 s", "low end of the range", "x last"} <= {*words(folder / "t.svg")}


def test_a_file_says_where_the_others_stay(folder):
    (folder / "t.toml").write_text(
        'design = "tornado"\nkeep = ["last"]\n[experiment]\ncomponent = "one_state.fmu"\nduration ='
        ' "1 s"\nstep = "100 ms"\nparameters.tau = 0.7\ninputs.u = { kind = "constant", value = 2'
        ' }\n[over]\ntau = "0.5..2"\n'
    )
    found = ppy.tornado(ppy.sweep_file(folder / "t.toml"))
    assert float(found["x_last_start"]) == pytest.approx(2.0 * (1.0 - np.exp(-1.0 / 0.7)))
