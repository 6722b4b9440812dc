"""Fits of terms with given values, and the FMUs of their models, run by FMPy."""

from __future__ import annotations

import fmpy
import numpy as np

from fmus.kit import Component
from orchestration.diagnosis.fitting import Fit, Point, Problem, StartPrior
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.runs import Record
from orchestration.diagnosis.terms import Shape, Term
from orchestration.fmu.model import model_of

STEP = 0.02
SAMPLES = 150
SUBSTEPS = 32  # so that the classical method resolves a kink as well as the FMU, which locates it


def fitted(cls: type[Component], terms: list[Term], values: list[list[float]]) -> Fit:
    """Return a fit of terms with values over a held stimulus, from start states other than zero."""
    model = LawModel(cls)
    time = STEP * np.arange(SAMPLES)
    steps = np.random.default_rng(4).normal(0.0, 4.0, SAMPLES // 15)
    stimulus = np.repeat(steps, 15)[:, None]
    outputs = np.zeros((SAMPLES, len(model.outputs)))
    record = Record(time, stimulus, outputs, (False,), "stimulus")
    start = np.linspace(0.05, 0.1, len(model.states))
    prior = StartPrior(start, np.ones(len(start)))
    problem = Problem(model, (record,), np.ones(len(model.outputs)), (prior,), substeps=SUBSTEPS)
    point = Point(problem.mean, np.concatenate([np.zeros(0), *values]), (start,))
    return Fit(problem, tuple(terms), point, (outputs,), 0.0, np.eye(1))


def run_fmu(fit: Fit, cls: type[Component], runtime: str = "native"):
    """Return the first output of the FMU of a class over the record of a fit, by FMPy."""
    record = fit.problem.records[0]
    (stimulus,) = fit.problem.model.inputs
    dtype = [("time", float), (stimulus.name, float)]
    output = fit.problem.model.outputs[0].name
    result = fmpy.simulate_fmu(
        str(model_of(cls, runtime).path),
        stop_time=float(record.time[-1]),
        step_size=STEP,
        output_interval=STEP,
        input=np.array([*zip(record.time, record.inputs[:, 0], strict=True)], dtype=dtype),
        output=[output],
        fmi_type="CoSimulation",
    )
    return result[output]


def one_of_shape(shape: Shape) -> tuple[Term, list[float]]:
    """Return a term of a shape over the velocity, with values at which it acts."""
    places = (-1.0, -0.3, 0.4, 1.1) if shape is Shape.CURVE else ()
    signal = "" if shape is Shape.CONSTANT else "velocity"
    if shape is Shape.STEP:
        term = Term("friction", "time", shape, factor="friction", size=5.0, scale=STEP * SAMPLES)
        return term, [0.1, np.log(0.4)]
    term = Term("friction", signal, shape, size=5.0, scale=0.5, middle=0.1, places=places)
    amount = 0.01 if shape in (Shape.SQUARE, Shape.ODD_SQUARE, Shape.CUBE) else 0.1
    values = np.linspace(amount, 2.0 * amount, term.coefficients).tolist()
    return term, [*values, *[np.log(0.8)] * shape.has_width]
