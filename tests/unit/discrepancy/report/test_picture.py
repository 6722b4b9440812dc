"""Claims: the picture of a diagnosis shows the output that gained most, with the errors stated."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.report import picture


@pytest.mark.slow
def test_the_output_that_gained_most_is_drawn(results):
    result = results["cause"]
    diagnosis = result.diagnosis
    figure = picture.draw_diagnosis(diagnosis, result.model)
    gains = {o: diagnosis.before[o] - diagnosis.after[o] for o in diagnosis.before}
    output = max(gains, key=gains.get)
    above, below = figure.axes
    assert above.get_ylabel().startswith(output)
    labels = [text.get_text() for text in above.get_legend().get_texts()]
    assert labels == [
        "measured",
        f"parameters refitted: {100.0 * diagnosis.before[output]:.1f} % error",
        f"with the effect: {100.0 * diagnosis.after[output]:.1f} % error",
    ]
    measured, refitted, extended = (line.get_ydata() for line in above.get_lines())
    drawn = [line.get_ydata() for line in below.get_lines()]
    for simulated, residual in zip((refitted, extended), drawn, strict=True):
        np.testing.assert_allclose(residual, measured - simulated, atol=1e-9)


@pytest.mark.slow
def test_nothing_wrong_is_drawn_as_well(results):
    result = results["consistent"]
    above, _ = picture.draw_diagnosis(result.diagnosis, result.model).axes
    assert above.get_lines()[0].get_label() == "measured"
