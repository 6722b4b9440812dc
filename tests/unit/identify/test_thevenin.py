"""Claims: the parameters of a cell's equivalent circuit are found to six digits.

Oracle: the circuit's exponentials, exact for a current that is held from sample to sample, with the
parameters of PyBOP's examples of such a circuit.
"""

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from fmus.kit import Component, Input, Output, Parameter, State
from orchestration.identify.fitting import Assumptions, FitData
from orchestration.identify.grey_box import fit_records

STEP = 0.5  # s
CAPACITY = 5.0 * 3600.0  # C
TRUE = {"R0": 1e-3, "R1": 2e-4, "C1": 1e4, "R2": 3e-4, "C2": 5e3}


class Thevenin(Component):
    """Open-circuit voltage on a line over the charge, a resistance and two pairs of R and C.

    Their voltages are millivolts, which an integrator of volts would leave inexact.
    """

    name = "thevenin"
    R0 = Parameter(TRUE["R0"], "ohm", min=0)
    R1 = Parameter(TRUE["R1"], "ohm", min=0)
    C1 = Parameter(TRUE["C1"], "F", min=0)
    R2 = Parameter(TRUE["R2"], "ohm", min=0)
    C2 = Parameter(TRUE["C2"], "F", min=0)
    current = Input("A")
    charge = State("1", rate="charge_rate", start=0.5)
    v1 = State("V", rate="v1_rate", nominal=1e-3)
    v2 = State("V", rate="v2_rate", nominal=1e-3)

    def charge_rate(self):
        return -self.current / CAPACITY

    def v1_rate(self):
        return (self.current - self.v1 / self.R1) / self.C1

    def v2_rate(self):
        return (self.current - self.v2 / self.R2) / self.C2

    @Output("V")
    def voltage(self):
        return 3.2 + 0.9 * self.charge - self.R0 * self.current - self.v1 - self.v2


class ByTimeConstant(Thevenin):
    """The same with the time constant of the first pair in the place of its capacitance."""

    name = "by_time_constant"
    tau1 = Parameter(2.0, "s", min=0)

    def v1_rate(self):
        return (self.R1 * self.current - self.v1) / self.tau1


def record():
    """Two minutes of current pulses of 5 A, and the voltage by exact exponentials."""
    time = STEP * np.arange(241)
    current = 5.0 * np.random.default_rng(1).integers(-1, 2, time.size // 8 + 1).repeat(8)[:241]
    poles = [-1.0 / (TRUE["R1"] * TRUE["C1"]), -1.0 / (TRUE["R2"] * TRUE["C2"])]
    a = np.diag([0.0, *poles])
    b = np.array([[-1.0 / CAPACITY], [1.0 / TRUE["C1"]], [1.0 / TRUE["C2"]]])
    c = np.array([[0.9, -1.0, -1.0]])
    sampled = cont2discrete((a, b, c, [[-TRUE["R0"]]]), STEP)
    _, voltage, _ = dlsim(sampled, current, x0=[0.5, 0.0, 0.0])
    return FitData(time, {"current": current}, {"voltage": 3.2 + voltage[:, 0]})


@pytest.mark.parametrize(
    ("cls", "names", "start"),
    [
        (Thevenin, ["R0", "R1", "C1"], {"R0": 2e-3, "R1": 5e-4, "C1": 5e3}),
        (ByTimeConstant, ["R0", "R1", "tau1"], {"R0": 2e-3, "R1": 5e-4, "tau1": 5.0}),
    ],
)
def test_a_circuit_is_found_to_six_digits(cls, names, start):
    found = fit_records(cls, [record()], names, start, Assumptions(starts=None))
    true = TRUE | {"tau1": TRUE["R1"] * TRUE["C1"]}
    assert found.values == pytest.approx({name: true[name] for name in names}, rel=5e-7)
