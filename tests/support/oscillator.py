"""Records of a mass on a spring that rubs, integrated by SciPy, and diagnoses of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from orchestration.diagnosis.conclude import Conclusion, conclude
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.fitting import fit, fit_base, nominal_point, weights_of
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.pieces import pieces_of
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.runs import Record as KernelRecord
from orchestration.diagnosis.search import Found
from orchestration.diagnosis.subject import Subject, divided_as_read, subject_of
from orchestration.diagnosis.terms import Shape, Term
from orchestration.experiment.design import (
    DiscriminatingExperiment,
    ExpectedEvidence,
    Rehearsal,
    menu,
)
from orchestration.fmu.model import declared_model_of
from orchestration.records import Record
from tests.support.oscillator_model import Oscillator

DRY = Term("friction", "velocity", Shape.DRY, size=5.0, scale=1.0, width=0.1)
CUBE = Term("spring_force", "elongation", Shape.CUBE, size=5.0, scale=0.3)


def oscillator_record(
    seed: int, dry: float = 0.0, damping: float = 0.8, samples: int = 700, noise: float = 1e-3
) -> Record:
    """Return a record of a driven oscillator of the default mass and stiffness.

    Parameters
    ----------
    seed : int
        Of the force, steps of half a second, and of the noise.
    dry : float
        Dry friction, N, rounded within 0.1 m/s.
    damping : float
        N s/m.
    samples : int
        20 ms apart.
    noise : float
        Standard deviation of the measured position, m.
    """
    random = np.random.default_rng(seed)
    step = 0.02
    time = step * np.arange(samples)
    force = np.repeat(random.normal(0.0, 6.0, samples // 25 + 1), 25)[:samples]
    position = np.zeros(samples)
    state = np.zeros(2)
    for k in range(samples - 1):

        def rates(_: float, s: np.ndarray, push: float = force[k]) -> list[float]:
            rubbing = damping * s[1] + dry * np.tanh(s[1] / 0.1)
            return [s[1], push - rubbing - 20.0 * s[0]]

        state = solve_ivp(rates, (0.0, step), state, rtol=1e-8, atol=1e-10).y[:, -1]
        position[k + 1] = state[0]
    measured = position + random.normal(0.0, noise, samples)
    signals = {"force": force, "position": measured}
    return Record(time, signals, {"force": "N", "position": "m"}, Path(f"oscillator_{seed}.csv"))


def _diagnosis(record: Record, found: Found) -> Diagnosis:
    pieces, _ = pieces_of([record], found.subject.problem.model, {})
    model = declared_model_of(Oscillator)
    return Diagnosis(model, (record,), (), tuple(pieces), found, conclude(found))


def diagnosis_with(record: Record, *sets: Sequence[Term]) -> Diagnosis:
    """Return the diagnosis of an oscillator in which these sets of terms alone are fitted.

    A search over all terms takes longer than a test may.
    """
    found = unsearched(record)
    subject = found.subject
    weights = weights_of(subject.base.errors)
    for terms in sets:
        fitted = fit(subject.problem, terms, [nominal_point(subject.problem, terms)], weights)
        if fitted is not None:
            weights_left = weights_of(fitted.errors)
            fitted = fit(subject.problem, terms, [fitted.point], weights_left)
        judged = None if fitted is None else subject.judge(fitted)
        if judged is not None:
            found = found.with_fits([judged])
    return _diagnosis(record, found)


def diagnosis_without_terms(record: Record) -> Diagnosis:
    """Return the diagnosis of an oscillator by its model as it is alone."""
    found = unsearched(record)
    return _diagnosis(record, found)


def unsearched(record: Record, *, interpolate: bool = False) -> Found:
    """Return the fit of the model without terms; the force of a record is held between samples."""
    inputs = record.signals["force"][:, None]
    outputs = record.signals["position"][:, None]
    given = KernelRecord(record.time, inputs, outputs, (False,), record.source.stem)
    subject = subject_of(LawModel(Oscillator), [given], interpolate=interpolate)
    assert subject is not None
    base = subject.judge(subject.base)
    assert base is not None
    return Found(subject, base)


def misread(record: Record, **factors: float) -> Record:
    """Return a record whose file has so many times the value of some signals."""
    wrong = {name: factor * record.signals[name] for name, factor in factors.items()}
    return replace(record, signals={**record.signals, **wrong})


def diagnosis_read_as(record: Record, reading: Reading) -> Diagnosis:
    """Return the diagnosis of an oscillator in which this reading of the file alone is fitted."""
    found = unsearched(record)
    problem, left_out = divided_as_read(found.subject, reading)
    base = fit_base(problem)
    assert base is not None
    subject = Subject(problem, left_out, base, reading)
    judged = subject.judge(base)
    assert judged is not None
    found = found.with_fits([judged], [subject])
    return _diagnosis(record, found)


def with_group(diagnosis: Diagnosis, verdict: str, *probabilities: float) -> Diagnosis:
    """Return a diagnosis as one in which friction over either state has these probabilities."""
    (cause, *_) = diagnosis.conclusion.causes
    group = []
    for signal, probability in zip(("velocity", "elongation"), probabilities, strict=True):
        terms = (replace(cause.terms[0], signal=signal),)
        judged = replace(cause.judged, fit=replace(cause.judged.fit, terms=terms))
        group.append(
            replace(cause, signal=signal, probability=probability, parts=terms, judged=judged)
        )
    conclusion = Conclusion(verdict, tuple(group), 0.01, diagnosis.found.base)
    return replace(diagnosis, conclusion=conclusion)


def telling_apart(*names: str) -> DiscriminatingExperiment:
    """Return an experiment that tells the first of these causes from the others."""
    levels = {"levels": [-6.0, 6.0], "dwell": [0.5, 2.0], "seed": 1}
    first, *others = names
    return DiscriminatingExperiment(
        {"force": menu.Stimulus("multilevel", levels)},
        20.0,
        0.02,
        [ExpectedEvidence(first, other, 42.0) for other in others],
        Rehearsal({"force": "N"}, ["position"], {"mass": 1.0}),
        {"force": (-6.0, 6.0)},
        {first: 0.999, **dict.fromkeys(others, 0.6)},
    )
