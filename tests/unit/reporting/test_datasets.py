"""Claims: a dataset that is a result is one of xarray, with a picture of its own."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import xarray

from fmus.kit import UserError
from orchestration.reporting import ResultDataset, pictures


class Line(ResultDataset):
    __slots__ = ()

    def draw(self):
        if "x" not in self.dims:
            raise UserError("a point")
        figure, (axis,) = pictures.panels(1, "line")
        axis.plot(self["x"], self["y"])
        return figure


@pytest.fixture
def line():
    return Line({"y": ("x", [1.0, 4.0, 9.0], {"units": "V"})}, {"x": [1.0, 2.0, 3.0]})


def test_what_xarray_makes_of_it_is_one_again(line):
    for made in (line.sel(x=slice(2.0)), line.load(), line.assign_attrs(a=1), line + 1.0):
        assert type(made) is Line
    assert pickle.loads(pickle.dumps(line)).identical(line)
    assert isinstance(line, xarray.Dataset)


def test_a_notebook_shows_the_variables_and_the_picture(line):
    shown = line._repr_mimebundle_()
    assert "xr-wrap" in shown["text/html"]
    assert "<img" in line._repr_html_()
    assert shown["image/png"]


def test_a_part_without_a_picture_is_shown_without(line):
    shown = line.isel(x=0)._repr_mimebundle_()
    assert list(shown) == ["text/html"]
    with pytest.raises(UserError, match="a point"):
        line.isel(x=0).plot()


def test_it_is_drawn_and_written_if_wanted(line, tmp_path):
    assert line.plot(tmp_path / "line.svg").axes[0].lines[0].get_ydata().tolist() == [1, 4, 9]
    assert (tmp_path / "line.svg").read_text(encoding="utf-8").startswith("<?xml")
    with pytest.raises(UserError, match="must end in"):
        line.plot(tmp_path / "line.txt")
    assert callable(line.plot.scatter)  # of xarray


def test_it_is_a_table(line):
    assert np.array_equal(line.to_frame()["y"], [1.0, 4.0, 9.0])
