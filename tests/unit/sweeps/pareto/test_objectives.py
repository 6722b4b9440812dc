"""Claims: objectives are the ends of runs, their derivatives exact over shares of any range."""

import numpy as np
import pytest

from fmus.kit import Component, Output, Parameter, UserError, stack
from orchestration.sweeps.pareto import Objective, Objectives, read_objective
from orchestration.sweeps.ranges import Range


def test_values_and_derivatives_are_the_closed_form(decay):
    """y = g + (1 - g) exp(-2 / tau), with tau by equal ratios."""
    share = np.array([0.3, 0.6])
    tau, gain = 0.1 * 100.0 ** share[0], 0.2 + 0.6 * share[1]
    left = np.exp(-2.0 / tau)
    (values,), (slopes,) = decay.evaluate(share)
    assert values == pytest.approx([-(gain + (1.0 - gain) * left)], rel=1e-7)
    by_tau = (1.0 - gain) * left * 2.0 / tau**2 * tau * np.log(100.0)
    by_gain = (1.0 - left) * 0.6
    assert slopes[0] == pytest.approx([-by_tau, -by_gain], rel=1e-6)
    assert decay.parameters(share) == pytest.approx({"tau": tau, "gain": gain})
    assert decay.nominal() == pytest.approx([-1.0])


def test_a_point_that_was_just_computed_is_not_run_again(decay):
    for share in ([0.1, 0.1], [0.1, 0.1], [0.2, 0.1]):
        decay.worst(np.array(share))
        decay.evaluate(np.array(share))
    assert decay.evaluations == 2


def test_a_run_that_fails_is_the_worst_there_is(decay):
    assert decay.worst(np.array([np.nan, 0.1])) == pytest.approx([-np.inf])


def test_the_worst_of_several_is_one_objective():
    units = {"a": "N", "b": "N", "c": "m"}
    found = read_objective("a & b", 1.0, units, "maximise")
    assert (found.outputs, found.unit, found.name) == (("a", "b"), "N", "a & b")
    with pytest.raises(UserError, match="no output named 'aa'"):
        read_objective("aa", 1.0, units, "maximise")
    with pytest.raises(
        UserError, match="the worst of several outputs needs equal units, not N and m"
    ):
        read_objective("a & c", 1.0, units, "maximise")


class SlantedLine(Component):
    """A line."""

    name = "line"
    slope = Parameter(1.0, "1", doc="slope")
    offset = Parameter(0.0, "1", doc="offset")

    @Output("1")
    def height(self):
        """Height."""
        return self.slope + self.offset


class Reworded(SlantedLine):
    """The same laws in other words."""


class Doubled(SlantedLine):
    """Another law."""

    @Output("1")
    def height(self):
        """Height."""
        return 2.0 * self.slope + self.offset


def test_a_model_is_known_by_its_laws_and_by_the_values_it_starts_with():
    def digests(cls):
        slope = Range("slope", "1", np.array([0.0, 1.0]), False, counted=False)
        height = Objective(("height",), "1", 1.0)
        return Objectives(cls, [slope], [height], np.zeros(1), {}, {}).digests()

    known = digests(SlantedLine)
    assert digests(Reworded) == known
    for other in (Doubled, stack(SlantedLine, name="line", defaults={"offset": 1.0})):
        told = digests(other)
        assert [part for part in known if told[part] != known[part]] == ["the model"]
