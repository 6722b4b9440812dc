"""Diagnoses of a motor with more friction and of a pendulum with more of a spring."""

from __future__ import annotations

import numpy as np
import pytest

from studies.clean.records import KINDS, conditions, draw
from studies.hidden.curves import hard_sinh
from studies.plants.change import static
from studies.plants.library import PLANTS, altered
from tests.support.lacking import FRICTION, diagnosed, motor


@pytest.fixture(scope="package")
def drag(tmp_path_factory):
    path = tmp_path_factory.mktemp("drag") / "motor.csv"
    drawn = motor(path, FRICTION)
    return drawn, diagnosed(path, drawn.plant.model)


@pytest.fixture(scope="package")
def spring(tmp_path_factory):
    """A pendulum with so much more of a spring that its model runs out of phase."""
    path = tmp_path_factory.mktemp("spring") / "pendulum.csv"
    case = conditions(PLANTS["Pendulum"], KINDS[0], 2, np.random.default_rng(2))
    drawn = draw(case, plant=altered("Pendulum", static("gravity", hard_sinh(0.6, 0.3))))
    drawn.write(path)
    return drawn, diagnosed(path, drawn.plant.model)
