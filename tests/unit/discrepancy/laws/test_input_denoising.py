"""Inputs without noise. Oracle: the course that noise was laid over."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.law_corrections import search_laws
from orchestration.discrepancy.laws.input_denoising import noise_of_inputs, with_denoised_inputs
from studies.clean.records import Case, draw
from tests.support.lacking import diagnosed


@pytest.mark.slow
def test_noise_of_an_input_is_no_law(tmp_path):
    """Of a current that is one of two levels the measured one tells less the farther off it is: a
    curve, and none.
    """
    drawn = draw(
        Case(
            "Cell",
            "PRBS",
            "on input",
            seed=2026112900063,
            timing="long",
            smooth=False,
            at_rest=False,
        )
    )
    diagnosis = diagnosed(drawn.write(tmp_path / "cell.csv"), drawn.plant.model)
    noise = noise_of_inputs(diagnosis)
    size = np.std(drawn.inputs["current"])
    assert noise == {"current": pytest.approx(0.005 * size, rel=0.2)}
    calm = with_denoised_inputs(diagnosis, noise)
    assert len(np.unique(calm.estimation.inputs["current"])) == 2
    laws, told = search_laws(diagnosis)
    assert laws.noise == noise
    assert laws.best is None or not laws.best.confirmed
    assert told is diagnosis


def test_what_has_no_noise_stays_as_it_is(tmp_path):
    drawn = draw(
        Case("Cell", "PRBS", "Gaussian", seed=5, timing="long", smooth=False, at_rest=False)
    )
    assert noise_of_inputs(diagnosed(drawn.write(tmp_path / "cell.csv"), drawn.plant.model)) == {}
