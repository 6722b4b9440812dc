"""Claims: a search ends at the minimum, and enters no model whose errors are refused."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.identify.black_box import armax, input_output_data
from orchestration.identify.black_box.gauss_newton import minimise
from tests.support.black_box import box_jenkins_record


class Valley:
    """Rosenbrock's function as a sum of two squares; zero at (1, 1)."""

    def errors(self, theta):
        x, y = theta
        return np.array([10.0 * (y - x**2), 1.0 - x])

    def jacobian(self, theta):
        return np.array([[-20.0 * theta[0], 10.0], [-1.0, 0.0]])


class Wall(Valley):
    """The same where x may be no larger than a half: there x = 1/2, y = 1/4 is the lowest."""

    def errors(self, theta):
        if theta[0] > 0.5:
            raise UserError("x is larger")
        return super().errors(theta)


def test_a_curved_valley_is_followed_to_its_end():
    end = minimise(Valley(), np.array([-1.2, 1.0]))
    assert end.converged
    assert end.theta == pytest.approx(np.ones(2), abs=1e-6)
    assert end.cost == pytest.approx(0.0, abs=1e-12)


def test_models_whose_errors_are_refused_are_not_entered():
    end = minimise(Wall(), np.array([-1.2, 1.0]))
    assert end.theta[0] <= 0.5
    assert end.cost == pytest.approx(0.25, rel=0.05)


def test_a_structure_that_cannot_describe_the_data_is_searched_to_the_end():
    """Gauss-Newton steps go too far there, again and again."""
    record = box_jenkins_record(0, 5000)
    found = armax(input_output_data(record.inputs, record.output, 1.0), 3, 3, 3)
    assert found.converged
    assert not any("iterations" in message for message in found.messages)
