"""Claims: the example of the clamped actuator charges it as its circuit does."""

import numpy as np
import pytest

import fmus
from fmus.galvanostat.systems import EXAMPLES
from orchestration import master
from orchestration.system import library


@pytest.mark.slow
def test_the_clamped_actuator_is_charged_through_its_circuit():
    """At constant length its force is that of the charge, and R2 i = Q/C + (R1 + R2) dQ/dt."""
    (example,) = EXAMPLES
    time = np.linspace(0.0, 2.0, 201)
    inputs = {name: np.full(len(time), value) for name, value in example.inputs.items()}
    shown = ["actuator.charge", "actuator.tension"]
    run = master.run(library.build(example.system), time, inputs, record=shown)
    film = fmus.component("ppy_actuator_length_driven")()
    rate = 1.0 / ((film.R1 + film.R2) * film.C)
    charge = film.R2 * example.inputs["current_command"] * film.C * (1.0 - np.exp(-rate * time))
    assert run.signals["actuator.charge"] == pytest.approx(charge, rel=1e-6, abs=1e-9)
    # creep, which is slow, takes a little of it
    tension = film.k1 * (example.inputs["length_change"] - film.alpha * charge)
    assert run.signals["actuator.tension"] == pytest.approx(tension, rel=0.02)
