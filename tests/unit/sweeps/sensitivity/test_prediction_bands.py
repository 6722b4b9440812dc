"""Prediction bands. Oracle: a law that is linear in its parameters, whose bands are Gaussian."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

import orchestration as ppy
from fmus.kit import Parameter, UserError
from orchestration.identify.uncertainty.estimate import joint_distribution
from orchestration.sweeps.sensitivity import prediction_bands as bands
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_pythonfmu
from tests.support.line import TIME, Line, estimates


class Straight(Line):
    """The line with a gain of either sign, so that no band is cut."""

    name = "straight_of_bands"
    gain = Parameter(2.0, "ohm", doc="gain")


def test_bands_of_a_linear_law_are_gaussian():
    """The variance of ``offset + gain u`` is ``s_o^2 + 2 r s_o s_g u + s_g^2 u^2`` for any u."""
    count, levels, u = 4000, (0.05, 0.5, 0.95), np.sin(TIME)
    given = joint_distribution(
        estimates(offset=(1.0, 0.2), gain=(2.0, 0.3)), {("offset", "gain"): -0.6}, []
    )
    drawn = given.draws(count, seed=2)
    found = ppy.sweep(Straight, drawn, {"u": u}, time=TIME, kind="draws", keep=["trace", "last"])
    band = ppy.bands(found)
    deviation = np.sqrt(0.2**2 - 2.0 * 0.6 * 0.2 * 0.3 * u + 0.3**2 * u**2)
    for level in levels:
        exact = 1.0 + 2.0 * u + norm.ppf(level) * deviation
        spread = (
            np.sqrt(level * (1.0 - level) / count) / norm.pdf(norm.ppf(level)) * deviation
        )  # of a sample quantile
        assert (np.abs(band["y_band"].sel(quantile=level).values - exact) < 4.0 * spread).all()
    assert band["y_last_band"].values == pytest.approx(band["y_band"].isel(time=-1).values)
    assert (band["y_band"].units, band["y_band"].dims) == ("V", ("quantile", "time"))


def test_long_traces_are_taken_in_parts(monkeypatch):
    drawn = joint_distribution(estimates(offset=(1.0, 0.2), gain=(2.0, 0.3)), {}, []).draws(30)
    found = ppy.sweep(Straight, drawn, {"u": np.sin(TIME)}, time=TIME, kind="draws", keep=["trace"])
    whole = ppy.bands(found)
    monkeypatch.setattr(bands, "_AT_ONCE", 200)
    assert ppy.bands(found).identical(whole)


def test_bands_are_of_cases_that_count_alike():
    for kind, over in (("grid", {"offset": "1..2:3"}), ("tornado", {"offset": "0..2"})):
        with pytest.raises(UserError, match=f"not {kind}"):
            ppy.bands(ppy.sweep(Line, over, time=TIME, kind=kind))
    found = ppy.sweep(Line, {"offset": "0..2"}, time=TIME, kind="sobol", samples=8, keep=["last"])
    assert ppy.bands(found, [0.5]).sizes == {"quantile": 1}
    for quantiles in ([0.9, 0.1], [5, 95], []):
        with pytest.raises(UserError, match=r"quantiles \["):
            ppy.bands(found, quantiles)


def test_no_band_is_of_part_of_the_cases(tmp_path):
    step = "    def do_step(self, current_time, step_size):\n"
    source = MINIMAL_PYTHONFMU_SOURCE.replace(
        step, step + "        if self.u >= 5.0:\n            return False\n"
    )
    fragile = str(
        build_pythonfmu(tmp_path, "refusing_some", source.replace("Minimal", "RefusingSome"))
    )
    found = ppy.sweep(fragile, {"u": [1.0, 6.0, 2.0]}, time=TIME[:5], kind="draws", keep=["trace"])
    with pytest.raises(UserError, match=r"no bands: 1 of 3 cases failed"):
        ppy.bands(found)
