"""Claims: states are prescribed, cut and left out as arithmetic on paper has it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, State, UserError, sqrt
from fmus.kit.symbolic import trace
from orchestration.linear.blocks import LinearBlocks, SampledUpdate, blocks_of, joined
from orchestration.linear.operating_point import start_point
from orchestration.system import Port, connect
from orchestration.system.model import Connection


class Root(Component):
    """A state whose rate has a slope without bounds at zero."""

    name = "root"
    u = Input("1", doc="input")
    x = State("1", rate="growth", output=True, doc="state")

    def growth(self):
        return sqrt(self.x) + self.u

    @Output("1")
    def double(self):
        """Twice the state."""
        return 2.0 * self.x


def chain():
    """``x' = -x + y + u``, ``y' = 4 x - 2 y``, ``z' = y``; the output is x + y."""
    rates = np.array([[-1.0, 1.0, 0.0, 1.0], [4.0, -2.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    signals = dict(zip("xyzu", np.eye(4), strict=True))
    signals["out"] = np.array([1.0, 1.0, 0.0, 0.0])
    signals["der(x)"] = rates[0]
    return LinearBlocks(("x", "y", "z"), (), ("u",), rates, (), signals)


def test_states_on_no_path_to_an_output_are_left_out():
    kept = chain().between(["u"], ["out"])
    assert kept.states == ("x", "y")
    np.testing.assert_array_equal(kept.rates, [[-1.0, 1.0, 1.0], [4.0, -2.0, 0.0]])
    assert chain().between(["u"], ["z"]).states == ("x", "y", "z")


def test_a_prescribed_state_is_an_input_and_its_own_law_no_longer_counts():
    kept = chain().prescribing(["y"]).between(["y"], ["out", "der(x)"])
    assert (kept.states, kept.inputs) == (("x",), ("y",))
    np.testing.assert_array_equal(kept.rates, [[-1.0, 1.0]])
    np.testing.assert_array_equal(kept.signals["out"], [1.0, 1.0])
    np.testing.assert_array_equal(kept.signals["der(x)"], [-1.0, 1.0])


def test_a_cut_state_is_read_from_an_input_but_by_its_own_law():
    cut = chain().cut_at("y").between(["cut(y)"], ["y"])
    assert cut.states == ("x", "y")
    np.testing.assert_array_equal(cut.rates, [[-1.0, 0.0, 1.0], [4.0, -2.0, 0.0]])


def test_a_cut_hold_keeps_its_own_memory():
    # d = d + x - 3 e, e = d: an integrator that a second state reads
    update = SampledUpdate(
        "c", 1.0, 0.0, (0, 1), np.array([[1.0, 1.0, -3.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    )
    blocks = LinearBlocks(
        ("x",),
        ("d", "e"),
        ("u",),
        np.array([[0.0, 2.0, 0.0, 0.0]]),
        (update,),
        dict(zip(("x", "d", "e", "u"), np.eye(4), strict=True)),
    )
    cut = blocks.cut_at("d")
    np.testing.assert_array_equal(cut.rates, [[0.0, 0.0, 0.0, 0.0, 2.0]])
    np.testing.assert_array_equal(cut.updates[0].matrix[0], [1.0, 1.0, -3.0, 0.0, 0.0])
    np.testing.assert_array_equal(cut.updates[0].matrix[1], [0.0, 0.0, 0.0, 0.0, 1.0])


def test_a_held_connection_is_a_state_of_the_exchange_and_outputs_see_the_newest_value():
    # a.y = x + a.u, b.y = 0.5 b.u, with a.y -> b.u and b.y -> a.u: a.u = x at once
    signals = {
        "x": np.array([1.0, 0.0, 0.0]),
        "a.y": np.array([1.0, 1.0, 0.0]),
        "b.y": np.array([0.0, 0.0, 0.5]),
    }
    blocks = LinearBlocks(("x",), (), ("a.u", "b.u"), np.array([[0.0, 1.0, 0.0]]), (), signals)
    held = blocks.connected(connect("a.y -> b.u", "b.y -> a.u"), 0.1)
    assert (held.discretes, held.inputs) == (("b.u", "a.u"), ())
    by_name = dict(zip(held.discretes, held.updates[0].matrix[:, 0], strict=True))
    assert by_name == {"a.u": pytest.approx(1.0), "b.u": pytest.approx(2.0)}
    np.testing.assert_allclose(held.signals["a.y"], [2.0, 0.0, 0.0])
    blocks.signals["b.y"] = np.array([0.0, 0.0, 1.0])
    with pytest.raises(UserError, match="an algebraic loop without a solution"):
        blocks.connected(connect("a.y -> b.u", "b.y -> a.u"), 0.1)


def test_a_held_connection_has_its_factor():
    # a.y = x + a.u, b.y = 0.5 b.u, with 2 a.y -> b.u and -b.y -> a.u: a.y = x / 2
    signals = {
        "x": np.array([1.0, 0.0, 0.0]),
        "a.y": np.array([1.0, 1.0, 0.0]),
        "b.y": np.array([0.0, 0.0, 0.5]),
    }
    blocks = LinearBlocks(("x",), (), ("a.u", "b.u"), np.array([[0.0, 1.0, 0.0]]), (), signals)
    wires = (
        Connection(Port("a", "y"), Port("b", "u"), 2.0),
        Connection(Port("b", "y"), Port("a", "u"), -1.0),
    )
    held = blocks.connected(wires, 0.1)
    by_name = dict(zip(held.discretes, held.updates[0].matrix[:, 0], strict=True))
    assert by_name == {"a.u": pytest.approx(-0.5), "b.u": pytest.approx(1.0)}


def test_models_side_by_side_are_connected_and_fed():
    # p' = -p + p.u, q = d with d = 2 q.u at a sample; p -> q.u, 3 q -> p.u, and w feeds p.v
    sampled = SampledUpdate("c", 1.0, 0.0, (0,), np.array([[0.0, 2.0]]))
    first = LinearBlocks(
        ("p.x",),
        (),
        ("p.u", "p.v"),
        np.array([[-1.0, 1.0, 5.0]]),
        (),
        dict(zip(("p.x", "p.u", "p.v"), np.eye(3), strict=True)),
    )
    second = LinearBlocks(
        (),
        ("q.d",),
        ("q.u",),
        np.zeros((0, 2)),
        (sampled,),
        dict(zip(("q.d", "q.u"), np.eye(2), strict=True)),
    )
    both = joined([first, second]).fed_by({"w": ["p.v"]})
    assert both.columns == ("p.x", "q.d", "p.u", "q.u", "w")
    wires = (
        Connection(Port("p", "x"), Port("q", "u")),
        Connection(Port("q", "d"), Port("p", "u"), 3.0),
    )
    closed = both.connected(wires)
    assert closed.columns == ("p.x", "q.d", "w")
    np.testing.assert_array_equal(closed.rates, [[-1.0, 3.0, 5.0]])
    np.testing.assert_array_equal(closed.updates[0].matrix, [[2.0, 0.0, 0.0]])
    np.testing.assert_array_equal(closed.signals["p.v"], [0.0, 0.0, 1.0])
    twice = joined([second, replace(second, discretes=("r.d",), inputs=("r.u",))])
    assert [update.rows for update in twice.updates] == [(0,), (1,)]


def test_unknown_signals_and_infinite_derivatives_are_refused():
    with pytest.raises(UserError, match=r"no input or state of this name.*x, y, z") as refusal:
        chain().between(["nothing"], ["out"])
    assert str(refusal.value).count("x, y, z") == 1
    with pytest.raises(UserError, match="no signal of this name"):
        chain().between(["u"], ["nothing"])
    graph = trace(Root)
    with pytest.raises(
        UserError, match=r"der\(x\) has no finite derivative with respect to x at 0"
    ):
        blocks_of(graph, start_point(graph, {}))
    blocks = blocks_of(graph, start_point(graph, {"x": 4.0}))
    assert blocks.rates.tolist() == [[0.25, 1.0]]
    assert blocks.signals["double"].tolist() == [2.0, 0.0]
