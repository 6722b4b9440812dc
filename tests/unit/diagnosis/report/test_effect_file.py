"""Claims: the classes that are written run as what was fitted does in the kernel, by FMPy."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest

from fmus.kit import Component, UserError, stack
from fmus.kit.titles import titled
from orchestration.diagnosis.extension import law_term
from orchestration.diagnosis.fitting import Fit
from orchestration.diagnosis.report.effect_file import effect_source
from orchestration.diagnosis.term_names import stems
from orchestration.diagnosis.terms import Memory, NamedTerm, SensorTerm, Shape, Term
from tests.support.fitted_terms import fitted, one_of_shape, run_fmu
from tests.support.oscillator_model import Oscillator


def written(fit: Fit) -> tuple[type[Component], str]:
    """Return the model with the classes of the file laid over, and its text."""
    cls = fit.problem.model.cls
    text = effect_source(fit, stems(cls, fit.terms), 'a "quoted" \udcff.csv')
    names: dict[str, Any] = {}
    exec(compile(text, "law.py", "exec"), names)
    (line,) = (line for line in text.splitlines() if "better = stack" in line)
    exec(line.removeprefix("# "), names | {"stack": stack, cls.__name__: cls}, names)
    return names["better"], text


def kernel(fit: Fit) -> np.ndarray:
    """Return the first output in the free run of the kernel."""
    record = fit.problem.records[0]
    course = fit.problem.run(record, fit.point, fit.terms, fit.point.starts[0], False)
    return course.outputs[:, 0]


@pytest.mark.parametrize("shape", Shape, ids=lambda shape: shape.name.lower())
def test_a_shape_runs_as_it_was_fitted(shape):
    term, values = one_of_shape(shape)
    fit = fitted(Oscillator, [term], [values])
    made, text = written(fit)
    assert np.abs(run_fmu(fit, made) - kernel(fit)).max() < 1e-6
    assert text.isascii()


@pytest.mark.parametrize("signal", ["velocity", "friction"])
def test_a_curve_declares_the_range_in_which_it_was_identified(signal):
    term = Term("friction", signal, Shape.CURVE, places=(-1e-6, 0.0, 1e-6))
    fit = fitted(Oscillator, [term], [[0.0, 0.0, 0.0]])
    made, _ = written(fit)
    (output,) = (o for o in made.layout.outputs if o.name == f"friction_of_{signal}_signal")
    one = made()
    one.velocity = 0.3
    assert getattr(one, output.name)() == pytest.approx(0.3 if signal == "velocity" else 0.8 * 0.3)
    courses = law_term(fit, "friction", term).range
    assert (output.min, output.max) == pytest.approx(courses, rel=1e-9)
    assert output.min < -1e-3 < 1e-3 < output.max


@pytest.mark.parametrize("memory", [*Memory][1:], ids=lambda memory: memory.name.lower())
@pytest.mark.parametrize(("signal", "scale"), [("force", 4.0), ("spring_force", 5.0)])
def test_a_memory_runs_as_it_was_fitted(memory, signal, scale):
    scale = scale**2 if memory is Memory.HEAT else scale
    constants = (0.3, 0.5)[: memory.constants]
    term = Term("friction", signal, Shape.LINEAR, memory, constants, size=5.0, scale=scale)
    fit = fitted(Oscillator, [term], [[0.2, *np.log(constants)]])
    made, _ = written(fit)
    assert np.abs(run_fmu(fit, made) - kernel(fit)).max() < 1e-6


def test_several_terms_run_together():
    terms = [
        Term("friction", "velocity", Shape.SQUARE, size=5.0),
        Term("friction", "elongation", Shape.SQUARE, factor="friction", scale=0.3),
        Term("spring_force", "spring_force", Shape.CUBE, size=5.0, scale=9.0),
    ]
    fit = fitted(Oscillator, terms, [[0.02], [0.2], [-0.05]])
    made, text = written(fit)
    assert np.abs(run_fmu(fit, made) - kernel(fit)).max() < 1e-6
    assert "return below * (1.0 + self.friction_of_elongation * x * x)" in text


@pytest.mark.parametrize(
    ("terms", "values"),
    [
        (
            [
                Term("friction", "spring_force", Shape.SQUARE, factor="friction", scale=5.0),
                Term("spring_force", "friction", Shape.SQUARE, size=5.0, scale=2.0),
                Term("acceleration", "acceleration", Shape.ODD_SQUARE, size=5.0, scale=20.0),
            ],
            [[0.2], [0.02], [-0.1]],
        ),
        (
            [
                Term("friction", "velocity", Shape.SQUARE, factor="friction"),
                Term("friction", "elongation", Shape.SQUARE, factor="friction", scale=0.3),
                Term("friction", "friction", Shape.LINEAR, Memory.LAG, (0.3,), size=5.0),
            ],
            [[0.02], [0.2], [0.1, np.log(0.3)]],
        ),
    ],
)
def test_a_term_sees_laws_without_what_terms_add(terms, values):
    fit = fitted(Oscillator, terms, values)
    made, text = written(fit)
    assert np.abs(run_fmu(fit, made) - kernel(fit)).max() < 1e-6
    assert "base_value(" in text


class GuidedOscillator(Oscillator):
    """Its friction is a law of the velocity that it is called with."""

    def friction(self, velocity):
        return self.damping * velocity

    def acceleration(self):
        pull = self.force - self.friction(1.5 * self.velocity) - self.spring_force()
        return pull / self.mass


def test_terms_of_a_law_with_arguments_run_as_they_were_fitted():
    terms = [
        Term("friction", "velocity", Shape.SQUARE, factor="friction"),
        Term("friction", "elongation", Shape.SQUARE, factor="friction", scale=0.3),
        Term("friction", "force", Shape.LINEAR, Memory.LAG, (0.3,), size=5.0, scale=4.0),
    ]
    fit = fitted(GuidedOscillator, terms, [[0.02], [0.2], [0.1, np.log(0.3)]])
    made, text = written(fit)
    assert "arguments=arguments" in text
    plain = run_fmu(fit, GuidedOscillator)
    assert np.abs(run_fmu(fit, made) - kernel(fit)).max() < 1e-6
    assert np.abs(kernel(fit) - plain).max() > 1e-3


def test_a_fault_of_a_sensor_is_a_class_of_the_output():
    term = SensorTerm("position", "position", Shape.LINEAR, Memory.FADING, (0.1,), "", 0.3, 0.3)
    fit = fitted(Oscillator, [term], [[-0.9, np.log(0.1)]])
    made, _ = written(fit)
    assert np.abs(run_fmu(fit, made) - kernel(fit)).max() < 1e-6


def test_the_file_is_short_and_reads_as_the_law_does():
    term = Term("friction", "velocity", Shape.ODD_SQUARE, size=5.0)
    text = effect_source(
        fitted(Oscillator, [term], [[0.1]]), stems(Oscillator, [term]), "swing.csv"
    )
    assert "class FrictionOfVelocity(Effect):" in text
    assert "return below + self.friction_of_velocity * x * absolute(x)" in text
    assert "'swing.csv'" in text
    assert len(text.splitlines()) < 35


def test_titles_are_no_code():
    hostile = """swing'\"\"\"\nimport os; os.environ["CANARY"] = "ran"\n\\"""

    class Hostile(Oscillator):
        @titled(hostile)
        def friction(self):
            return super().friction()

    term = Term("friction", "velocity", Shape.LINEAR, size=5.0)
    text = effect_source(fitted(Hostile, [term], [[0.1]]), stems(Hostile, [term]), hostile)
    names: dict[str, Any] = {}
    exec(compile(text, "law.py", "exec"), names)
    assert "CANARY" not in os.environ
    assert hostile[1:] in names["__doc__"]
    assert hostile[1:] in names["FrictionOfVelocity"].__doc__


@pytest.mark.parametrize(
    ("terms", "reason"),
    [
        ([], "no law is found to lack anything"),
        ([NamedTerm("friction", "velocity", Shape.LINEAR, effect="dry")], "has a class already"),
    ],
)
def test_what_is_no_term_of_a_law_is_refused(terms, reason):
    fit = fitted(Oscillator, [], [])
    with pytest.raises(UserError, match=reason):
        effect_source(fit, stems(Oscillator, terms), "swing.csv")
