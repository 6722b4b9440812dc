"""Inputs without noise. Oracle: the course that noise was laid over."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.law_corrections import search_laws
from orchestration.discrepancy.laws.input_denoising import (
    noise_of_inputs,
    smooth,
    with_denoised_inputs,
)
from orchestration.discrepancy.selection.input_noise import input_noise_std
from studies.clean.records import Case, draw
from tests.support.lacking import diagnosed
from tests.support.pace import slow_but

TIME = np.arange(3000) * 0.02
NOISE = 0.01


def binary(clock, seed=3):
    return np.repeat(np.sign(np.random.default_rng(seed).normal(size=-(-3000 // clock))), clock)[
        :3000
    ]


COURSES = {
    "square": np.sign(np.sin(1.3 * TIME + 0.1)),
    "binary, slow": binary(40),
    "binary, fast": binary(3),
    "staircase": np.floor(TIME / 6.0) * 0.3,
    "steps and rest": np.where(TIME % 20.0 < 5.0, 1.0, 0.0),
    "sine": np.sin(0.9 * TIME),
    "chirp": np.sin(0.05 * TIME**2),
    "triangle": 2.0 * np.abs((TIME / 7.0) % 1.0 - 0.5),
    "multisine": sum(np.sin(k * 0.4 * TIME + k * k) for k in range(1, 6)) / 3.0,
}


@pytest.mark.parametrize(
    "name",
    slow_but(
        COURSES, "chirp", "square", "binary, slow", "binary, fast", "staircase", "steps and rest"
    ),
)
def test_most_of_the_noise_goes_and_the_course_stays(name):
    course = COURSES[name]
    noisy = course + NOISE * np.random.default_rng(1).normal(size=len(TIME))
    found = smooth(TIME, noisy, input_noise_std(noisy))
    left = np.sqrt(np.mean((found - course) ** 2)) / NOISE
    assert left < (0.5 if name in ("chirp", "multisine", "triangle", "sine") else 0.2)


@pytest.mark.parametrize("name", ["binary, fast", "square"])
def test_levels_are_levels(name):
    noisy = COURSES[name] + NOISE * np.random.default_rng(2).normal(size=len(TIME))
    assert len(np.unique(smooth(TIME, noisy, input_noise_std(noisy)))) == 2


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
