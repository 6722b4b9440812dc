"""Claims: differences of a joint fit are those of the values, with errors by its covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.diagnosis import Shape, Term
from orchestration.diagnosis.joint import (
    Joint,
    Selection,
    Values,
    difference,
    start_values,
    strengths,
)
from orchestration.diagnosis.local_values import LocalValues
from orchestration.diagnosis.subject import Subject, subject_of
from tests.support.diagnosed_mass import START, D, K, M, exact, mass, pushed

OFFSET = Term("spring", "", Shape.CONSTANT, size=2.0)
CURVE = Term("spring", "x", Shape.CURVE, size=1.0, scale=0.1, places=(-1.0, 0.0, 1.0))
DIFFERENCES = ("stiffness", OFFSET)


def subject(**options: object) -> Subject:
    """Return two records of a mass whose spring is stiffer, and pushes, in the later one."""
    records = []
    for group, (stiffness, push) in enumerate(((K, 0.0), (1.2 * K, 0.8))):
        record = replace(pushed(240), group=group)
        states = exact(record, (M, stiffness, D), START, record.inputs[:, 0] - push)
        noise = 1e-3 * np.random.default_rng(group).standard_normal((240, 1))
        records.append(replace(record, outputs=states[:, :1] + noise))
    local = LocalValues(("before", "after"))
    made = subject_of(mass(), records, interpolate=False, local=local, **options)
    assert made is not None
    return made


def test_values_that_differ_are_those_of_the_records():
    joint = Joint(subject(), (OFFSET,))
    base = joint.subject.base
    begin = replace(start_values(joint, base, base), starts=base.point.starts)
    start = joint.fit((), [begin])
    fitted = joint.fit(DIFFERENCES, [joint.values(start.fit, ())])
    assert fitted.fit.explanations == 3
    assert fitted.freedom == start.freedom + 2
    values, covariance = strengths(joint, fitted.fit, DIFFERENCES, "stiffness")
    assert np.exp(values) == pytest.approx([K, 1.2 * K], rel=0.01)
    amounts, _ = strengths(joint, fitted.fit, DIFFERENCES, OFFSET)
    assert 2.0 * amounts == pytest.approx([0.0, 0.8], abs=0.03)
    change, error = difference(joint, fitted.fit, DIFFERENCES, "stiffness")
    assert change == pytest.approx(values[1] - values[0])
    assert error**2 == pytest.approx(np.array([-1.0, 1.0]) @ covariance @ np.array([-1.0, 1.0]))
    assert abs(change - np.log(1.2)) < 4.0 * error
    assert difference(joint, fitted.fit, DIFFERENCES, OFFSET)[0] == pytest.approx(1.0, abs=0.05)


def test_a_fit_may_start_from_values_of_another_set():
    joint = Joint(subject(), (OFFSET, CURVE))
    base = start_values(joint, joint.subject.base, joint.subject.base)
    later = {"stiffness": np.array([7.0]), OFFSET: np.array([0.4]), CURVE: np.arange(3.0)}
    point = joint.point((CURVE, "stiffness", OFFSET), replace(base, later=later))
    assert point.q[len(joint.subject.problem.free) :].tolist() == [7.0]
    assert point.values[joint.size :].tolist() == [0.0, 1.0, 2.0, 0.4]
    problem = joint.problem((CURVE, "stiffness", OFFSET))
    own = problem.setting(point, joint.terms, 1)
    assert own.values.tolist()[:4] == [0.4, 0.0, 1.0, 2.0]
    assert problem.setting(point, joint.terms, 0).values == pytest.approx(base.terms)
    assert (problem.local.changes, problem.local.released) == (3, 5)


def test_of_two_that_explain_alike_neither_is_sure():
    """Without force and damping a stiffer spring is a smaller mass."""
    records = []
    for group, stiffness in enumerate((K, 1.2 * K)):
        record = replace(pushed(240), group=group, inputs=np.zeros((240, 1)))
        states = exact(record, (M, stiffness, 0.0), START, record.inputs[:, 0])
        noise = 1e-4 * np.random.default_rng(group).standard_normal((240, 1))
        records.append(replace(record, outputs=states[:, :1] + noise))
    made = subject_of(
        mass(),
        records,
        hold=["damping"],
        values={"damping": 0.0},
        interpolate=False,
        local=LocalValues(("before", "after")),
    )
    joint = Joint(made, ())
    begin = Values(made.base.point.q, np.zeros(0), {}, made.base.point.starts)
    every = ("mass", "stiffness")
    common, separate = joint.fit((), [begin]), joint.fit(every, [begin])
    selected = Selection(joint, common, separate, every).select()
    assert len(selected.chosen) == 1
    assert not selected.sure
    assert selected.doubtful == set(every)


def test_what_is_held_or_local_to_each_record_is_no_candidate():
    made = subject(hold=["damping"])
    problem = made.problem
    local = replace(problem.local, each=("mass",))
    assert Joint(made, (OFFSET,)).all_differences([made.base]) == [OFFSET, "mass", "stiffness"]
    own = subject_of(mass(), problem.records, local=local, interpolate=False)
    assert Joint(own, ()).all_differences([own.base]) == ["stiffness", "damping"]
