"""Shared laws are computed once in an evaluation, and never kept beyond one. Oracle: by hand."""

from __future__ import annotations

import math
from array import array

import pytest

from fmus.kit import Component, Effect, Integrator, Output, Parameter, State, shared, stack
from fmus.kit.sharing import has_shared_laws
from fmus.kit.slave import Slave

CALLS: list[float] = []


class Pair(Component):
    """Two states that both rise with a speed, the second at half of it."""

    name = "pair"

    factor = Parameter(2.0, "1", min=0, max=9, doc="speed")
    first = State("1", rate="first_rate", output=True, doc="one")
    second = State("1", rate="second_rate", output=True, doc="the other")

    @shared
    def speed(self):
        CALLS.append(self.first)
        if self.factor > 8.0:
            raise ZeroDivisionError
        return self.factor + 0.0 * self.first

    def first_rate(self):
        return self.speed()

    def second_rate(self):
        return 0.5 * self.speed()

    @Output("1")
    def total(self):
        """Both speeds"""
        return self.first_rate() + self.second_rate()


class Faster(Effect):
    """A speed that is greater by a constant; ``more = 0`` is the base model."""

    id = "faster"
    neutral = "more"
    more = Parameter(0.0, "1", min=0, max=9, doc="what is added")

    def speed(self):
        return super().speed() + self.more


@pytest.fixture(autouse=True)
def _no_calls():
    CALLS.clear()


def test_a_step_computes_it_once_in_each_of_five_stages():
    model = Pair()
    Integrator(model).advance(0.0, 1.0)
    assert (model.first, model.second) == pytest.approx((2.0, 1.0))
    assert pytest.approx([0.0, 1.0, 1.0, 2.0, 1.5]) == CALLS  # where Zonneveld's stages are


def test_outside_of_an_evaluation_every_call_computes():
    model = Pair()
    assert model.outputs()[-1] == 3.0
    model.factor = 4.0
    assert model.outputs()[-1] == 6.0
    assert len(CALLS) == 4


def test_nothing_is_kept_after_a_step():
    model = Pair()
    Integrator(model).advance(0.0, 1.0)
    model.factor = 4.0
    assert model.rates() == [4.0, 2.0]


def test_nothing_is_kept_after_a_step_that_fails():
    model = Pair(factor=9.0)
    with pytest.raises(Exception, match="not finite"):
        Integrator(model).advance(0.0, 1.0)
    for factor in (4.0, 6.0):
        model.factor = factor
        assert model.rates() == [factor, 0.5 * factor]


def test_a_python_fmu_keeps_it_within_one_evaluation():
    places = {name: i for i, name in enumerate(Pair.layout.names)}
    memory = array("d", [0.0] * len(places) + [math.inf, 0.0, Pair.tolerance, 1.0])
    memory[places["factor"]] = 2.0
    slave = Slave(Pair, memoryview(memory))
    assert slave.evaluate(0.0) is None
    assert memory[places["total"]] == 3.0
    assert len(CALLS) == 1
    for factor in (4.0, 6.0):
        slave.component.factor = factor
        assert slave.component.outputs()[-1] == 1.5 * factor


def test_an_effect_that_overrides_it_shares_what_is_below():
    model = stack(Pair, Faster)(more=1.0)
    Integrator(model).advance(0.0, 1.0)
    assert (model.first, model.second) == pytest.approx((3.0, 1.5))
    assert len(CALLS) == 5


def test_which_classes_have_some():
    assert has_shared_laws(Pair)
    assert has_shared_laws(stack(Pair, Faster))
    assert not has_shared_laws(Component)
