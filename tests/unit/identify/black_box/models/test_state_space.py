"""States of a state-space model against the recursion that defines them."""

import numpy as np
import pytest

from orchestration.identify.black_box.models.state_space import states


def test_states_are_those_of_the_recursion():
    random = np.random.default_rng(4)
    a = np.array([[0.5, 1.0, 0.0], [0.0, 0.5, 1.0], [0.0, 0.0, 0.5]])  # one eigenvector only
    drive, x = random.standard_normal((50, 3)), random.standard_normal(3)
    expected = [x]
    for now in drive[:-1]:
        expected.append(a @ expected[-1] + now)
    assert states(a, drive, x) == pytest.approx(np.array(expected), abs=1e-12)
