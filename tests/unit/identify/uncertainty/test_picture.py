"""Claims: a profile is drawn with parabola, level and both intervals, in the unit it is read in."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Parameter
from orchestration.identify.uncertainty.picture import draw_profiles
from orchestration.identify.uncertainty.profile import LEVEL, Coordinate, profile_likelihood

HALF = 0.5  # of the interval, in the searched coordinate


def profile(name="a", logarithmic=False, farthest=np.inf, **declared):
    """Return a profile about 1, a parabola up to a coordinate from which on it is flat."""

    def refit(start):
        return start, float((min(start[0], farthest) - 1.0) ** 2 / HALF**2)

    value = np.exp if logarithmic else float
    error = HALF / np.sqrt(LEVEL)
    along = Coordinate(0, value, -np.inf, np.inf, logarithmic, np.ones(1), error)
    return profile_likelihood(
        name, Parameter(1.0, **({"unit": "V"} | declared)), refit, np.ones(1), along
    )


def lines(axis):
    return {line.get_label(): line for line in axis.lines}


@pytest.mark.parametrize("logarithmic", [False, True])
def test_a_parabola_is_drawn_as_what_it_is(logarithmic):
    """The profile over its fits is the parabola of the ellipse, and so are both intervals."""
    (axis,) = draw_profiles([profile(logarithmic=logarithmic)]).axes
    drawn = lines(axis)
    x, y = drawn["profile"].get_data()
    inside = np.isfinite(y)
    away = (np.log(x) if logarithmic else x) - 1.0
    assert y[inside] == pytest.approx(LEVEL * (away[inside] / HALF) ** 2, abs=1e-2)
    x, y = drawn["parabola of the ellipse"].get_data()
    away = (np.log(x) if logarithmic else x) - 1.0
    assert y == pytest.approx(LEVEL * (away / HALF) ** 2, rel=1e-9)
    ends = np.array([1.0 - HALF, 1.0 + HALF])
    ends = np.exp(ends) if logarithmic else ends
    for name in ("ellipse", "profile"):
        assert drawn[f"95 % interval of the {name}"].get_xdata() == pytest.approx(ends, rel=1e-3)
    assert axis.get_xscale() == "linear"


def test_values_are_in_the_unit_in_which_they_are_read():
    (axis,) = draw_profiles([profile("spring_length", unit="m", display="mm")]).axes
    assert axis.get_xlabel() == "spring length [mm]"
    assert lines(axis)["estimate"].get_xdata() == pytest.approx([1000.0])


def test_an_open_end_is_drawn_to_the_edge_with_an_arrow():
    """Flat from 1.3 on, where a parabola is at 0.36 of the level: it has no end above."""
    (axis,) = draw_profiles([profile(farthest=1.3)]).axes
    edge = axis.get_xlim()[1]
    assert lines(axis)["95 % interval of the profile"].get_xdata()[1] == pytest.approx(edge)
    arrows = [line.get_xdata()[0] for line in axis.lines if line.get_marker() == ">"]
    assert arrows == pytest.approx([edge])


def test_one_picture_holds_several():
    figure = draw_profiles([profile("a"), profile("b")])
    assert [axis.get_xlabel() for axis in figure.axes] == ["a [V]", "b [V]"]
