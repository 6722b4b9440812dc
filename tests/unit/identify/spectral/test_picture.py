"""Claims: a picture has Bode and Nyquist diagrams of every response with units, and the model's."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from orchestration.identify.spectral import Response
from orchestration.identify.spectral.picture import draw_responses


def response(count, model=True, unit="N/m"):
    frequency = np.geomspace(0.01, 10.0, count)
    values = 6000.0 + 1e3j * frequency
    every = np.ones(count)
    beside = 1.1 * values if model else None
    return Response("force/displacement", unit, frequency, values, every, 9 * every, beside, {})


@pytest.mark.parametrize("count", [12, 200], ids=["lines", "band"])
def test_a_response_is_drawn_over_frequency_and_in_the_plane(count):
    one = response(count)
    figure = draw_responses([one, response(count, unit="ohm")], "run.csv against a model")
    magnitude, plane, phase, *others = figure.axes
    assert len(others) == 3
    assert (magnitude.get_xscale(), magnitude.get_yscale()) == ("log", "log")
    assert magnitude.get_ylabel() == "magnitude\n[N/m]"
    assert (phase.get_xlabel(), phase.get_ylabel()) == ("frequency [Hz]", "phase\n[°]")
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("storage [N/m]", "loss [N/m]")
    assert others[1].get_xlabel() == "real part [Ω]"
    model = next(line for line in magnitude.lines if line.get_label() == "model")
    assert model.get_ydata() == pytest.approx(1.1 * np.abs(one.values))
    model = next(line for line in phase.lines if line.get_label() == "model")
    assert model.get_ydata() == pytest.approx(np.degrees(np.angle(one.values)))
    assert plane.lines[0].get_ydata() == pytest.approx(one.values.imag)
    assert magnitude.get_legend() is not None


def test_one_frequency_is_in_the_middle_of_its_axis_and_numbers_have_room():
    """Warnings are errors here: an axis of no width gives one."""
    figure = draw_responses([response(1, model=False, unit="m/N")], "run.csv")
    _, plane, phase = figure.axes
    low, high = phase.get_xlim()
    assert np.sqrt(low * high) == pytest.approx(0.01)
    figure.draw_without_rendering()
    shown = [label.get_window_extent() for label in plane.get_xticklabels() if label.get_text()]
    assert all(a.x1 < b.x0 for a, b in pairwise(shown))


def test_regions_are_circles_of_their_size_and_what_is_lost_in_noise_has_none():
    one = response(12, model=False)
    values = one.values.copy()
    values[0] = 1e-3
    lost = Response(one.name, one.unit, one.frequency, values, one.variance, one.freedom, None, {})
    _, plane, phase = draw_responses([lost], "run.csv").axes
    (circles,) = plane.collections
    assert circles.get_offsets()[:, 0] == pytest.approx(one.values.real[1:])
    assert circles.get_widths() == pytest.approx(2.0 * one.radius[1:])
    assert [line.get_label() for line in plane.lines if line.get_label() == "model"] == []
    assert np.isnan(phase.lines[0].get_ydata()[0])
