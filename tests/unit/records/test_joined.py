"""Claims: a model over several runs does in each what it does alone, with the values that are that
run's own.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.identify.fitting.problem import ModelOverRuns, Problem
from orchestration.records.joined import MeasuredRun, base_name, names_in, sampled_alike, shown_name
from tests.support.several import OCVS, STARTS, TRUE, Cell, several, voltage

NAMES = ["R0", "tau1", *(f"ocv@{k}" for k in "abc"), *(f"relaxed_start@{k}" for k in "abc")]
VALUES = TRUE | {"ocv": 0.0, "relaxed_start": 0.0} | {f"ocv@{k}": OCVS[k] for k in "abc"}
VALUES |= {f"relaxed_start@{k}": STARTS[k] for k in "abc"}


@pytest.fixture(scope="module")
def data():
    return several("abc")


@pytest.fixture(scope="module")
def model(data):
    return ModelOverRuns(Cell, NAMES, False, data.runs)


def test_every_run_starts_anew_with_its_own_values(data, model):
    """The oracle is the exact solution."""
    ran = model.run(data.time, data.inputs, VALUES, runs=data.runs)
    for run in data.runs:
        own = voltage(
            data.inputs["current"][run.samples], STARTS[run.label], OCVS[run.label], **TRUE
        )
        assert ran.signals["voltage"][run.samples] == pytest.approx(own, abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_by_the_value_of_their_own_run(data, model, name):
    """The oracle is a central difference of the exact solution; other runs do not feel it."""
    slopes = model.run(data.time, data.inputs, VALUES, runs=data.runs).sensitivities["voltage"][
        :, NAMES.index(name)
    ]
    h = 1e-5
    for run in data.runs:
        i, ends = data.inputs["current"][run.samples], []
        for sign in (1.0, -1.0):
            here = {"start": STARTS[run.label], "ocv": OCVS[run.label]} | TRUE
            base = {"relaxed_start": "start"}.get(base_name(name), base_name(name))
            if name in (base_name(name), run.own(base_name(name))):
                here[base] += sign * h
            ends.append(voltage(i, **here))
        assert slopes[run.samples] == pytest.approx((ends[0] - ends[1]) / (2.0 * h), abs=1e-5)


def test_other_runs_have_no_part_in_what_is_fitted_runs_own(model):
    """Of a run that was not fitted nothing is known: its values are the common ones."""
    other = several("de")
    ran = model.run(
        other.time, other.inputs, VALUES | {"ocv": 3.0, "relaxed_start@d": 7.0}, runs=other.runs
    )
    own = [k for k, name in enumerate(NAMES) if "@" in name]
    assert not ran.sensitivities["voltage"][:, own].any()
    for run, start in zip(other.runs, (7.0, 0.0), strict=True):
        assert ran.signals["voltage"][run.first] == pytest.approx(
            3.0 - TRUE["R0"] * other.inputs["current"][run.first] - TRUE["R1"] * start
        )


def test_a_change_in_one_run_is_its_own_beside_the_common_value(data):
    """``R0`` of all runs and ``R0@c`` of one: each acts where the other does not."""
    names = ["R0", "R0@c"]
    slopes = ModelOverRuns(Cell, names, False, data.runs).run(
        data.time, data.inputs, VALUES, runs=data.runs
    )
    for run in data.runs:
        acting = slopes.sensitivities["voltage"][run.samples].any(axis=0).tolist()
        assert acting == [run.label != "c", run.label == "c"]


def test_a_problem_has_what_is_said_of_a_parameter_for_every_run(data):
    problem = Problem(
        Cell,
        data.time,
        data.inputs,
        data.measured,
        NAMES,
        {"ocv": 3.1, "ocv@b": 3.2},
        runs=data.several,
    )
    assert {n: problem.start[n] for n in NAMES if n.startswith("ocv")} == {
        "ocv@a": 3.1,
        "ocv@b": 3.2,
        "ocv@c": 3.1,
    }
    assert problem.declared["ocv@a"] is problem.declared["ocv"]
    assert problem.even
    q = problem.position(VALUES)
    assert problem.evaluate(q)[0]["voltage"].shape == (
        sum(run.last - run.first for run in data.runs),
    )


def test_runs_of_different_rates_are_not_sampled_alike():
    time = np.concatenate([np.arange(100.0), 200.0 + 0.5 * np.arange(100.0)])
    halves = (MeasuredRun("a", 0, 100), MeasuredRun("b", 100, 200))
    assert [sampled_alike(time, runs) for runs in (halves, halves[:1], halves[1:])] == [
        False,
        True,
        True,
    ]


words = st.text(st.characters(codec="ascii", categories=["L", "N"]), min_size=1)


@given(
    name=words,
    labels=st.lists(st.text(min_size=1), min_size=1, max_size=5, unique=True),
    value=st.floats(),
)
def test_a_value_is_that_of_its_run_whatever_the_label(name, labels, value):
    runs = [MeasuredRun(label, 10 * k, 10 * k + 5) for k, label in enumerate(labels)]
    (first, *others) = [run.values({name: 0.0, runs[0].own(name): value}) for run in runs]
    assert np.array_equal(first[name], value, equal_nan=True)
    assert all(plain == {name: 0.0} for plain in others)
    names = names_in(runs, ["shared", name], [name])
    assert names == ["shared", *(f"{name}@{label}" for label in labels)] or name == "shared"
    assert {base_name(n) for n in names} == {"shared", name}


def test_a_record_by_itself_needs_no_name():
    alone = MeasuredRun("", 0, 5)
    assert (alone.own("R0"), names_in([alone], ["R0"], ["R0"]), shown_name("R0")) == (
        "R0",
        ["R0"],
        "R0",
    )
    assert shown_name("ocv@3") == "ocv (run 3)"
