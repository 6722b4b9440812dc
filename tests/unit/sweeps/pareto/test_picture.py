"""Claims: a front is drawn in display units, with the model as it is, and written if wanted."""

import numpy as np
import pytest

from orchestration.sweeps.pareto import Front


def test_a_front_is_drawn_and_told_in_display_units(ruler):
    """The length is 1 mm per unit of x, by the model's own equation."""
    front = Front.of(ruler, np.array([[0.6], [1.0]]))
    above, below = front.draw().axes
    assert above.get_xlabel() == ""
    assert below.get_xlabel() == "length [mm]"
    line, nominal = above.get_lines()
    assert line.get_xdata() == pytest.approx(1e3 * front.values[:, 0])
    assert nominal.get_xdata() == pytest.approx([0.5])
    assert below.get_lines()[0].get_xdata() == pytest.approx([0.8, 4.0])
    assert front.units == {"x": "1"}
    assert front.objectives["length"] == "m"
    assert "in length mm" in str(front)


def test_the_picture_is_written(bells, tmp_path):
    front = Front.of(bells, np.array([[0.5, 0.5], [0.55, 0.55]]))
    front.plot(tmp_path / "front.svg")
    assert (tmp_path / "front.svg").stat().st_size > 5_000
