"""Claims: PyFMI integrates our FMUs to what they compute by themselves.

At a jump of a table it takes the value before, so that inputs may not jump at a sample.
"""

from __future__ import annotations

import pytest

from tests.support import pyfmi_host
from tests.support.exchange import both_ways, distance
from tests.support.stimuli import STIMULI

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not pyfmi_host.INTERPRETER, reason=pyfmi_host.MISSING),
]
TABLE = """
import numpy as np
from pyfmi.common.core import TrajectoryLinearInterpolation
steps = np.array([[0.0], [0.0], [1.0], [1.0]])
table = TrajectoryLinearInterpolation(np.array([0.0, 1.0, 1.0, 2.0]), steps)
print(table.eval(1.0)[0, 0], table.eval(1.0 + 1e-7)[0, 0])
"""


def test_a_table_that_jumps_has_the_value_before_at_the_jump():
    """Without any FMU. Between two points of one time, fmpy and NumPy take the later one."""
    assert pyfmi_host.run("-c", TABLE).split() == ["0.0", "1.0"]


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", STIMULI)
def test_cvode_computes_what_co_simulation_does(fmu, name, fmi):
    for output, (found, expected) in both_ways(
        *(fmu(name, "native", fmi), fmu(name, "native")),
        *STIMULI[name],
        simulate=pyfmi_host.simulate_fmu,
        relative_tolerance=1e-9,
    ).items():
        assert distance(found, expected) <= 1e-5, output
