"""Bands of curves. Oracle: curves that are drawn, as sums of white noise in plain steps, and tables of the kit."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import smooth_table
from orchestration.discrepancy.laws.band import Band
from orchestration.discrepancy.laws.evidence import Basis, Columns, Curve

FINE = np.linspace(0.0, 1.0, 2001)
KNOTS = np.array([0.0, 0.1, 0.25, 0.4, 0.6, 0.7, 0.85, 1.0])
BASIS = Basis(3.0 + 2.0 * KNOTS)
X = 3.0 + 2.0 * FINE[::20]


def wandering(rng, draws):
    """Twice integrated white noise at `FINE`, (draws, n)."""
    step = FINE[1]
    rates = np.cumsum(rng.normal(0.0, np.sqrt(step), (draws, len(FINE))), axis=1)
    return np.cumsum(rates, axis=1) * step


def through_knots(curves):
    return curves[:, [round(k * (len(FINE) - 1)) for k in KNOTS]]


def test_what_is_left_between_knots():
    curves = wandering(np.random.default_rng(1), 4000)
    values = through_knots(curves)
    mean_variance = np.mean(np.diag(BASIS.bending))
    assert mean_variance == pytest.approx(1.0)
    straight = np.column_stack([np.ones(len(KNOTS)), KNOTS])
    bent = values - (straight @ np.linalg.lstsq(straight, values.T, rcond=None)[0]).T
    unit = np.mean(np.var(bent, axis=0))  # that a mean variance of 1 at the knots has
    xs = [float(x) for x in BASIS.knots]
    told = np.array(
        [[smooth_table(float(x), xs, list(map(float, v))) for x in X] for v in values[:400]]
    )
    left = (curves[:400, ::20] - told) / np.sqrt(unit)
    expected = np.sqrt(np.diag(BASIS.left_between(X)))
    assert np.sqrt(np.mean(left**2, axis=0)) == pytest.approx(
        expected, rel=0.2, abs=0.02 * expected.max()
    )
    assert np.sqrt(np.diag(BASIS.left_between(BASIS.knots))) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_the_band_holds_whole_curves(noise):
    """Of curves that bend as much as is expected, in noise in which what the knots leave does not stand out."""
    rng, held, whole = np.random.default_rng(2), 0, 200
    curves = wandering(rng, whole)
    at = np.arange(0, len(FINE), 5)
    x = 3.0 + 2.0 * FINE[at]
    columns = BASIS(x)
    for curve in curves:
        y = curve[at] + rng.normal(0.0, noise, len(at))
        z = columns / noise
        products = z.T @ z
        found = Columns(BASIS, products, products, len(at)).best(z.T @ y / noise)
        _, low, high = Band(BASIS, found)(X)
        inside = (curve[::20] >= low) & (curve[::20] <= high)
        held += bool(np.mean(inside) >= 0.9)
    assert held >= 0.9 * whole


def test_what_goes_together_has_the_band_of_a_point():
    straight = np.outer(BASIS.knots, BASIS.knots)
    values, low, high = Band(BASIS, Curve(0.0, 2.0 * BASIS.knots, 0.01 * straight, straight, 0.0))(
        X
    )
    assert values == pytest.approx(2.0 * X)
    assert high - low == pytest.approx(2.0 * 1.96 * 0.1 * X, rel=0.1)


def test_what_is_known_has_no_band():
    nothing = np.zeros((len(KNOTS), len(KNOTS)))
    values, low, high = Band(BASIS, Curve(0.0, np.ones(len(KNOTS)), nothing, nothing, 0.0))(X)
    assert values == pytest.approx(1.0)
    assert low == pytest.approx(high)
