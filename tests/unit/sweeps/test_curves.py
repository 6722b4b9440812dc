"""Pictures of sweeps: curves of a grid, points of another design, read off the figure."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

from fmus.kit import UserError
from orchestration.sweeps import curves


def grid():
    about = {"units": "V"}
    values = np.arange(6.0).reshape(3, 2)
    return xarray.Dataset(
        {"y_last": (("a", "b"), values, about)},
        {"a": ("a", [1.0, 2.0, 3.0], {"units": "A"}), "b": ("b", [5.0, 7.0], {"units": "N"})},
        {"model": "m"},
    )


def test_a_grid_is_drawn_as_curves_over_its_first_parameter():
    figure = curves.draw_curves(grid())
    lines = figure.axes[0].get_lines()
    assert [line.get_ydata().tolist() for line in lines] == [[0.0, 2.0, 4.0], [1.0, 3.0, 5.0]]
    assert [line.get_label() for line in lines] == ["b = 5 N", "b = 7 N"]
    assert figure.axes[0].get_xlabel() == "a [A]"


def test_other_designs_are_drawn_as_points():
    data = xarray.Dataset(
        {"y_last": ("case", [1.0, 2.0, 3.0], {"units": "V"})},
        {"a": ("case", [0.3, 0.1, 0.2], {"units": "A"})},
        {"model": "m"},
    )
    figure = curves.draw_curves(data)
    (points,) = figure.axes[0].get_lines()
    assert points.get_xdata().tolist() == [0.3, 0.1, 0.2]
    assert points.get_ydata().tolist() == [1.0, 2.0, 3.0]
    assert points.get_linestyle() == "None"


def test_without_numbers_there_is_nothing_to_draw():
    data = grid().drop_vars("y_last")
    with pytest.raises(UserError, match="numbers are drawn over parameters"):
        curves.draw_curves(data)


def test_numbers_and_parameters_are_in_the_units_that_they_are_displayed_in():
    """As the picture of a simulation has them: mm for m, mA for A."""
    data = grid()
    data["y_last"].attrs |= {"units": "m", "display_units": "mm"}
    data["a"].attrs["display_units"] = "mA"
    data["b"].attrs["display_units"] = "mN"
    figure = curves.draw_curves(data)
    assert curves.omissions(data) == []
    panel = figure.axes[0]
    assert panel.get_lines()[1].get_xdata() == pytest.approx([1e3, 2e3, 3e3])
    assert panel.get_lines()[1].get_ydata() == pytest.approx([1e3, 3e3, 5e3])
    assert panel.get_lines()[1].get_label() == "b = 7000 mN"
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("a [mA]", "y last\n[mm]")


def test_what_a_picture_leaves_out_is_said():
    cases = {f"y{k}_last": ("case", [1.0, 2.0], {"units": "V"}) for k in range(8)}
    about = {"units": "A"}
    where = {name: ("case", [0.3, 0.1], about) for name in ("a", "b", "c")}
    data = xarray.Dataset(cases, where, {"model": "m"})
    figure = curves.draw_curves(data)
    assert len(figure.axes) == 6
    assert curves.omissions(data) == [
        "the picture shows the first 6 of 8 numbers, without y6_last, y7_last; outputs= and"
        " keep= choose others",
        "the picture shows the cases over a alone, not over b, c",
    ]


def test_curves_without_a_legend_are_explained():
    values = {"y_last": (("a", "b"), np.zeros((3, 9)), {"units": "V"})}
    about = {"units": "A"}
    where = {"a": ("a", [1.0, 2.0, 3.0], about), "b": ("b", np.arange(9.0), about)}
    data = xarray.Dataset(values, where, {"model": "m"})
    figure = curves.draw_curves(data)
    (line,) = curves.omissions(data)
    assert line.startswith("the picture has 9 curves, from dark to light in the order of b")
    assert figure.axes[0].get_legend() is None
