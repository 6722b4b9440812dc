"""Claims: poles are told with frequency and damping; an integrator, however rounded, without."""

import io

import numpy as np
import pytest
from rich.console import Console
from scipy.linalg import expm

from orchestration.linear.poles import poles_table


def told(A, period=0.0):
    console = Console(file=io.StringIO(), width=100)
    console.print(poles_table(A, period))
    return console.file.getvalue()


MIXED = np.random.default_rng(1).normal(size=(3, 3))


@pytest.mark.parametrize(
    ("poles", "period"),
    [
        ([[1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.7]], 0.1),
        ([[1.0, 0.1, 0.005], [0.0, 1.0, 0.1], [0.0, 0.0, 0.7]], 0.1),
        ([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -3.0]], 0.0),
        ([[0.0, 0.0, 0.0], [0.0, -0.5, 0.0], [0.0, 0.0, -70.0]], 0.0),
    ],
)
@pytest.mark.parametrize("basis", [np.eye(3), MIXED, MIXED.T], ids=["plain", "mixed", "turned"])
def test_an_integrator_has_no_damping_however_its_pole_is_rounded(poles, period, basis):
    A = np.linalg.solve(basis, np.array(poles) @ basis)
    text = told(A, period)
    rows = [line.split() for line in text.split("damping\n")[1].splitlines()]
    rest = 1.0 if period else 0.0
    at_rest = [[f"{rest:g}", "0"]] * sum(np.diag(poles) == rest)
    assert [row for row in rows if len(row) < 3] == at_rest
    assert [row[2] for row in rows if len(row) == 3] == ["1"] * (3 - len(at_rest))


@pytest.mark.parametrize("period", [0.0, 0.01])
def test_an_oscillation_has_its_frequency_and_damping_however_it_is_sampled(period):
    """Of 3 Hz, damped by a quarter."""
    rate = 2.0 * np.pi * 3.0
    A = np.array([[0.0, 1.0], [-(rate**2), -2.0 * 0.25 * rate]])
    rows = [line.split() for line in told(expm(A * period) if period else A, period).splitlines()]
    assert [row[1:] for row in rows[-2:]] == 2 * [["3", "0.25"]]


def test_a_slow_pole_beside_a_fast_one_keeps_its_damping():
    text = told(np.diag([-1e-6, -1e5]))
    assert "1.592e-07        1" in text
    text = told(np.diag([1.0 + 1e-9, 0.5]), 1e-3)
    assert "-1" in text.split("damping")[1]
