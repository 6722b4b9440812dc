"""Pictures of sweeps: curves of a grid, points of another design, read off the saved figure."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

from fmus.kit import UserError
from orchestration.sweeps import picture


@pytest.fixture
def figures(monkeypatch):
    saved = []
    monkeypatch.setattr(picture.pictures, "save", lambda figure, path: saved.append(figure))
    return saved


def grid():
    about = {"units": "V"}
    values = np.arange(6.0).reshape(3, 2)
    return xarray.Dataset(
        {"y_last": (("a", "b"), values, about)},
        {"a": ("a", [1.0, 2.0, 3.0], {"units": "A"}), "b": ("b", [5.0, 7.0], {"units": "N"})},
        {"model": "m"},
    )


def test_a_grid_is_drawn_as_curves_over_its_first_parameter(figures, tmp_path):
    picture.draw(grid(), tmp_path / "a.png")
    lines = figures[0].axes[0].get_lines()
    assert [line.get_ydata().tolist() for line in lines] == [[0.0, 2.0, 4.0], [1.0, 3.0, 5.0]]
    assert [line.get_label() for line in lines] == ["b = 5 N", "b = 7 N"]
    assert figures[0].axes[0].get_xlabel() == "a [A]"


def test_other_designs_are_drawn_as_points(figures, tmp_path):
    data = xarray.Dataset(
        {"y_last": ("case", [1.0, 2.0, 3.0], {"units": "V"})},
        {"a": ("case", [0.3, 0.1, 0.2], {"units": "A"})},
        {"model": "m"},
    )
    picture.draw(data, tmp_path / "a.png")
    (points,) = figures[0].axes[0].get_lines()
    assert points.get_xdata().tolist() == [0.3, 0.1, 0.2]
    assert points.get_ydata().tolist() == [1.0, 2.0, 3.0]
    assert points.get_linestyle() == "None"


def test_without_numbers_there_is_nothing_to_draw(tmp_path):
    data = grid().drop_vars("y_last")
    with pytest.raises(UserError, match="numbers are drawn over parameters"):
        picture.draw(data, tmp_path / "a.png")
