"""Claims: the picture has the record, both models, and both residuals."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.diagnosis.law_map import LawMap
from orchestration.reporting import draw


def test_the_picture_shows_what_was_left_out_and_its_residuals(dry):
    over, below = draw(dry).axes
    labels = [line.get_label().partition(":")[0] for line in over.lines]
    assert labels == ["measured", "parameters fitted", "with the cause"]
    unseen = dry.records[0].signals["position"][-len(over.lines[0].get_ydata()) :]
    assert np.allclose(over.lines[0].get_ydata(), unseen)
    assert len(unseen) == pytest.approx(dry.records[0].time.size / 3, abs=2)
    without, with_terms = (np.std(line.get_ydata()) for line in below.lines)
    assert with_terms < 0.1 * without


def test_the_picture_of_laws_is_what_is_added_over_the_signal(dry):
    figure = draw(LawMap(dry, ()))
    (axis,) = figure.axes
    assert axis.get_xlabel() == "velocity [m/s]"
    assert axis.get_ylabel() == "added to friction\n[N]"
    velocity, added = axis.lines[0].get_data()
    assert added[-1] == pytest.approx(1.5 * np.tanh(velocity[-1] / 0.1), rel=0.1)
