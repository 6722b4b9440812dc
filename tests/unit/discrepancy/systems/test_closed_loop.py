"""A loop of two members as one component: held against the matrix exponential of both."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from fmus.kit import Component, Input, Output, Parameter, State, UserError, maximum
from fmus.kit.record.compiled import CompiledModel
from orchestration.discrepancy.systems.closed_loop import close_loop, without_limits
from orchestration.system import connect

STEP = 0.1
TIME = STEP * np.arange(50)


class Lag(Component):
    """A lag that follows its input but for a load."""

    name = "lag"
    tau = Parameter(0.5, "s", min=1e-3)
    drive = Input("1")
    load = Input("1")
    x = State("1", rate="rate")

    def rate(self):
        return (self.drive - self.load - self.x) / self.tau

    @Output("1")
    def y(self):
        """Its state."""
        return self.x


class Spring(Component):
    """What pushes back, and slackens, with a state of its own."""

    name = "spring"
    k = Parameter(2.0, "1", min=0)
    bias = Input("1")
    length = Input("1")
    creep = State("1", rate="creep_rate", start=0.1)
    limits = {"force": "taut_force"}

    def taut_force(self):
        return self.k * (self.length - self.creep) + self.bias

    def force(self):
        return maximum(self.taut_force(), 0.0)

    def creep_rate(self):
        return self.force()

    @Output("1")
    def push(self):
        """Its force."""
        return self.force()


CONNECTIONS = connect("lag.y -> spring.length", "spring.push -> lag.load")


def closed(partner=Spring):
    return close_loop("lag", Lag, {"spring": partner}, CONNECTIONS)


def test_a_closed_loop_runs_like_both_together():
    """The drive is held from sample to sample, and the spring is taut throughout."""
    cls = closed()
    assert [v.name for v in cls.layout.inputs] == ["drive", "spring_bias"]
    assert {"tau", "spring_k", "spring_creep_start"} <= set(cls.layout.parameter_index)
    drive = 2.0 + TIME + 0.1 * np.sin(TIME)
    values = {"tau": 0.3, "spring_k": 1.5}
    run = CompiledModel(cls).run(TIME, {"drive": drive, "spring_bias": 0.4 + 0 * TIME}, values)
    # states x and creep; inputs drive and bias
    slopes = np.array([[-2.5 / 0.3, 1.5 / 0.3, 1 / 0.3, -1 / 0.3], [1.5, -1.5, 0.0, 1.0]])
    flow = expm(STEP * np.vstack([slopes, np.zeros((2, 4))]))[:2]
    state = np.array([0.0, 0.1])
    for k in range(TIME.size):
        assert run.signals["y"][k] == pytest.approx(state[0], abs=1e-6)
        force = 1.5 * (state[0] - state[1]) + 0.4
        assert force > 0.0
        assert run.signals["spring_push"][k] == pytest.approx(force, abs=1e-6)
        state = flow @ np.array([*state, drive[k], 0.4])


def test_a_limit_that_is_left_out_changes_only_what_reaches_it():
    free = closed(without_limits(Spring))
    for bias, is_reached in ((0.4, False), (-3.0, True)):
        inputs = {"drive": 2.0 + 0 * TIME, "spring_bias": bias + 0 * TIME}
        limited, unlimited = (
            CompiledModel(cls).run(TIME, inputs).signals["spring_push"] for cls in (closed(), free)
        )
        assert np.allclose(limited, unlimited, atol=1e-6) is not is_reached


def test_names_that_would_mean_two_variables_are_refused():
    class Other(Lag):
        """A lag with a parameter called like one of the spring in its loop."""

        spring_k = Parameter(1.0, "1")

    with pytest.raises(UserError, match="'spring_k' would mean two variables"):
        close_loop("lag", Other, {"spring": Spring}, CONNECTIONS)
