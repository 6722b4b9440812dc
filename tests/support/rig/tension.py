"""The tension of a length-driven actuator, found without the code under test."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from demonstrations.emulator.physics import Physics


def tension_by_bisection(physics: Physics, state: np.ndarray, length: float) -> float:
    """Tension (N) at which the length (m) is the actuator's; slack instead of pushing."""

    def excess(force: float) -> float:
        strain = physics.electrochemical_length(physics.active_charge(state))
        return float(physics.mechanical_length(state, force) + strain - length)

    return 0.0 if excess(0.0) >= 0 else float(brentq(excess, 0.0, 1e3, xtol=1e-14, rtol=1e-14))
