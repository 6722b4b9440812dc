"""Claims: members step and exchange values in the order of their dependencies."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.master import run
from tests.support.master.circle import DECAY, TAU, TIME, lag
from tests.support.master.samples import ring


def test_who_feeds_steps_first(member):
    """A chain that is written down backwards: every member sees the newest."""
    parameters = {name: {"tau": TAU["a"]} for name in "cba"}
    result = run(
        ring(member, parameters, "a.x -> b.u; b.x -> c.u", u="a.u"), TIME, {"u": np.ones(TIME.size)}
    )
    x = np.zeros(3)
    for k in range(TIME.size):
        assert [result.signals[f"{name}.x"][k] for name in "abc"] == pytest.approx(x, abs=1e-14)
        for i in range(3):
            x[i] = lag(x[i], x[i - 1] if i else 1.0, DECAY["a"])


def test_outputs_show_the_inputs_of_the_same_point(member):
    """Through two members at once: y = d u, and the next one's y too; the first point included."""
    system = ring(
        member, {"b": {"c": 0.0, "d": 3.0}, "a": {"c": 0.0, "d": 2.0}}, "a.y -> b.u + 1", u="a.u"
    )
    u = np.sin(TIME) + 0.5
    result = run(system, TIME, {"u": u}, record=["b.y", "a.u", "b.u"])
    assert result.signals["b.y"] == pytest.approx(3 * (2 * u + 1), abs=1e-14)
    assert result.signals["a.u"].tolist() == u.tolist()
    assert result.signals["b.u"] == pytest.approx(2 * u + 1, abs=1e-14)


def test_without_feedthrough_an_output_is_a_step_late(member):
    system = ring(
        member, {"a": {"c": 0.0, "d": 2.0}, "b": {"c": 0.0, "d": 3.0}}, "a.y -> b.u", u="a.u"
    )
    u = np.sin(TIME) + 0.5
    result = run(system, TIME, {"u": u}, method="jacobi", feedthrough=False)
    assert result.signals["a.y"][1:] == pytest.approx(2 * u[:-1], abs=1e-14)
    assert result.signals["b.y"][2:] == pytest.approx(6 * u[:-2], abs=1e-14)
