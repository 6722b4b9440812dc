"""Claims: states that hand a value on at samples are an array; all others are variables."""

import fmus
from fmus.kit import Array, Component, Discrete, Input
from fmus.kit.modelica.model import trace_model
from fmus.kit.modelica.registers import Register, registers
from fmus.kit.symbolic import trace


class Chain(Component):
    """Three values that follow one another, and three that do not."""

    name = "chain"
    signal = Input("V")
    old = Array(Discrete("V", update="next_old", period=0.5, doc="past"), 3, starts=(1.0, 2.0, 3.0))
    sum = Array(Discrete("V", update="next_sum", period=0.5), 3)

    def next_old(self, age):
        return 2.0 * self.signal if age == 1 else self.old[age - 1]

    def next_sum(self, place):
        before = self.sum[place - 1] if place > 1 else self.signal
        return self.sum[1] + self.sum[2] if place == 2 else before


def test_only_what_is_handed_on_unchanged_is_a_register():
    assert registers(trace(Chain)) == [Register("old", 3)]
    found = registers(trace(fmus.component("learning_controller")))
    assert found == [Register("lesson", 41), Register("learnt", 41)]


def test_a_register_is_an_array_in_declarations_and_equations():
    lines = [line.strip() for line in trace_model(Chain).text().splitlines()]
    for line in (
        'parameter Real old_start[3](each unit="V") = {1.0, 2.0, 3.0}'
        ' "values of old at the start";',
        'Real old[3](start=old_start, each fixed=true, each unit="V") "past";',
        "old = cat(1, {2.0 * pre(signal)}, pre(old[1:2]));",
        "sum_1 = pre(signal);",
        "sum_2 = pre(sum_1) + pre(sum_2);",
    ):
        assert line in lines, line
    assert not [line for line in lines if "old_1" in line or "old[1]" in line]
