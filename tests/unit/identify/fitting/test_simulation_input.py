"""Claims: the input of a simulation over part of a record is that part, and all else stays."""

from __future__ import annotations

import numpy as np

from orchestration.identify.fitting.simulation_input import SimulationInput

TIME = np.arange(5.0)
WHOLE = SimulationInput(TIME, {"u": TIME**2, "level": np.float64(3.0)}, {"tau": 1.5}, 50.0)


def test_a_part_has_its_samples_of_every_input_and_all_else_of_the_whole():
    part = WHOLE.over(slice(1, 3))
    assert part.time.tolist() == [1.0, 2.0]
    assert {name: u.tolist() for name, u in part.inputs.items()} == {
        "u": [1.0, 4.0],
        "level": [3.0, 3.0],
    }
    assert (part.parameters, part.effort) == ({"tau": 1.5}, 50.0)


def test_another_course_of_an_input_leaves_the_first_alone():
    other = WHOLE.with_input("u", -TIME)
    assert other.inputs["u"].tolist() == (-TIME).tolist()
    assert other.inputs["level"] == 3.0
    assert WHOLE.inputs["u"].tolist() == (TIME**2).tolist()
