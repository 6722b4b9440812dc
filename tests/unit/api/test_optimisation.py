"""Claims: what does not fit is told before anything runs; settings, inputs and times are those of a
simulation.
"""

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import Component, Input, Parameter, State, UserError
from orchestration.fmu.model import find_class


class Lag(Component):
    """A lag of the first order."""

    name = "first_lag"

    tau = Parameter(1.0, "s", min=0.1, max=10, doc="time constant")
    u = Input("1", doc="what it follows")
    x = State("1", rate="rate", output=True, doc="what follows")

    def rate(self):
        """Rate of the lag."""
        return (self.u - self.x) / self.tau


def test_the_best_of_a_run_is_the_closed_form():
    """x = u (1 - exp(-t / tau)) is largest for the shortest time constant."""
    front = ppy.optimise(Lag, {"tau": "0.5..2"}, {"u": 3.0}, maximise="x", stop="1 s")
    assert front.parameters["tau"] == pytest.approx([0.5])
    assert front.values[0, 0] == pytest.approx(3.0 * (1.0 - np.exp(-2.0)), rel=1e-6)
    held = ppy.optimise(Lag, {"tau": "500..2000 ms"}, minimise="x", settings={"u": 3.0}, stop=1.0)
    assert held.values[0, 0] == pytest.approx(3.0 * (1.0 - np.exp(-0.5)), rel=1e-6)


def test_a_component_without_states_is_one_point_in_time():
    front = ppy.optimise("foot_design", {"r_pl": "5..30 mm"}, maximise="toe_stroke")
    assert front.evaluations < 5_000
    assert front.parameters["r_pl"] == pytest.approx([5e-3])
    assert find_class("foot_design")(r_pl=5e-3).toe_stroke() == pytest.approx(front.values[0, 0])


@pytest.mark.parametrize(
    ("over", "options", "said"),
    [
        ({}, {"maximise": "x"}, "no parameter to search"),
        ({"tau": "1..2:5"}, {"maximise": "x"}, "write parameter=from..to"),
        ({"tau": "1, 2"}, {"maximise": "x"}, "write parameter=from..to"),
        ({"u": "1..2"}, {"maximise": "x"}, "write parameter=from..to"),
        ({"tua": "1..2"}, {"maximise": "x"}, "no parameter or input named 'tua'"),
        ({"tau": "1..2"}, {}, "0 objectives"),
        ({"tau": "1..2"}, {"maximise": ["x", "x"], "minimise": "x"}, "3 objectives"),
        ({"tau": "1..2"}, {"maximise": "x", "minimise": "x"}, "x is named by both objectives"),
        ({"tau": "1..2"}, {"maximise": "x", "starts": 8}, "starts=8: from 16 to 1,048,576"),
        ({"tau": "1..2"}, {"maximise": "x", "starts": 17}, "starts=17: a power of 2, such as 256"),
        (
            {"tau": "1..2"},
            {"maximise": "x", "starts": 2**21},
            "starts=2097152: from 16 to 1,048,576",
        ),
        ({"tau": "1..2"}, {"maximise": "x", "starts": 16.5}, "starts=16.5: must be a whole number"),
        ({"tau": "1..2"}, {"maximise": "x", "levels": 1}, "levels=1: from 2 to 10,000"),
        ({"tau": "1..2"}, {"maximise": "x", "levels": 10**9}, "levels=1000000000: from 2 to"),
        ({"tau": "1..2"}, {"maximise": "x", "seed": -1}, "seed=-1: from 0 on"),
        ({"tau": "1..2"}, {"maximise": "y"}, "no output named 'y'"),
        ({"tau": "1..2"}, {"maximise": "x", "settings": {"tau": 1.0}}, "set to one value besides"),
    ],
)
def test_what_does_not_fit_is_told(over, options, said):
    with pytest.raises(UserError, match=said.replace(".", r"\.")):
        ppy.optimise(Lag, over, **options)


def test_an_fmu_without_equations_is_refused(lag):
    with pytest.raises(UserError, match="an FMU without equations; a component can be optimised"):
        ppy.optimise(lag, {"tau": "1..2"}, maximise="x")
