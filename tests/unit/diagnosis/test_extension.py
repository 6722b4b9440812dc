"""Claims: the FMU of a model with terms runs as the kernel does, by another integrator and host."""

from __future__ import annotations

from dataclasses import replace

import fmpy
import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from orchestration.diagnosis.extension import extended_component
from orchestration.diagnosis.fitting import Fit, Point, Problem, StartPrior
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.runs import Record
from orchestration.diagnosis.terms import DelayTerm, Memory, Shape, Term
from orchestration.fmu.model import model_of
from tests.support.oscillator_model import Oscillator

STEP = 0.02
SAMPLES = 150
SUBSTEPS = 32  # so that the classical method resolves a kink as well as the FMU, which locates it


class Strain(Component):
    """Strain that follows a charge."""

    name = "strain"

    gain = Parameter(2.0, "1/C", min=0.0, max=10.0, doc="strain of a charge")
    current = Input("A", doc="current in")
    charge = State("C", rate="charge_rate", doc="charge")

    def charge_rate(self):
        """Charge balance."""
        return self.current - self.leakage()

    def leakage(self):
        """Current that leaks, 1 A at 1 C."""
        return self.charge * self.current_at_charge()

    def current_at_charge(self):
        """Rate of the leak."""
        return 1.0 + 0.0 * self.charge

    def free_strain(self):
        """Strain without load."""
        return self.gain * self.charge

    @Output("1")
    def strain(self):
        """Strain, as measured."""
        return self.free_strain()


Strain.unchecked = ("leakage", "current_at_charge")


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


def courses(cls: type[Component], terms: list[Term], values: list[list[float]]):
    """Return the output of the kernel with terms, without terms, and of the FMU."""
    fit = fitted(cls, terms, values)
    record = fit.problem.records[0]
    start = fit.point.starts[0]
    plain = replace(fit.point, values=np.zeros(0))
    with_terms = fit.problem.run(record, fit.point, fit.terms, start, False)
    without = fit.problem.run(record, plain, (), start, False)
    return with_terms.outputs[:, 0], without.outputs[:, 0], run_fmu(fit, extended_component(fit))


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


def _shaped(shape: Shape) -> tuple[Term, list[float]]:
    """Return a term of a shape over the velocity, with values at which it acts."""
    places = (-1.0, -0.3, 0.2, 1.0) if shape is Shape.CURVE else ()
    signal = "" if shape is Shape.CONSTANT else "velocity"
    if shape is Shape.STEP:
        term = Term("friction", "time", shape, factor="friction", size=5.0, scale=STEP * SAMPLES)
        return term, [0.1, np.log(0.4)]
    term = Term("friction", signal, shape, size=5.0, scale=0.5, middle=0.1, places=places)
    amount = 0.01 if shape in (Shape.SQUARE, Shape.ODD_SQUARE, Shape.CUBE) else 0.1
    values = np.linspace(amount, 2.0 * amount, term.coefficients).tolist()
    return term, [*values, *[np.log(0.8)] * shape.has_width]


@pytest.mark.parametrize("shape", Shape, ids=lambda shape: shape.name.lower())
def test_every_shape_runs_as_in_the_kernel(shape):
    term, values = _shaped(shape)
    kernel, without, fmu = courses(Oscillator, [term], [values])
    assert np.abs(kernel - without).max() > 1e-3
    assert np.abs(fmu - kernel).max() < 1e-6


def test_a_late_output_is_late_in_the_fmu():
    """Both are linear between the same samples."""
    late = DelayTerm("position", "position", Shape.LINEAR, size=0.1)
    kernel, without, fmu = courses(Oscillator, [late], [[0.5]])
    assert np.abs(kernel - without).max() > 1e-3
    assert np.abs(fmu - kernel).max() < 1e-6


@pytest.mark.parametrize("memory", [*Memory][1:], ids=lambda memory: memory.name.lower())
@pytest.mark.parametrize("signal", ["elongation", "force", "spring_force"])
def test_every_memory_of_state_input_and_law_runs_as_in_the_kernel(memory, signal):
    scale = {"elongation": 0.3, "force": 4.0, "spring_force": 5.0}[signal]
    scale = scale**2 if memory is Memory.HEAT else scale
    constants = (0.3, 0.5)[: memory.constants]
    term = Term("friction", signal, Shape.LINEAR, memory, constants, size=5.0, scale=scale)
    kernel, without, fmu = courses(Oscillator, [term], [[0.2, *np.log(constants)]])
    assert np.abs(kernel - without).max() > 1e-3
    assert np.abs(fmu - kernel).max() < 1e-6


def test_laws_as_signals_and_factors_are_taken_without_other_terms():
    factor = Term("friction", "spring_force", Shape.SQUARE, factor="friction", scale=5.0)
    other = Term("spring_force", "friction", Shape.SQUARE, size=5.0, scale=2.0)
    own = Term("acceleration", "acceleration", Shape.ODD_SQUARE, size=5.0, scale=20.0)
    values = [[0.2], [0.02], [-0.1]]
    kernel, without, fmu = courses(Oscillator, [factor, other, own], values)
    assert np.abs(kernel - without).max() > 1e-3
    assert np.abs(fmu - kernel).max() < 1e-6


@pytest.mark.parametrize("memory", [Memory.LAG, Memory.PLAY, Memory.DAHL])
def test_a_memory_that_an_output_shows_is_not_a_sample_late(memory):
    term = Term("free_strain", "charge", Shape.LINEAR, memory, (0.3,), size=2.0, scale=1.0)
    kernel, without, fmu = courses(Strain, [term], [[0.2, np.log(0.3)]])
    assert np.abs(kernel - without).max() > 1e-3
    assert np.abs(fmu - kernel).max() < 1e-6


def test_play_follows_to_the_way_that_was_fitted():
    """Prandtl's play, stepped by hand over the FMU's own charge."""
    term = Term("free_strain", "charge", Shape.LINEAR, Memory.PLAY, (0.3,), size=2.0, scale=1.0)
    fit = fitted(Strain, [term], [[0.2, np.log(0.3)]])
    strain = run_fmu(fit, extended_component(fit))
    plain = fitted(Strain, [], [])
    charge = run_fmu(plain, extended_component(plain)) / 2.0
    memory = charge[0]
    for measured, q in zip(strain, charge, strict=True):
        memory = min(max(memory, q - 0.3), q + 0.3)
        assert measured == pytest.approx(2.0 * q + 0.4 * memory, abs=1e-6)


def test_the_python_fmu_runs_alike():
    terms = [_shaped(Shape.DRY)[0], Term("friction", "spring_force", Shape.SQUARE, scale=5.0)]
    fit = fitted(Oscillator, terms, [_shaped(Shape.DRY)[1], [0.02]])
    cls = extended_component(fit)
    assert np.abs(run_fmu(fit, cls, "python") - run_fmu(fit, cls)).max() < 1e-6


def test_the_model_of_a_diagnosis_has_readable_names_and_fitted_defaults(dry):
    cls = dry.component
    defaults = {p.name: p.start for p in cls.layout.parameters}
    estimate = dry.parameters["friction_of_velocity"]
    assert defaults["friction_of_velocity"] == pytest.approx(estimate.value)
    assert defaults["damping"] == pytest.approx(dry.parameters["damping"].value)
    assert "friction over velocity" in cls.remark
