"""Claims: a class of a component comes out of a pickle as it went in, in this process."""

from __future__ import annotations

import copy
import pickle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.controllers.effects import computational_delay
from fmus.controllers.pid import Pid
from fmus.kit import UserError, registry, stack
from fmus.kit.generic import coulomb_friction
from fmus.kit.inputs import input_offset
from fmus.kit.law_terms import LawTerm, law_term_effect
from fmus.kit.sampling import Sampling
from fmus.kit.sensors import sensor_drift, sensor_lag, transport_delay
from fmus.ppy_actuator import PpyActuator
from tests.support.oscillator_model import Oscillator

DRY = LawTerm("friction", "velocity", "dry", "none", "a1", "N", "m/s", size=5.0, scale=1.0)
CATALOGUE = registry.effects("ppy_actuator")


def facts(cls):
    """Return what people and laws can tell of a class."""
    names = ("name", "remark", "experiment", "tolerance", "__name__", "__doc__", "__module__")
    defaults = {p.name: (p.start, p.unit, p.doc) for p in cls.layout.parameters}
    inputs = {v.name: 0.3 for v in cls.layout.inputs}
    model = cls(**inputs)
    return [getattr(cls, name) for name in names], defaults, model.outputs(), model.rates()


def here(cls):
    return pickle.loads(pickle.dumps(cls))


MADE = [
    stack(PpyActuator, defaults={"R1": 0.7}),
    stack(PpyActuator, sensor_lag(PpyActuator, "voltage", Sampling(0.1, 60.0)), name="late"),
    stack(stack(Oscillator, input_offset(Oscillator, "force"), defaults={"mass": 2.0})),
    stack(Oscillator, coulomb_friction(Oscillator, "friction", "velocity")),
    stack(Oscillator, law_term_effect(Oscillator, "friction", DRY)),
    stack(
        Oscillator,
        transport_delay(Oscillator, "position"),
        sensor_drift(Oscillator, "position"),
        name="read_late",
    ),
    stack(Pid, computational_delay(Pid, "issued_voltage", "V")),
]


@pytest.mark.parametrize("cls", MADE, ids=lambda cls: cls.__name__)
def test_a_class_that_was_made_is_made_again(cls):
    cls.remark = "Fitted to a record."
    again = here(cls)
    assert again is not cls
    assert facts(again) == facts(cls)
    assert copy.deepcopy(cls) is cls


def test_a_class_of_a_module_is_itself():
    assert here(PpyActuator) is PpyActuator
    assert all(here(effect) is effect for effect in (*MADE[0].__mro__[1:-1],))


def test_the_description_of_an_effect_stays():
    effect = coulomb_friction(Oscillator, "friction", "velocity")
    again = here(effect)
    for name in ("id", "title", "assumption", "term", "neutral", "output", "__doc__"):
        assert getattr(again, name) == getattr(effect, name)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.sampled_from(sorted(CATALOGUE)), max_size=4, unique=True))
def test_any_effects_of_the_catalogue_can_be_pickled_together(names):
    try:
        cls = stack(PpyActuator, *(CATALOGUE[name] for name in names))
    except UserError:  # two that no model can have at once
        return
    if any(CATALOGUE[name].is_random for name in names):
        assert here(cls).layout == cls.layout
    else:
        assert facts(here(cls)) == facts(cls)
