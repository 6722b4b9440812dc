"""Claims: a difference equation is found from columns of a file, over time or counted samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import orchestration as ppy
from fmus.kit import UserError


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Columns of ``y[k] = 0.8 y[k-1] + 0.5 u[k-1]``, over time and over counts."""
    folder = tmp_path_factory.mktemp("columns")
    rng = np.random.default_rng(1)
    u = rng.normal(size=400)
    y = lfilter([0.0, 0.5], [1.0, -0.8], u) + 0.01 * rng.normal(size=400)
    for name, clock in (("time [s]", 0.25 * np.arange(400)), ("sample", np.arange(400))):
        table = np.column_stack([clock, u, y])
        path = folder / f"{name.split()[0]}.csv"
        np.savetxt(path, table, delimiter=",", header=f"{name},u [V],y [mm]", comments="")
    return folder


@pytest.mark.parametrize(("name", "options"), [("time", {}), ("sample", {"step": 0.25})])
def test_the_pole_is_found(folder, name, options):
    found = ppy.black_box(
        folder / f"{name}.csv", "y", structures=["OE"], path_orders=[1], delays=1, **options
    )
    assert found.model.poles("u") == pytest.approx([0.8], abs=0.01)
    assert found.columns.data.step == 0.25


def test_arrays_by_name_are_as_their_file(folder):
    columns = np.loadtxt(folder / "time.csv", delimiter=",", skiprows=1).T
    arrays = dict(zip(("time [s]", "u [V]", "y [mm]"), columns, strict=True))
    found = ppy.black_box(arrays, "y", structures=["OE"], path_orders=[1], delays=1)
    assert found.model.poles("u") == pytest.approx([0.8], abs=0.01)
    assert found.columns.units == {"u": "V", "y": "mm"}
    counted = {"sample": np.arange(400)} | {"u": columns[1], "y": columns[2]}
    found = ppy.black_box(counted, "y", structures=["OE"], path_orders=[1], delays=1, step="250ms")
    assert found.model.poles("u") == pytest.approx([0.8], abs=0.01)
    with pytest.raises(UserError, match=r"an array of shape \(3, 400\) has no names of columns"):
        ppy.black_box(columns, "y")


def test_inputs_are_those_named(folder):
    with pytest.raises(UserError, match="no column 'v'"):
        ppy.black_box(folder / "time.csv", "y", ["v"])
