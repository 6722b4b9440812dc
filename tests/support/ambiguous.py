"""A dull record of the emulated rig, which two effects explain equally well."""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from demonstrations.bench import NOISE
from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from demonstrations.emulator.variations import CATALOGUE
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.candidates.candidate import Candidate, own_parameters
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import HELD_OUT
from orchestration.discrepancy.diagnosis import searched_parameters
from orchestration.discrepancy.selection.stepwise import Selection, Step
from orchestration.experiment.waveforms import steps
from orchestration.identify.fitting.prediction_error import fit_prediction_error
from orchestration.identify.fitting.problem import Problem

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
    return Dataset(time, inputs, rig.run(time, inputs["current"], inputs["force"]))


def fitted(data, effect=None):
    """A model fitted to what a diagnosis fits to, from either side of the effect's neutral
    value.
    """
    part = data.part(0, round(len(data.time) * (1.0 - HELD_OUT)))
    candidate = (
        Candidate((), PpyActuator)
        if effect is None
        else Candidate((), PpyActuator).with_effect(EFFECTS[effect])
    )
    physical = searched_parameters(PpyActuator)
    problem = Problem(
        candidate.cls, part.time, part.inputs, part.measured, [*physical, *candidate.parameters], {}
    )
    believed = np.array([n in physical and not problem.declared[n].starts for n in problem.names])
    begin = {own_parameters(EFFECTS[effect])[0]: 0.1} if effect else {}
    return FittedCandidate(
        candidate,
        problem,
        fit_prediction_error(problem, problem.position(problem.start | begin), None, believed),
    )


@cache
def ambiguous(hidden):
    """The dull record, and an ambiguous verdict on it."""
    data = measured(hidden, TIME, DULL)
    true_model, candidate = (
        fitted(data, name) for name in sorted(HIDDEN, key=lambda name: name != hidden)
    )
    return data, Selection(fitted(data), [Step(true_model, 0.0, 0.0, 0.0, [candidate], [])])
