"""Claims: a graph is extended by the derivatives of its states by parameters, or refused.

Oracle: the variational equations of a decay, written by hand.
"""

import casadi as ca
import pytest

from fmus.kit import Component, Output, Parameter, State, UserError
from fmus.kit.symbolic.sensitivity import with_sensitivities
from fmus.kit.symbolic.tracing import trace
from tests.support.kit_samples import Thermostat


class Decay(Component):
    name = "decay"

    a = Parameter(0.5, "1/s")
    gain = Parameter(3.0, "1")
    x = State("V", rate="x_rate", start=2.0, nominal=4.0)

    def x_rate(self):
        return -self.a * self.x

    @Output("V")
    def y(self):
        return self.gain * self.x


def test_the_variational_equations_are_those_of_paper():
    graph = with_sensitivities(trace(Decay), ["a", "x_start"])
    names = ["x", "d(x)/d(a)", "d(x)/d(x_start)"]
    assert [s.name for s in graph.layout.states] == names
    assert [s.nominal for s in graph.layout.states] == [4.0, 8.0, 2.0]
    assert [o.name for o in graph.layout.outputs] == ["y", "d(y)/d(a)", "d(y)/d(x_start)"]
    starts = {p.name: p.start for p in graph.layout.parameters}
    assert starts["d(x)/d(a)_start"] == 0.0
    assert starts["d(x)/d(x_start)_start"] == 1.0
    x, by_a, by_start, a, gain = 1.5, -0.25, 0.75, 0.5, 3.0
    values = ca.Function("values", graph.arguments, [graph.rates, graph.outputs])
    rates, outputs = values(0.0, [a, gain, 2.0, 0.0, 1.0], [], [x, by_a, by_start], [])
    assert rates.full()[:, 0] == pytest.approx([-a * x, -x - a * by_a, -a * by_start])
    assert outputs.full()[:, 0] == pytest.approx([gain * x, gain * by_a, gain * by_start])


def test_parameters_without_a_derivative_are_refused():
    with pytest.raises(UserError, match=r"decay: no parameter named 'b'; there are: a, gain"):
        with_sensitivities(trace(Decay), ["b"])
    with pytest.raises(
        UserError, match="no sensitivity to 'sampling', which moves sample instants"
    ):
        with_sensitivities(trace(Thermostat), ["sampling"])
