"""Claims: every effect, alone and with all others, is what the table of the README says of it.

It is written out again here: at any instant by root finding, in time by scipy.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fmus.kit import stack
from fmus.kit.integrate import Integrator
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support.completeness import check_complete
from tests.support.effect_samples import ACTIVE, active, bases, effects, random_values
from tests.support.laws import named
from tests.support.source import ROOT

PAPER = f"paper() of {Path(__file__).relative_to(ROOT).as_posix()}"


def root(function, about):
    """Root of a function that rises."""
    width = 1e-3 * (1.0 + abs(about))
    while function(about - width) > 0.0 or function(about + width) < 0.0:
        width *= 4.0
    return brentq(
        function,
        about - width,
        about + width,
        xtol=1e-300,
        rtol=4 * np.finfo(float).eps,
        maxiter=500,
    )


def paper(v):
    """Rates and outputs from the table of the README; ``v`` gives what is there, the rest of the
    effects is absent.
    """
    # an effect that is absent has zeros, but for what its equation divides by
    p = {n: 0.0 for effect in EFFECTS.values() for n in effect.declared}
    p |= {"thermal_resistance": 1.0, "softening_load": 1.0, "fading_load": 1.0}
    p |= {n: 1.0 for n in p if n.endswith(("_time", "_width")) and "lag_time" not in n} | v
    q, i = p["charge"], p["current"]

    # coupling, as layers in the order of the catalogue
    lag = p["lag_time"] + 0.05 * math.exp(-p["lag_time"] / 0.05)
    seen = (
        q - p["hysteresis_share"] * p["trailing_charge"] - p["lag_time"] / lag * p["pending_charge"]
    )
    stage = p["staged_lag_time"] / 2 + 0.05 * math.exp(-p["staged_lag_time"] / 0.1)
    seen -= p["staged_lag_time"] / 2 / stage * (p["first_stage_charge"] + p["second_stage_charge"])
    z = math.sqrt(p["strain_saturation_coefficient"]) * seen
    level = math.tanh(z) / z if z else 1.0
    strain = (p["alpha"] * seen + p["beta"] * seen**2 + p["strain_asymmetry"] * abs(seen)) * level
    strain /= 1.0 + p["strain_levelling"] * abs(seen)

    # mechanics: elongation of the chain as a function of the load, and the load from the length
    soft = math.exp(p["softening_per_charge"] * q)
    creep = p["kelvin_elongation"] + p["maxwell_elongation"]
    creep += p["second_creep_compliance"] * p["second_kelvin_force"]

    def spring(load):
        load = load * (1.0 + p["fading_compliance"] / (1.0 + abs(load) / p["fading_load"]))
        load = load + p["slack_compliance"] * min(load, p["preload"])
        scale = p["softening_load"]
        return soft / p["k1"] * (load + p["load_softening"] * (math.hypot(load, scale) - scale))

    if "force" in p:
        load = pull = p["force"]
        elongation = strain + creep + spring(load)
    else:
        elongation = p["length_change"]
        left = elongation - strain - creep
        pull = root(lambda f: spring(f) - left, p["k1"] * left)
        load = max(pull, 0.0)
    kelvin = (load - p["k2"] / soft * p["kelvin_elongation"]) / p["b2"]
    slower = 1.0 + p["recovery_slowness"] if kelvin < 0.0 else 1.0
    flowing = math.copysign(max(abs(load) - p["yield_force"], 0.0), load)

    # circuit: Kirchhoff's law at the terminal, and what is across the parts between it and the
    # films
    resistance = p["R1"] * (1.0 + p["resistance_growth_rate"] * p["throughput"])
    resistance /= 1.0 + p["conductance_rise_per_kelvin"] * p["temperature_rise"]
    films = q / p["C"] * (1.0 + p["capacitance_fade_rate"] * p["fading_throughput"])
    if a := p["capacitance_falloff"] * q:
        films *= math.expm1(a) / a
    if a := p["capacitance_falloff_either_way"] * abs(q):
        films *= math.expm1(a) / a
    films *= (1.0 + abs(p["capacitance_bend"]) * q**2) ** math.copysign(0.5, p["capacitance_bend"])
    poles = [((2 * k - 1) * math.pi / 2) ** 2 for k in range(1, 6)]
    part = p["diffusion_share"] * resistance
    rest = resistance - part * sum(2.0 / pole for pole in poles)
    loaded = (p["voltage_per_force"] - p["reciprocal"] * p["alpha"]) * load
    behind = films + p["double_layer_resistance"] * p["faradaic_current"] + loaded
    behind += part * sum(
        2.0 / pole * p[f"diffusion_current_{k}"] for k, pole in enumerate(poles, 1)
    )

    def surplus(voltage):
        above = max(abs(voltage) - p["leakage_onset"], 0.0)
        leak = voltage / p["R2"] + math.copysign(p["leakage_growth"] * above**2, voltage)
        return (voltage - behind) / rest + leak - i

    voltage = root(surplus, behind)
    j = (voltage - behind) / rest

    found = {
        "voltage": voltage,
        "electrochemical_displacement": strain,
        "der(charge)": j,
        "mechanical_displacement": creep + spring(load),
        "der(kelvin_elongation)": kelvin / slower,
        "der(maxwell_elongation)": flowing / p["b1"],
        "der(faradaic_current)": (j - p["faradaic_current"]) / p["double_layer_time"],
        "der(throughput)": abs(j),
        "der(fading_throughput)": abs(j),
        "der(temperature_rise)": (
            p["thermal_resistance"] * (voltage * i - films * j) - p["temperature_rise"]
        )
        / p["thermal_time"],
        "der(first_stage_charge)": j - p["first_stage_charge"] / stage,
        "der(second_stage_charge)": (p["first_stage_charge"] - p["second_stage_charge"]) / stage,
        "der(pending_charge)": j - p["pending_charge"] / lag,
        "der(trailing_charge)": j - abs(j) * p["trailing_charge"] / p["hysteresis_width"],
        "der(second_kelvin_force)": (load - p["second_kelvin_force"]) / p["second_creep_time"],
    }
    found |= {
        f"der(diffusion_current_{k})": (j - p[f"diffusion_current_{k}"])
        * pole
        / p["diffusion_time"]
        for k, pole in enumerate(poles, 1)
    }
    found |= {
        "force_margin": p["force_limit"] - load,
        "compression_margin": p["compression_limit"] + pull,
        "displacement_margin": p["displacement_limit"] - abs(elongation),
        "voltage_margin": p["voltage_limit"] - abs(voltage),
    }
    total = {"displacement": strain + creep + spring(load)} if "force" in p else {"tension": load}
    return found | total


def check_against_paper(cls, values):
    found, expected = named(cls, values), paper(values)
    check_complete([n for n in expected if n in found], found, f"what {PAPER} finds")
    # below these, terms have cancelled: metres, and volts, amperes and newtons
    floors = {True: 1e-13, False: 1e-10 * (1.0 + abs(values["charge"]) + abs(values["current"]))}
    for name, value in found.items():
        floor = floors["elongation" in name or "displacement" in name]
        same = value == pytest.approx(expected[name], rel=1e-9, abs=floor)
        assert same, (
            f"{name} = {value!r}, where {PAPER} has {expected[name]!r}: the equation of every"
            " effect goes there, written anew"
        )


@bases
@effects
@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_an_effect_is_what_the_readme_says(base, name, seed):
    cls = stack(base, EFFECTS[name])
    check_against_paper(cls, random_values(cls, seed) | ACTIVE[name])


@bases
@settings(max_examples=100)
@given(seed=st.integers(0, 2**32 - 1))
def test_all_effects_together_are_what_the_readme_says(base, seed):
    cls = stack(base, *EFFECTS.values())
    check_against_paper(cls, random_values(cls, seed) | active(EFFECTS))


@pytest.mark.slow
@bases
def test_all_effects_together_run_as_scipy_integrates_them(base):
    cls = stack(base, *EFFECTS.values())
    values = active(EFFECTS) | {"b1": 1e5, "b2": 1e5}  # to creep within seconds
    given = {p.name: float(p.start) for p in cls.layout.parameters} | values
    states = [s.name for s in cls.layout.states]
    model = cls(**values)
    integrator, expected, size = Integrator(model), np.zeros(len(states)), np.zeros(len(states))
    nominal = np.array([s.nominal for s in cls.layout.states])
    for k in range(8):
        inputs = {"current": 0.9 if k % 6 < 3 else -0.7}
        pulled = k % 8 < 5
        inputs |= (
            {"force": 2.0 * pulled} if base is PpyActuator else {"length_change": 8e-4 * pulled}
        )
        for name, value in inputs.items():
            setattr(model, name, value)
        integrator.advance(k * 0.5, 0.5)

        def law(t, y, inputs=inputs):
            rates = paper(given | inputs | dict(zip(states, y, strict=True)))
            return [rates[f"der({name})"] for name in states]

        expected = solve_ivp(law, (0.0, 0.5), expected, rtol=1e-8, atol=1e-11).y[:, -1]
        size = np.maximum(size, np.abs(expected))
        found = np.array([getattr(model, name) for name in states])
        close = np.abs(found - expected) <= 1e-7 * (nominal + size)
        others = [name for name, same in zip(states, close, strict=True) if not same]
        assert not others, f"step {k}: {', '.join(others)}: not what {PAPER} gives, integrated"
    idle = [name for name, most in zip(states, size > 0.01 * nominal, strict=True) if not most]
    assert not idle, f"every state takes part, but {', '.join(idle)}"
