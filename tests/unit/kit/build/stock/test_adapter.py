"""Claims: a slave of pythonfmu has starts that follow parameters, and a state that can be restored.

Whole archives, in processes of their own, are in `tests/contract/test_stock.py`.
"""

from __future__ import annotations

import math

import pytest

from fmus.kit.slave import Slave

pytest.importorskip("pythonfmu", reason="pythonfmu is not installed")

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.build.stock.adapter import ComponentSlave


class Lag(Component):
    """A first-order lag: x = u + (x0 - u) exp(-t / tau)."""

    name = "lag"
    tau = Parameter(2.0, "s", min=0.1, max=10.0)
    u = Input("1")
    x = State("1", rate="x_rate", start=0.5)

    def x_rate(self):
        return (self.u - self.x) / self.tau

    @Output("1")
    def twice(self):
        return 2.0 * self.x


class LagSlave(ComponentSlave):
    model = Lag

    @staticmethod
    def create(memory, texts):
        return Slave(Lag, memory, texts)


class Instance:
    """An instance whose variables are set and read as pythonfmu does."""

    def __init__(self):
        self.slave = LagSlave(instance_name="one", resources="")
        self.variables = {v.name: v for v in self.slave.vars.values()}

    def set(self, name, value):
        self.variables[name].setter(value)

    def get(self, name):
        return self.variables[name].getter()

    def start(self):
        self.slave.setup_experiment(0.0, None, 1e-9)
        self.slave.exit_initialization_mode()
        return self


@pytest.fixture
def one():
    return Instance()


def test_states_follow_their_start_values_until_initialization_ends(one):
    one.set("x_start", 0.75)
    assert (one.get("x"), one.get("twice")) == (0.75, 1.5)
    assert one.start().get("twice") == 1.5


def test_steps_are_those_of_the_closed_form(one):
    one.set("u", 1.0)
    one.start()
    for k in range(10):
        assert one.slave.do_step(0.1 * k, 0.1)
    exact = 1.0 - 0.5 * math.exp(-1.0 / 2.0)
    assert one.get("x") == pytest.approx(exact, rel=1e-8)
    assert one.get("twice") == 2.0 * one.get("x")
    assert one.get("der(x)") == pytest.approx((1.0 - exact) / 2.0, rel=1e-6)


def test_a_restored_state_takes_the_same_steps(one):
    one.set("u", 1.0)
    one.start().slave.do_step(0.0, 0.1)
    saved = one.slave._get_fmu_state()
    ends = []
    for _ in range(2):
        one.slave._set_fmu_state(saved)
        assert one.slave.time == 0.1
        one.slave.do_step(0.1, 0.3)
        ends.append(one.get("x"))
    assert ends[0] == ends[1]


@pytest.mark.parametrize(("wanted", "used"), [(1e-9, 1e-9), (1e-30, 1e-12), (1.0, Lag.tolerance)])
def test_a_host_can_ask_for_more_accuracy_and_not_for_less(one, wanted, used):
    one.slave.setup_experiment(0.0, None, wanted)
    assert one.slave.memory[one.slave.size + 2] == used  # fmi/engine.h: internal number 2


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("u", math.nan, "^u = nan is not finite$"),
        ("tau", 3.0, "^tau cannot be set after initialization$"),
    ],
)
def test_no_number_and_a_fixed_parameter_after_initialization_are_refused(one, name, value, words):
    one.start()
    with pytest.raises(ValueError, match=words):
        one.set(name, value)


def test_a_parameter_out_of_range_is_named_with_the_range(one):
    one.set("tau", 20.0)
    with pytest.raises(RuntimeError, match=r"^parameter 'tau' = 20 s is outside \[0.1, 10\]$"):
        one.start()


def test_a_law_that_raises_is_told_with_doubled_per_cents(one, monkeypatch):
    """pythonfmu passes the text on as a format."""
    one.start()
    monkeypatch.setattr(one.slave.slave, "advance", lambda time, step: "100 % broken")
    with pytest.raises(RuntimeError, match=r"^100 %% broken$"):
        one.slave.do_step(0.0, 0.1)
