"""Claims: the picture has the record, both models, and both residuals."""

from __future__ import annotations

import numpy as np
import pytest

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
