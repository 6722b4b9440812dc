"""Claims: responses are those of free runs, and a projection is least squares with priors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.diagnosis import Shape, Term
from orchestration.diagnosis.responses import Drives, Projection, Stepped, respond
from tests.support.diagnosed_vessels import drives_of, vessels


def test_laws_and_parameters_of_an_output_act_at_once() -> None:
    """Beside what they do through the states: as in the free run."""
    model, record, setting, course = vessels()
    part = model.linearise(record, setting, course)
    laws = np.array([model.laws.index(n) for n in ("flow", "second")])
    drive = np.column_stack([np.ones(201), np.cos(record.time)])
    found = respond(record, part, drives_of(drive, laws), 1)
    response = found.to_drives
    assert found.to_coordinates == pytest.approx(course.slopes[:, :, :2], abs=0.02)
    assert found.to_start == pytest.approx(course.slopes[:, :, 2:], abs=1e-5)
    assert np.abs(course.slopes[:, 1, 1]).max() > 0.1
    assert response[:, :, 1] == pytest.approx(np.outer(drive[:, 1], [0.0, 1.0]))
    constant = Term("flow", "", Shape.CONSTANT)
    moved = replace(setting, terms=(constant,), values=np.array([1e-3]))
    other = model.run(record, moved, np.array([1.0, 0.5]))
    assert other is not None
    difference = (other.outputs - course.outputs) / 1e-3
    assert response[:, :, 0] == pytest.approx(difference, abs=1e-5)


def test_every_so_many_samples_are_those_samples() -> None:
    model, record, setting, course = vessels()
    part = model.linearise(record, setting, course)
    drive, laws = np.sin(record.time)[:, None], np.array([model.laws.index("flow")])
    drives = drives_of(drive, laws)
    thin = respond(record, part, drives, 3)
    assert thin.to_drives == pytest.approx(respond(record, part, drives, 1).to_drives[::3])


@pytest.mark.parametrize("smooth", [False, True])
def test_many_columns_are_the_recursion_written_out(smooth: bool) -> None:
    """More than go at once, from start states, into a part of a larger array."""
    rng = np.random.default_rng(2)
    n, nx, ny, nw, columns, stride = 11, 3, 2, 4, 150, 4
    transitions, driven = rng.normal(size=(n - 1, nx, nx)), rng.normal(size=(n - 1, nx, nw))
    shown, direct = rng.normal(size=(n, ny, nx)), rng.normal(size=(n, ny, nw))
    start, values, amounts = (rng.normal(size=shape) for shape in ((nx, columns), (5, n), (3, n)))
    rows = np.array([rng.integers(0, count, columns) for count in (nw, 5, 3)])
    into = np.full((columns, ny, 9), np.nan)
    stepped = Stepped(transitions, shown, stride, smooth)
    drives = Drives(values, amounts, rows)
    found = stepped.responses(start, driven, direct, drives, into[:, :, 2:5])
    for c in range(columns):
        x, w, a = start[:, c], rows[0, c], values[rows[1, c]] * amounts[rows[2, c]]
        for k in range(n):
            if k % stride == 0:
                assert found[k // stride, :, c] == pytest.approx(
                    shown[k] @ x + direct[k, :, w] * a[k]
                )
            if k < n - 1:
                between = 0.5 * (a[k] + a[k + 1]) if smooth else a[k]
                x = transitions[k] @ x + driven[k, :, w] * between
    assert np.shares_memory(found, into)
    assert np.isnan(into[:, :, [0, 1, 5, 6, 7, 8]]).all()


RNG = np.random.default_rng(4)
TARGET, COLUMNS, OTHERS = RNG.normal(size=40), RNG.normal(size=(40, 3)), RNG.normal(size=(40, 5))
FOUND = Projection(TARGET, COLUMNS, OTHERS)


def test_products_are_those_in_the_covariance_of_the_others() -> None:
    """By Woodbury: C' (1 + N N')^-1 C."""
    inverse = np.linalg.inv(np.eye(40) + OTHERS @ OTHERS.T)
    expected = COLUMNS.T @ inverse @ COLUMNS
    assert FOUND.products(np.arange(3)) == pytest.approx(expected)
    assert FOUND.products(np.array([2, 0])) == pytest.approx(expected[np.ix_([2, 0], [2, 0])])
    assert FOUND.norms == pytest.approx(np.diag(expected))
    assert FOUND.across(np.array([1])) == pytest.approx(expected[[1]])
    sets = np.array([[2, 0], [1, 2]])
    assert FOUND.products(sets)[1] == pytest.approx(expected[np.ix_(sets[1], sets[1])])
    parts = [slice(30), slice(30, None)]
    assert sum(FOUND.products_within(sets, p) for p in parts) == pytest.approx(FOUND.products(sets))
    assert sum(FOUND.moments_within(p) for p in parts) == pytest.approx(FOUND.moments)
    assert FOUND.moments == pytest.approx(COLUMNS.T @ inverse @ TARGET)
    assert FOUND.remaining @ FOUND.remaining == pytest.approx(TARGET @ inverse @ TARGET)
    assert FOUND.alone == pytest.approx(np.diag(COLUMNS.T @ COLUMNS))


def test_what_remains_and_the_shift_are_those_of_ridge_regression() -> None:
    rows = np.vstack([OTHERS, np.eye(5)])

    def others(target: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(rows, np.append(target, np.zeros(5)), rcond=None)[0]

    def remaining(target: np.ndarray) -> np.ndarray:
        return np.append(target - OTHERS @ others(target), -others(target))

    assert FOUND.remaining == pytest.approx(remaining(TARGET))
    coefficients = np.array([0.3, -0.7])
    rest = TARGET - COLUMNS[:, [0, 2]] @ coefficients
    assert FOUND.shift(np.array([0, 2]), coefficients) == pytest.approx(others(rest))
