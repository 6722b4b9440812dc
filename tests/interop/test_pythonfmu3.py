"""Claims: FMUs of FMI 3.0 that another tool has written, PythonFMU3, run here as in closed form."""

from __future__ import annotations

import importlib.util
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from orchestration.fmu.check import check_fmu
from tests.support.command import works
from tests.support.fmu_faults import lines

SOURCE = """
import math

from pythonfmu3 import Float64, Fmi3Causality, Fmi3Initial, Fmi3Slave, Fmi3Variability, Int32


class Lag(Fmi3Slave):
    def __init__(self, **options):
        super().__init__(**options)
        self.time = 0.0
        self.u = 0.0
        self.x = 0.25
        self.k = 2.0
        self.steps = 0
        known = {"causality": Fmi3Causality.independent}
        known["variability"] = Fmi3Variability.continuous
        self.register_variable(Float64("time", **known))
        self.register_variable(Float64("u", causality=Fmi3Causality.input, start=0.0))
        state = {"causality": Fmi3Causality.output, "initial": Fmi3Initial.exact}
        self.register_variable(Float64("x", **state, start=0.25))
        gain = {"causality": Fmi3Causality.parameter, "variability": Fmi3Variability.tunable}
        self.register_variable(Float64("k", **gain, start=2.0))
        self.register_variable(Int32("steps", causality=Fmi3Causality.output))

    def do_step(self, now, size):
        if self.u > 5.0:
            return False
        self.x = self.k * self.u + (self.x - self.k * self.u) * math.exp(-size / 0.5)
        self.steps += 1
        return True
"""


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    if importlib.util.find_spec("pythonfmu3") is None:
        pytest.skip("pythonfmu3 is not installed")
    folder = tmp_path_factory.mktemp("pythonfmu3")
    (folder / "lag.py").write_text(SOURCE)
    command = [sys.executable, "-m", "pythonfmu3", "build", "-f", "lag.py", "-d", "."]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder / "Lag.fmu"


def test_it_runs_as_in_closed_form(lag, tmp_path):
    time = 0.1 * np.arange(21)
    u = np.sin(3.0 * time)
    pd.DataFrame({"time": time, "u": u}).to_csv(tmp_path / "in.csv", index=False)
    works("simulate", lag, "--input", "in.csv", "--set", "k=3", "--out", "o.csv", cwd=tmp_path)
    states = [0.25]
    for value in u[:-1]:
        states.append(3.0 * value + (states[-1] - 3.0 * value) * np.exp(-0.1 / 0.5))
    found = pd.read_csv(tmp_path / "o.csv")
    np.testing.assert_allclose(found["x [1]"], states, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found["steps [1]"], np.arange(21))


def test_the_check_finds_no_error(lag):
    assert lines(check_fmu(lag), "error") == []
