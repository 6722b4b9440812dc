"""Claims: the picture has the record, both models, and both residuals."""

from __future__ import annotations

import numpy as np

from orchestration.reporting import draw


def test_the_picture_shows_record_and_residuals(dry):
    over, below = draw(dry).axes
    assert [line.get_label() for line in over.lines] == ["measured", "without terms", "with terms"]
    assert np.allclose(over.lines[0].get_ydata(), dry.records[0].signals["position"])
    without, with_terms = (np.std(line.get_ydata()) for line in below.lines)
    assert with_terms < 0.1 * without
