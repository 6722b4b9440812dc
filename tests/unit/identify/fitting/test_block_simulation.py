"""Claims: a simulation in blocks is that in one piece, with its derivatives.

Oracles: `CompiledModel.run` over all of a record, and a relaxation in closed form.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit import Component, Input, Output, Parameter, State, UserError
from fmus.kit.record import CompiledModel
from orchestration.identify.fitting.block_simulation import LONGEST, BlockwiseModel
from orchestration.identify.fitting.delay import DelayedModel
from orchestration.identify.fitting.simulation_input import SimulationInput

STEP = 0.05  # s
SAMPLES = 20_500  # not a multiple of a block
TIME = 3.0 + STEP * np.arange(SAMPLES)
INPUT = np.repeat(np.random.default_rng(2).uniform(-1.0, 1.0, SAMPLES // 20), 20)
VALUES = {"tau": 40.0, "cubic": 0.3, "x_start": 0.7, "z_start": -0.2}
NAMES = ["tau", "x_start", "z_start", "cubic"]


class Cascade(Component):
    """Two states, the second of which follows the first and is not linear."""

    name = "cascade"

    tau = Parameter(40.0, "s", min=1e-3)
    cubic = Parameter(0.3, "1")
    u = Input("1")
    x = State("1", rate="x_rate")
    z = State("1", rate="z_rate")

    def x_rate(self):
        return (self.u - self.x) / self.tau

    def z_rate(self):
        return 0.01 * (self.x - self.z - self.cubic * self.z**3)

    @Output("1")
    def y(self):
        """Return the sum of both states."""
        return self.x + self.z

    @Output("1")
    def plain(self):
        """Return the first state."""
        return self.x


@pytest.fixture(scope="module")
def model():
    return CompiledModel(Cascade, NAMES)


def test_blocks_join_to_what_is_simulated_in_one_piece(model):
    whole = model.run(TIME, {"u": INPUT}, VALUES, effort=50.0)
    blockwise = BlockwiseModel(model)
    found = blockwise.run_in_blocks(SimulationInput(TIME, {"u": INPUT}, VALUES, 50.0))
    for name in ("y", "plain", "x", "z"):
        assert found.signals[name] == pytest.approx(whole.signals[name], abs=1e-7)
    for name in ("y", "plain", "x", "z"):
        size = np.abs(whole.sensitivities[name]).max(axis=0)
        error = np.abs(found.sensitivities[name] - whole.sensitivities[name]).max(axis=0)
        assert (error <= 1e-6 * size).all()
    assert whole.sensitivities["y"].any(axis=0).all()
    assert found.steps == pytest.approx(whole.steps, rel=0.01)


def test_a_measured_state_has_its_derivatives_and_what_is_not_measured_has_none():
    assert len(TIME) > LONGEST
    ran = DelayedModel(Cascade, ["x_start"], measured=["z"]).run(
        SimulationInput(TIME, {"u": INPUT}, VALUES)
    )
    assert set(ran.sensitivities) == {"z"}
    assert ran.sensitivities["z"].shape == (len(TIME), 1)


def test_a_long_record_relaxes_as_in_closed_form():
    ran = DelayedModel(Cascade, ["x_start"]).run(SimulationInput(TIME, {"u": INPUT}, VALUES))
    decay = np.exp(-STEP / VALUES["tau"])
    start = [decay * VALUES["x_start"]]
    driven = lfilter([1.0 - decay], [1.0, -decay], INPUT[:-1], zi=start)[0]
    assert ran.signals["plain"][1:] == pytest.approx(driven, abs=1e-6)
    fading = np.exp(-(TIME - TIME[0]) / VALUES["tau"])
    assert ran.sensitivities["plain"][:, 0] == pytest.approx(fading, abs=1e-6)
    assert len(TIME) > LONGEST  # it was in blocks


def test_a_record_that_just_ends_where_a_block_does_is_complete(model):
    for samples in (8_193, 8_194, 16_385):
        part = slice(0, samples)
        found = BlockwiseModel(model).run_in_blocks(
            SimulationInput(TIME[part], {"u": INPUT[part]}, VALUES, effort=50.0)
        )
        assert all(np.isfinite(values).all() for values in found.signals.values())
        whole = model.run(TIME[part], {"u": INPUT[part]}, VALUES)
        assert found.signals["y"][-1] == pytest.approx(whole.signals["y"][-1], abs=1e-5)


def test_a_model_that_is_too_stiff_is_abandoned(model):
    stiff = VALUES | {"cubic": 1e9, "z_start": 1.0}
    with pytest.raises(UserError):
        BlockwiseModel(model).run_in_blocks(SimulationInput(TIME, {"u": INPUT}, stiff, effort=1e-3))
