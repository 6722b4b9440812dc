"""Claims: components have one digest where their laws and variables are the same, and only there.

Oracle: the laws, which are written down here twice or with one thing changed.
"""

from __future__ import annotations

import pytest

from fmus import MODELS, component, effects
from fmus.kit import Component, Input, Output, Parameter, State, stack
from fmus.kit.declare import Discrete
from fmus.kit.symbolic import trace
from tests.support.hosts import in_subprocess
from tests.support.pace import FREE_FEET, slow_but


def lag(gain=2.0, period=0.5, largest=10.0, start=0.0, unit="s", exact=1e-6):
    """Return a lag whose input is sampled, anew at each call."""

    class Lag(Component):
        """A lag."""

        name = "lag"
        tolerance = exact
        u = Input("1", start=start)
        tau = Parameter(1.0, unit, min=0.1, max=largest)
        x = State("1", rate="rate")
        held = Discrete("1", update="hold", period=period)

        def hold(self):
            return self.u

        def rate(self):
            return (gain * self.held - self.x) / self.tau

        @Output("1")
        def y(self):
            """Output."""
            return self.x

    return Lag


def digest(cls):
    return trace(cls).digest


def test_the_same_laws_have_the_same_digest():
    assert digest(lag()) == digest(lag())


@pytest.mark.parametrize(
    "change",
    [
        {"gain": 2.0 + 4e-16},
        {"period": 0.25},
        {"largest": 20.0},
        {"start": 1.0},
        {"unit": "min"},
        {"exact": 1e-7},
    ],
    ids=lambda change: next(iter(change)),
)
def test_anything_else_in_them_gives_another(change):
    assert digest(lag(**change)) != digest(lag())


def test_a_law_of_an_output_enters():
    class Negated(lag()):
        def y(self):
            return -self.x

    assert digest(Negated) != digest(lag())


@pytest.mark.parametrize(
    "name",
    slow_but(
        [name for name in MODELS if name not in FREE_FEET],
        *(name for name in MODELS if not name.startswith("foot_")),
    ),
)
def test_values_that_parameters_start_with_do_not_enter(name):
    """For any component of ours and each of its effects."""
    base = component(name)
    stacks = [base, *(stack(base, effect) for effect in effects(name).values())]
    for cls in stacks:
        others = dict(moved(cls))
        assert others
        assert digest(stack(cls, defaults=others)) == digest(cls), cls.name


def moved(cls):
    """Yield parameters with another value that each may have."""
    for parameter in (*cls.layout.parameters, *cls.layout.texts):
        start = parameter.start
        if parameter.type == "real" and parameter.name not in cls.layout.clock_parameters:
            changed = 0.9 * start or 0.01 * min(parameter.max, parameter.nominal)
            if parameter.min <= changed <= parameter.max:
                yield parameter.name, changed


def test_effects_of_a_component_have_digests_of_their_own():
    base = component("ppy_actuator")
    found = [digest(stack(base, effect)) for effect in effects("ppy_actuator").values()]
    assert len({*found, digest(base)}) == len(found) + 1


def of_actuator():
    return digest(component("ppy_actuator"))


def test_another_process_has_the_same(monkeypatch):
    monkeypatch.setenv("PYTHONHASHSEED", "4711")
    assert in_subprocess(of_actuator) == (0, of_actuator())
