"""Claims: with the one-way coupling the charge does work on the load that no current pays for; with
the preset `reciprocal` energy is conserved.

Power of both ports, stored energy and dissipation by the equations of the README, solved by scipy.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.kit import stack
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator

RECIPROCAL = stack(PpyActuator, EFFECTS["force_to_voltage"])
R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
K1, B1, K2, B2 = 6300.0, 1.7e6, 1.0e4, 2.0e6
OMEGA = 0.2 * np.pi  # a cycle of 10 s, as that of the work loop
TIME = 1e-3 * np.arange(20001)


def current(t):
    return -0.6 * np.cos(OMEGA * t)


def force(t):
    return 0.5 + 0.4 * np.cos(OMEGA * t)


def solve(alpha, reaction):
    """States, voltage, displacement, and energy in J that is made over time.

    Voltage of the films Q/C + `reaction` F, and x = `alpha` Q + k + m + F/k1.
    """

    def equations(t, state):
        charge, kelvin, _ = state[:3]
        f, i = force(t), current(t)
        behind = charge / C + reaction * f
        charging = (R2 * i - behind) / (R1 + R2)
        voltage = R1 * charging + behind
        creeping, flowing = (f - K2 * kelvin) / B2, f / B1
        spring = -0.4 * OMEGA * np.sin(OMEGA * t) / K1
        moving = alpha * charging + creeping + flowing + spring
        lost = R1 * charging**2 + voltage**2 / R2 + B2 * creeping**2 + B1 * flowing**2
        return [charging, creeping, flowing, voltage * i, f * moving, lost]

    found = solve_ivp(equations, (0.0, 20.0), np.zeros(6), "DOP853", TIME, rtol=1e-11, atol=1e-15)
    charge, kelvin, maxwell, electrical, work, lost = found.y
    stored = charge**2 / (2 * C) + K2 * kelvin**2 / 2 + force(TIME) ** 2 / (2 * K1)
    behind = charge / C + reaction * force(TIME)
    voltage = R1 * (R2 * current(TIME) - behind) / (R1 + R2) + behind
    length = alpha * charge + kelvin + maxwell + force(TIME) / K1
    made = stored - stored[0] + lost - electrical - work
    return found.y[:3].T, voltage, length, made


@pytest.mark.parametrize("alpha", [ALPHA, 9.198e-5, -2e-4])
@pytest.mark.parametrize("values", [{}, RECIPROCAL.presets["reciprocal"].values])
def test_energy_is_conserved_with_the_reciprocal_coupling_alone(values, alpha):
    """Whatever alpha is, as with the values of a specimen."""
    states, voltage, length, made = solve(alpha, -alpha if values else 0.0)
    unpaid = -alpha * np.trapezoid(force(TIME), states[:, 0])
    assert abs(unpaid) > 1e-4, "the charge works on the load"
    assert made[-1] == pytest.approx(0.0 if values else unpaid, abs=1e-10)
    model = RECIPROCAL(**{"alpha": alpha, **values})
    for k in range(0, TIME.size, 500):
        model.charge, model.kelvin_elongation, model.maxwell_elongation = states[k]
        model.current, model.force = current(TIME[k]), force(TIME[k])
        assert model.voltage() == pytest.approx(voltage[k], rel=1e-12)
        assert model.displacement() == pytest.approx(length[k], rel=1e-12)
        reaction = -alpha * force(TIME[k]) if values else 0.0
        assert model.load_voltage() == pytest.approx(reaction, rel=1e-12)


def test_a_component_keeps_its_presets_beside_those_of_its_effects():
    assert list(RECIPROCAL.presets) == [*PpyActuator.presets, "reciprocal"]
