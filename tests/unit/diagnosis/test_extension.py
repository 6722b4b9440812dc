"""Claims: the FMU of a model with terms runs as the kernel does, by another integrator and host."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.build.building import RUNTIMES
from orchestration.diagnosis.extension import extended_component
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.terms import DelayTerm, Memory, Shape, Term
from tests.support.fitted_terms import fitted, one_of_shape, run_fmu
from tests.support.oscillator_model import Oscillator


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


def courses(cls: type[Component], terms: list[Term], values: list[list[float]]):
    """Return the output of the kernel with terms, without terms, and of the FMU."""
    fit = fitted(cls, terms, values)
    record = fit.problem.records[0]
    start = fit.point.starts[0]
    plain = replace(fit.point, values=np.zeros(0))
    with_terms = fit.problem.run(record, fit.point, fit.terms, start, False)
    without = fit.problem.run(record, plain, (), start, False)
    return with_terms.outputs[:, 0], without.outputs[:, 0], run_fmu(fit, extended_component(fit))


@pytest.mark.parametrize("shape", Shape, ids=lambda shape: shape.name.lower())
def test_every_shape_runs_as_in_the_kernel(shape):
    term, values = one_of_shape(shape)
    kernel, without, fmu = courses(Oscillator, [term], [values])
    assert np.abs(kernel - without).max() > 1e-3
    assert np.abs(fmu - kernel).max() < 1e-6


def test_a_late_output_is_late_in_the_fmu():
    """Both are linear between the same samples."""
    late = DelayTerm("position", "position", Shape.LINEAR, size=0.1)
    kernel, without, fmu = courses(Oscillator, [late], [[0.5]])
    assert np.abs(kernel - without).max() > 1e-3
    assert np.abs(fmu - kernel).max() < 1e-6


@pytest.mark.parametrize("runtime", RUNTIMES)
def test_an_input_that_acts_late_is_delayed_in_the_fmu(runtime):
    """It does to the recorded values what the model without a delay does to those it was fitted to,
    but for the ramps of a sample that jumps become.
    """
    fit = fitted(Oscillator, [], [])
    (record,) = fit.problem.records
    step = record.time[1] - record.time[0]
    reading = Reading(ReadingKind.LATE, ("force",), shift=-7.0 * step, is_command=True)
    meant = replace(fit.problem, records=(reading.apply(fit.problem.model, record),))
    expected = meant.run(meant.records[0], fit.point, (), fit.point.starts[0], False).outputs[:, 0]
    made = extended_component(fit, reading=reading)
    late = run_fmu(fit, made, runtime=runtime)
    assert np.abs(run_fmu(fit, extended_component(fit)) - expected).max() > 0.1
    assert np.abs(late - expected).max() < 2e-3
    assert "input_delay(force)" in made.remark


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


def test_a_model_that_was_extended_before_has_its_terms_in_its_laws():
    """A law as a signal has the terms of the model that was diagnosed, and none of those added."""
    dry, values = one_of_shape(Shape.DRY)
    once = extended_component(fitted(Oscillator, [dry], [values]))
    over = Term("spring_force", "friction", Shape.SQUARE, size=5.0, scale=2.0)
    factor = Term("friction", "spring_force", Shape.SQUARE, factor="friction", scale=5.0)
    kernel, without, fmu = courses(once, [over, factor], [[0.2], [0.2]])
    assert np.abs(kernel - without).max() > 1e-3
    assert np.abs(fmu - kernel).max() < 1e-6


def test_a_curve_declares_the_range_that_its_records_reached():
    term = Term("leakage", "charge", Shape.CURVE, scale=1.0, places=(-1e-6, 0.0, 1e-6))
    fit = fitted(Strain, [term], [[0.0, 0.0, 0.0]])
    (output,) = (o for o in extended_component(fit).layout.outputs if o.name.endswith("_signal"))
    record = fit.problem.records[0]
    course = fit.problem.run(record, fit.point, fit.terms, fit.point.starts[0], False)
    charge = course.outputs[:, 0] / 2.0  # strain over its gain
    assert (output.min, output.max) == pytest.approx((charge.min(), charge.max()), rel=1e-9)
    assert (output.name, output.unit) == ("leakage_of_charge_signal", "C")


@pytest.mark.parametrize("memory", [Memory.LAG, Memory.PLAY, Memory.DAHL, Memory.BACKLASH])
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
    terms = [one_of_shape(Shape.DRY)[0], Term("friction", "spring_force", Shape.SQUARE, scale=5.0)]
    fit = fitted(Oscillator, terms, [one_of_shape(Shape.DRY)[1], [0.02]])
    cls = extended_component(fit)
    assert np.abs(run_fmu(fit, cls, "python") - run_fmu(fit, cls)).max() < 1e-6


def test_the_model_of_a_diagnosis_has_readable_names_and_fitted_defaults(dry):
    cls = dry.component
    defaults = {p.name: p.start for p in cls.layout.parameters}
    estimate = dry.parameters["friction_of_velocity"]
    assert defaults["friction_of_velocity"] == pytest.approx(estimate.value)
    assert defaults["damping"] == pytest.approx(dry.parameters["damping"].value)
    assert "friction over velocity" in cls.remark
