"""Claims: of a record that a model made itself, to the last digit, no cause is named.

The parameters are known then.

Nothing at all is left then where parameters are held, and rounding where they are not.
"""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import Component, Input, Output, Parameter, State
from orchestration.fmu.model import model_of
from orchestration.records import Record

STEP = 0.1
TIME = STEP * np.arange(1200)


class Lag(Component):
    """First order."""

    name = "lag"

    tau = Parameter(0.8, "s", min=1e-3, max=1e3)
    gain = Parameter(2.0, "1", min=1e-3, max=1e3)
    u = Input("1")
    x = State("1", rate="x_rate")

    def x_rate(self):
        return (self.u - self.x) / self.tau

    @Output("1")
    def y(self):
        """Return the state."""
        return self.gain * self.x

    @Output("1")
    def seen(self):
        """Return the input, as it is."""
        return self.u


@pytest.mark.parametrize("hold", [[], ["gain"], ["tau"], ["tau", "gain"]])
def test_no_cause_is_named(tmp_path, hold):
    u = np.sign(np.sin(0.3 * TIME))
    made = ppy.simulate(model_of(Lag), {"u": u}, time=TIME)
    signals = {"u": u, "y": np.array(made["y"]), "seen": u.copy()}
    record = Record(TIME, signals, dict.fromkeys(signals, "1"), tmp_path / "made.csv")
    found = ppy.diagnose(record, model_of(Lag), hold=hold, effects=[], interpolate=False)
    assert not found.causes
    for name, true in (("tau", 0.8), ("gain", 2.0)):
        if name in found.parameters:
            assert found.parameters[name].value == pytest.approx(true, rel=1e-6)
