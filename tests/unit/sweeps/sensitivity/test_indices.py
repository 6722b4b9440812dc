"""Sobol indices. Oracles: the function of Ishigami and a linear law, in closed form."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

import orchestration as ppy
from fmus.kit import Component, Output, Parameter, sin
from tests.support.command import works
from tests.support.sensitivity_laws import CALL, Laws, swept, words


class Ishigami(Component):
    """The function of Ishigami and Homma (1990), which is not monotonic.

    Its third parameter acts together with the first only.
    """

    name = "ishigami"
    x1 = Parameter(0.0, "1", doc="first")
    x2 = Parameter(0.0, "1", doc="second")
    x3 = Parameter(0.0, "1", doc="third")

    @Output("1", nominal=1.0)
    def y(self):
        """Return the function."""
        return sin(self.x1) + 7.0 * sin(self.x2) * sin(self.x2) + 0.1 * self.x3**4 * sin(self.x1)


def ishigami_exact():
    a, b = 7.0, 0.1
    first = 0.5 * (1.0 + b * np.pi**4 / 5.0) ** 2
    second, both = a**2 / 8.0, b**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    whole = first + second + both
    return np.array([[first, second, 0.0], [first + both, second, both]]) / whole


@pytest.mark.slow
def test_indices_of_ishigami_are_those_of_the_closed_form():
    over = dict.fromkeys(("x1", "x2", "x3"), f"{-np.pi}..{np.pi}")
    found = swept(Ishigami, over, samples=8192)
    assert found.sizes["case"] == 5 * 8192
    shares = ppy.sensitivity(found)
    assert shares["y_last_index"].dims == ("index", "parameter")
    assert shares["y_last_index"].sel(
        index=["first", "total"], parameter=["x1", "x2", "x3"]
    ).values == pytest.approx(ishigami_exact(), abs=0.01)


def test_indices_of_a_linear_law_are_its_shares_of_the_variance():
    """Those of ``sum a_i x_i`` are as ``a_i^2 var(x_i)``: as ``a_i`` times the width, squared."""
    over = {"a": "1..2", "b": "0..3", "c": "0.5..1"}
    found = ppy.sensitivity(swept(Laws, over, samples=1024))
    weight = np.array([2.0 * 1.0, 1.0 * 3.0, 4.0 * 0.5]) ** 2
    for order in ("first", "total"):
        assert found["linear_last_index"].sel(index=order).values == pytest.approx(
            weight / weight.sum(), abs=0.01
        )
    assert np.isnan(found["still_last_index"].values).all()
    assert found["linear_last_index"].units == "1"


def test_parameters_over_ratios_vary_evenly_in_their_logarithm():
    """The mean of one parameter over ratios r is ``(r - 1) / ln r``."""
    found = swept(Laws, {"c": "0.1..10 log", "b": "1..2"}, samples=1024)
    assert found["c"].values.mean() == pytest.approx(9.9 / np.log(100.0), rel=0.01)


def bootstrapped_errors(values):
    """Return standard errors of both indices by the estimators b and f of Saltelli et al. (2010).

    `values` are by base points, and A, AB of every parameter, and B.
    """
    whole = values - values.mean()
    chosen = np.random.default_rng(5).integers(len(values), size=(4000, len(values)))
    picked = whole[chosen]
    a, ab, b = picked[..., :1], picked[..., 1:-1], picked[..., -1:]
    spread = np.concatenate([a, b], axis=1).var(axis=1)
    first = (b * (ab - a)).mean(axis=1) / spread
    total = 0.5 * ((a - ab) ** 2).mean(axis=1) / spread
    return np.array([first.std(axis=0), total.std(axis=0)])


@pytest.mark.parametrize("level", [0.95, 0.5])
def test_intervals_are_those_of_the_bootstrap(level):
    """Intervals have the width of a bootstrap that is written out, and hold the true indices."""
    over = {"a": "1..2", "b": "0..3", "c": "0.5..1"}
    found = swept(Laws, over, samples=256, outputs=["linear"])
    shares = ppy.sensitivity(found, level=level)
    ends = shares["linear_last_index_interval"]
    half = 0.5 * (ends.sel(end="upper") - ends.sel(end="lower")).values
    factor = {0.95: 1.95996, 0.5: 0.67449}[level]
    values = found["linear_last"].values.reshape(256, 5)
    assert half == pytest.approx(factor * bootstrapped_errors(values), rel=0.1)
    weight = np.array([4.0, 9.0, 4.0]) / 17.0
    assert (np.abs(shares["linear_last_index"].values - weight) < half).all()


def test_the_same_seed_comes_to_the_same_indices():
    over = {"a": "1..2", "b": "0..3"}
    one, again, other = (ppy.sensitivity(swept(Laws, over, seed=s), seed=s) for s in (0, 0, 1))
    assert one.identical(again)
    assert not one.equals(other)


def test_indices_are_printed_written_and_drawn(folder):
    call = [
        *CALL,
        "--over",
        "u=1..2",
        "--design",
        "sobol-indices",
        "--samples",
        "64",
    ]
    said = works(*call, "--keep", "last", "--out", "i.nc", "--plot", "i.svg", cwd=folder)
    assert "256 cases" in said
    assert "95 % interval" in said
    read = xarray.load_dataset(folder / "i.nc", engine="scipy")
    again = ppy.sensitivity(read)
    xarray.testing.assert_allclose(read["x_last_index"], again["x_last_index"])
    assert {"tau", "u", "first order", "total", "x last", "parameter"} <= {*words(folder / "i.svg")}
    one = next(
        line.split() for line in said.splitlines() if line.startswith("x_last") and " tau " in line
    )
    assert float(one[2]) == pytest.approx(
        float(again["x_last_index"].sel(index="first", parameter="tau")), abs=6e-4
    )
