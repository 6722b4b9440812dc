"""Claims: a reading beyond what there can be is passed over, and the one before used."""

import numpy as np
import pytest

from tests.support.estimator import measured, square


def test_single_faults_of_the_sensors_are_passed_over(estimate):
    current = square(600.0)
    voltage = measured(current)
    clean = estimate(current, voltage)["impedance"]
    faulty = np.array(current)
    voltage[[1510, 2222, 4013]] = [1e300, -1e4, 21.0]
    faulty[[1812, 5009]] = [
        1e6,
        -1e300,
    ]  # all between two reversals: the reading before is nearly right
    found = estimate(faulty, voltage)
    assert found["impedance"][1200:] == pytest.approx(clean[1200:], rel=0.005)
    assert np.all(found["voltage_limit"] == 1.5)
