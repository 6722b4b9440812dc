"""Claims: states that hand a value on at samples are an array; all others are variables."""

import fmus
from fmus.kit import Component, Discrete, Input
from fmus.kit.modelica.model import model_text
from fmus.kit.modelica.registers import Register, registers
from fmus.kit.symbolic import trace


class Chain(Component):
    """Three values that follow one another, and three that do not."""

    name = "chain"
    signal = Input("V")
    old_1 = Discrete("V", update="next_old_1", period=0.5, start=1.0, doc="signal, 1 ago")
    old_2 = Discrete("V", update="next_old_2", period=0.5, start=2.0, doc="signal, 2 ago")
    old_3 = Discrete("V", update="next_old_3", period=0.5, start=3.0, doc="signal, 3 ago")
    sum_1 = Discrete("V", update="next_sum_1", period=0.5)
    sum_2 = Discrete("V", update="next_sum_2", period=0.5)
    sum_3 = Discrete("V", update="next_sum_3", period=0.5)

    def next_old_1(self):
        return 2.0 * self.signal

    def next_old_2(self):
        return self.old_1

    def next_old_3(self):
        return self.old_2

    def next_sum_1(self):
        return self.signal

    def next_sum_2(self):
        return self.sum_1 + self.sum_2

    def next_sum_3(self):
        return self.sum_2


def test_only_what_is_handed_on_unchanged_is_a_register():
    assert registers(trace(Chain)) == [Register("old", 3)]
    found = registers(trace(fmus.component("learning_controller")))
    assert found == [Register("lesson", 41), Register("learnt", 41)]


def test_a_register_is_an_array_in_declarations_and_equations():
    lines = [line.strip() for line in model_text(Chain).splitlines()]
    for line in (
        'parameter Real old_start[3](each unit="V") = {1.0, 2.0, 3.0}'
        ' "values of old at the start";',
        'Real old[3](start=old_start, each fixed=true, each unit="V") "signal, the newest first";',
        "old = cat(1, {2.0 * pre(signal)}, pre(old[1:2]));",
        "sum_1 = pre(signal);",
        "sum_2 = pre(sum_1) + pre(sum_2);",
    ):
        assert line in lines, line
    assert not [line for line in lines if "old_1" in line]
