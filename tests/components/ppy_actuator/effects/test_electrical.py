"""Claims: double layer and diffusion have their impedances, a capacitance its differential one."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from fmus.kit import stack
from fmus.kit.symbolic.tracing import trace
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support.effect_samples import bases

R1, R2, C = 0.43, 2.35, 2.70  # ohm, ohm, F


@bases
def test_double_layer_follows_its_impedance(base):
    resistance, time_constant = 0.2, 0.3
    cls = stack(base, EFFECTS["double_layer"])
    values = {"double_layer_resistance": resistance, "double_layer_time": time_constant}
    a, b, c, d = trace(cls).linearise(**values)
    row = [o.name for o in cls.layout.outputs].index("voltage")
    for s in 1j * np.logspace(-4, 3, 30):
        branch = R1 + 1 / (s * C) + resistance / (time_constant * s + 1)
        expected = 1 / (1 / R2 + 1 / branch)
        found = (c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d)[row, 0]
        assert found == pytest.approx(expected, rel=1e-9)


def impedance(cls, frequencies, **values):
    """Voltage per current of the linearised model at s = j omega."""
    a, b, c, d = trace(cls).linearise(**values)
    row = [o.name for o in cls.layout.outputs].index("voltage")
    return np.array(
        [(c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d)[row, 0] for s in 1j * frequencies]
    )


@bases
def test_diffusion_has_the_impedance_of_a_layer(base):
    """Five sections of infinitely many: what the others would add is the tail of a series, and
    nothing at rest.
    """
    share, time, omega = 0.6, 7.0, np.logspace(-4, 3, 30)
    found = impedance(
        stack(base, EFFECTS["diffusion"]), omega, diffusion_share=share, diffusion_time=time
    )
    branch = 1.0 / (1.0 / found - 1.0 / R2)
    s = 1j * omega
    layer = np.tanh(np.sqrt(s * time)) / np.sqrt(s * time)
    exact = (1.0 - share) * R1 + share * R1 * layer + 1.0 / (s * C)
    poles = ((np.arange(5) + 0.5) * np.pi) ** 2
    tail = (
        share
        * R1
        * np.minimum(1.0 - np.sum(2.0 / poles), omega * time * (1.0 / 3.0 - np.sum(2.0 / poles**2)))
    )
    assert (np.abs(branch - exact) <= tail + 1e-9 * np.abs(exact)).all()
    assert tail.max() < 0.041 * share * R1


def test_charge_dependent_capacitance_is_the_integral_of_its_differential_one():
    a = 0.15
    model = stack(PpyActuator, EFFECTS["charge_dependent_capacitance"])(capacitance_falloff=a)
    for charge in (-8.0, -1e-3, 1e-6, 0.5, 5.0):
        model.charge = charge
        exact = quad(lambda q: 1.0 / (C * math.exp(-a * q)), 0.0, charge, epsabs=0.0, epsrel=1e-13)[
            0
        ]
        assert model.film_voltage() == pytest.approx(exact, rel=1e-12)


def test_capacitance_that_depends_on_the_modulus_of_the_charge():
    """Its differential values, by central differences: C exp(-a |Q|), and even about zero to the
    second order.
    """
    slopes = {}
    for name, values in (
        ("modulus", {"capacitance_falloff_either_way": -0.12}),
        ("even", {"capacitance_bend": -0.07}),
    ):
        model = stack(PpyActuator, EFFECTS[f"charge_dependent_capacitance({name})"])(**values)
        for charge in (-8.0, -1.5, 0.02, 0.9, 5.0):
            ends = []
            for model.charge in (charge - 1e-4, charge + 1e-4):
                ends.append(model.film_voltage())
            slopes[name, charge] = 2e-4 / (ends[1] - ends[0])
    for charge in (-8.0, -1.5, 0.02, 0.9, 5.0):
        assert slopes["modulus", charge] == pytest.approx(
            C * math.exp(0.12 * abs(charge)), rel=1e-6
        )
        assert slopes["even", charge] == pytest.approx(C * (1 + 0.07 * charge**2) ** 1.5, rel=1e-6)
