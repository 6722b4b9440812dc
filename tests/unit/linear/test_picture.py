"""Claims: a picture shows all operating points, the band of values, and the margins of a loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.linear.discretisation import Matrices
from orchestration.linear.model import FAMILY, LinearModel
from orchestration.linear.operating_point import OperatingPoint
from orchestration.linear.picture import draw_linear_model as draw


def lag(rate, time=0.0, loop="", period=0.0):
    """The model ``rate / (s + rate)``, or for a loop ``rate / s``."""
    slope = 0.0 if loop else -rate
    A, B = np.array([[slope]]), np.array([[rate]])
    if period:
        A, B = (
            np.exp(A * period),
            np.array([[rate * period if loop else 1 - np.exp(-rate * period)]]),
        )
    matrices = Matrices(A, B, np.ones((1, 1)), np.zeros((1, 1)), period, ("x",))
    units = {"u": "A", "y": "V"}
    point = OperatingPoint(time, {}, {}, {}, {})
    return LinearModel("m", matrices, ("u",), ("y",), units, point, "paper", loop)


def test_operating_points_and_the_band_of_values():
    varied = (lag(0.5), *(lag(1.0) for _ in range(FAMILY)), lag(2.0))
    first = replace(lag(1.0), further=(lag(2.0, 5.0),), variations=varied)
    gain, phase, step, plane = draw(first).axes
    texts = [text.get_text() for text in gain.get_legend().get_texts()]
    assert texts == ["10 values of parameters", "at 0 s", "at 5 s"]
    frequencies, decibel = gain.lines[0].get_data()
    exact = -10.0 * np.log10(1.0 + (2.0 * np.pi * frequencies) ** 2)
    np.testing.assert_allclose(decibel, exact, atol=1e-9)
    edges = gain.collections[0].get_paths()[0].vertices
    at_end = edges[np.isclose(edges[:, 0], frequencies[-1]), 1]
    omega = 2.0 * np.pi * frequencies[-1]
    extremes = [-10.0 * np.log10(1.0 + (omega / r) ** 2) for r in (0.5, 2.0)]
    assert (at_end.min(), at_end.max()) == pytest.approx(tuple(extremes), rel=1e-9)
    time, response = step.lines[0].get_data()
    np.testing.assert_allclose(response, 1.0 - np.exp(-time), atol=1e-6)
    assert plane.lines[0].get_xdata().tolist() == [-1.0]
    assert "[dB re V/A]" in gain.get_ylabel()
    assert phase.get_xlabel() == "frequency [Hz]"


def test_a_few_values_of_parameters_are_a_family_of_lines():
    few = tuple(replace(lag(rate), case={"rate": rate}) for rate in (0.1, 10.0))
    gain, *_ = draw(replace(lag(1.0), variations=few)).axes
    texts = [text.get_text() for text in gain.get_legend().get_texts()]
    assert texts == ["at 0 s", "rate = 0.1", "rate = 10"]
    assert len({line.get_color() for line in gain.lines}) == 3
    for line, rate in zip(gain.lines, (1.0, 0.1, 10.0), strict=True):
        frequencies, decibel = line.get_data()
        exact = -10.0 * np.log10(1.0 + (2.0 * np.pi * frequencies / rate) ** 2)
        np.testing.assert_allclose(decibel, exact, atol=1e-9)
        assert frequencies[0] < rate / (2.0 * np.pi) < frequencies[-1]


def test_a_loop_shows_where_its_gain_is_one_and_its_step_when_closed():
    gain, phase, step, _ = draw(lag(1.0, loop="y")).axes
    dot = next(line for line in gain.lines if line.get_marker() == "o")
    assert dot.get_xdata()[0] == pytest.approx(1.0 / (2.0 * np.pi))
    turned = next(line for line in phase.lines if line.get_marker() == "o")
    assert turned.get_ydata()[0] == pytest.approx(-90.0, abs=0.01)
    time, response = step.lines[0].get_data()
    np.testing.assert_allclose(response, 1.0 - np.exp(-time), atol=1e-6)
    assert gain.get_legend() is None


def test_a_sampled_model_is_drawn_in_steps_and_in_the_w_plane(tmp_path):
    one = lag(1.0, period=0.1)
    figure = replace(one, variations=(lag(2.0, period=0.1),)).plot(tmp_path / "p.png")
    plane = figure.axes[3]
    z = np.exp(-0.1)
    assert plane.lines[0].get_xdata().tolist() == pytest.approx([20.0 * (z - 1.0) / (z + 1.0)])
    assert figure.axes[2].lines[0].get_drawstyle() == "steps-post"
    assert (tmp_path / "p.png").stat().st_size > 10_000
    with pytest.raises(UserError, match="must end in"):
        one.plot(tmp_path / "p.doc")
