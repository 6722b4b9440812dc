"""The s-plane against poles of continuous systems."""

import numpy as np
import pytest
from scipy.signal import cont2discrete

from orchestration.identify.black_box import (
    input_output_data,
    output_error,
    s_plane,
)
from tests.support.black_box import response

STEP = 0.1


def test_s_plane_has_the_poles_of_the_continuous_system():
    """Third order, with a pair of complex poles, held inputs (SciPy's discretisation)."""
    poles = np.array([-0.4 + 1.5j, -0.4 - 1.5j, -2.0])
    numerator, denominator, _ = cont2discrete(([1.0, 3.0], np.real(np.poly(poles))), STEP)
    u = np.random.default_rng(1).standard_normal(800)
    y = response(list(np.squeeze(numerator)), list(denominator), u)
    model = output_error(input_output_data(u, y, STEP), 3, 3).model
    order = {"key": lambda s: (round(s.imag, 3), s.real)}
    assert sorted(model.s_plane_poles(), **order) == pytest.approx(sorted(poles, **order), abs=1e-4)
    assert (
        min(np.abs(model.s_plane_zeros() + 3.0)) < 0.05
    )  # near that of the continuous system, not at it
    assert s_plane([np.exp(-0.2), 0.0, -1.0], 0.1) == pytest.approx(
        np.array([-2.0, np.pi / 0.1 * 1j])
    )
