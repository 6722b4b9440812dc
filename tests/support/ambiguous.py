"""A dull record of the emulated rig, which two effects explain equally well."""

from __future__ import annotations

from functools import partial

import numpy as np

from demonstrations.bench import NOISE
from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from demonstrations.emulator.variations import CATALOGUE
from orchestration.experiment.waveforms import steps
from tests.support.measured import Measured

TIME = 0.2 * np.arange(1501)
RIG = RigParameters(R1=0.40, R2=2.5, C=2.6, alpha=7.2e-5, k1=6000.0, b1=1.8e6, k2=1.05e4, b2=1.9e6)
HIDDEN = {
    "double_layer": {"transfer_resistance": 0.1, "layer_time": 0.4},
    "diffusion": {"diffusing_share": 0.15},
}
DULL = {
    "current": steps(TIME, [20.0, 70.0, 150.0, 200.0, 260.0], [0.3, -0.2, 0.4, 0.0, 0.3]),
    "force": 0.5 + 0.0 * TIME,
}


def measured(hidden, time, inputs, seed=1):
    """A record of the rig."""
    physics = partial(CATALOGUE[hidden].physics, **HIDDEN[hidden])
    rig = EmulatedRig(RIG, seed, NOISE["voltage"], NOISE["displacement"], hidden=physics)
    return Measured(time, inputs, rig.run(time, inputs["current"], inputs["force"]))
