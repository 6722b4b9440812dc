"""Samples of the actuator's effects: values at which each is active, and its laws evaluated by
name.
"""

import numpy as np
import pytest

from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator, PpyActuatorLengthDriven
from tests.support.laws import named

BASES = [PpyActuator, PpyActuatorLengthDriven]
NEUTRAL = {name: effect.neutral for name, effect in EFFECTS.items()}
# values at which an effect acts more, on other signs or within less time than at its nominal ones
_OTHER_VALUES = {
    "double_layer": {"double_layer_resistance": 0.2, "double_layer_time": 0.3},
    "diffusion": {"diffusion_share": 0.6, "diffusion_time": 7.0},
    "nonlinear_leakage": {"leakage_growth": 0.3, "leakage_onset": 0.5},
    "charge_dependent_capacitance": {"capacitance_falloff": 0.15},
    "charge_dependent_capacitance(modulus)": {"capacitance_falloff_either_way": -0.12},
    "charge_dependent_capacitance(even)": {"capacitance_bend": -0.07},
    "resistance_growth": {"resistance_growth_rate": 0.02},
    "capacitance_fade": {"capacitance_fade_rate": 0.01},
    "self_heating": {
        "conductance_rise_per_kelvin": 0.02,
        "thermal_resistance": 30.0,
        "thermal_time": 40.0,
    },
    "force_to_voltage": {"voltage_per_force": 0.03},
    "quadratic_strain": {"beta": 7e-6},
    "quadratic_strain(modulus)": {"strain_asymmetry": 9e-6},
    "strain_saturation": {"strain_saturation_coefficient": 0.4**2},
    "strain_saturation(slow)": {"strain_levelling": 0.2},
    "strain_lag": {"lag_time": 1.5},
    "strain_lag(two_stages)": {"staged_lag_time": 1.3},
    "strain_hysteresis": {"hysteresis_share": 0.3, "hysteresis_width": 0.4},
    "charge_dependent_stiffness": {"softening_per_charge": 0.1},
    "second_kelvin": {"second_creep_compliance": 4e-5, "second_creep_time": 8.0},
    "nonlinear_stiffness": {"load_softening": 0.4, "softening_load": 1.2},
    "asymmetric_creep": {"recovery_slowness": 0.7},
    "yield_threshold": {"yield_force": 0.6},
    "slack": {"slack_compliance": 1.5, "preload": 0.8},
    "slack(smooth)": {"fading_compliance": 1.2, "fading_load": 0.6},
}


def nominal_values(effect):
    """Its own parameters: where they start, or of a size that is nominal."""
    own = [p for p in effect.layout.parameters if p.name in effect.declared]
    return {p.name: p.start or p.nominal for p in own}


ACTIVE = {name: _OTHER_VALUES.get(name, nominal_values(e)) for name, e in EFFECTS.items()}
POSITIVE = ("throughput", "fading_throughput", "temperature_rise")
bases = pytest.mark.parametrize("base", BASES, ids=lambda cls: cls.name)
effects = pytest.mark.parametrize("name", EFFECTS)


def random_values(cls, seed, size=None):
    """Parameters about their defaults, and any state and input; the length-driven one taut as often
    as slack.
    """
    rng = np.random.default_rng(seed)
    values = {}
    for v in cls.layout.parameters:
        values[v.name] = np.abs(v.start) * rng.uniform(0.3, 3.0, size)
    for v in (*cls.layout.inputs, *cls.layout.states):
        values[v.name] = v.nominal * rng.normal(size=size) * 3.0
    for name in POSITIVE:
        if name in values:
            values[name] = np.abs(values[name]) * 10.0
    return values if size else {name: float(value) for name, value in values.items()}


def active(names):
    """Parameter values at which the named effects are all active."""
    return {parameter: value for name in names for parameter, value in ACTIVE[name].items()}


def changed_with_law(base, law, seeds=50):
    """Names of the rates and outputs of a component that change where one of its laws does."""

    def other(self, *arguments):
        return getattr(base, law)(self, *arguments) * 1.01 + 1e-4

    nudged = type("Nudged", (base,), {law: other})
    found = set()
    for seed in range(seeds):
        values = random_values(base, seed)
        plain = named(base, values)
        changed = named(nudged, values)
        found |= {n for n in plain if plain[n] != pytest.approx(changed[n], rel=1e-9, abs=1e-15)}
    return found
