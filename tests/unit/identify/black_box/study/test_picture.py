"""Claims: pictures show the free run of the model, the tests of its residual and its poles."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.identify.black_box.study.picture import (
    draw_correlations,
    draw_identified,
    draw_residual,
    draw_roots,
)


def test_the_free_run_is_drawn_over_what_was_measured(signals, found):
    """The second half of the record, from 150 s on."""
    measured, simulated = found.plot().axes[0].lines
    assert measured.get_xdata()[[0, -1]] == pytest.approx([150.0, 299.5])
    assert measured.get_ydata() == pytest.approx(signals[1][300:])
    (difference,) = found.plot().axes[1].lines
    assert difference.get_ydata() == pytest.approx(measured.get_ydata() - simulated.get_ydata())
    assert np.std(difference.get_ydata()) < 0.05 * np.std(measured.get_ydata())


def test_the_identification_data_have_their_free_run_and_residual(signals, found):
    """Figs. 3-13 and 3-15: the first half of the record, and what is left of it."""
    measured, simulated = draw_identified(found).axes[0].lines
    assert measured.get_xdata()[[0, -1]] == pytest.approx([0.0, 149.5])
    assert measured.get_ydata() == pytest.approx(signals[1][:300])
    error = measured.get_ydata() - simulated.get_ydata()
    fit = 100 * (
        1 - np.linalg.norm(error) / np.linalg.norm(signals[1][:300] - signals[1][:300].mean())
    )
    assert simulated.get_label() == f"free run: {fit:.1f} % fit"
    (residual,) = draw_residual(found).axes[0].lines
    assert residual.get_xdata()[-1] == pytest.approx(149.5)
    # predictions know the sample before: no larger than what a free run leaves
    assert np.std(residual.get_ydata()) <= np.std(error) * 1.01


def test_the_poles_of_every_path_are_drawn_in_the_s_plane(found):
    """A pole at 0.8 is ln(0.8) / 0.5 s."""
    drive, other = draw_roots(found).axes
    assert drive.lines[0].get_xdata() == pytest.approx([np.log(0.8) / 0.5], abs=0.02)
    assert sorted(other.lines[0].get_ydata()) == pytest.approx(
        [-np.arccos(0.6 / np.sqrt(0.5)) / 0.5, np.arccos(0.6 / np.sqrt(0.5)) / 0.5], abs=0.05
    )


def test_correlations_are_drawn_beside_their_limits(found):
    axes = draw_correlations(found).axes
    assert [axis.get_title() for axis in axes] == ["with itself", "with drive", "with for"]
