"""Claims: with an unknown input to a law a model follows its record within the noise."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import stack
from orchestration.discrepancy.laws.base import search_of
from orchestration.discrepancy.laws.linear.unknown_input import (
    disturbed,
    estimate_unknown_input,
    noise_floor,
)
from orchestration.discrepancy.laws.map import LawMap
from studies.plants.models.motor import Motor


def widths(drawn, residual):
    """Noise widths that are left, by output."""
    return {o: float(np.sqrt(np.mean(e**2))) / drawn.deviation[o] for o, e in residual.items()}


@pytest.mark.slow
def test_a_free_course_lets_a_model_follow_where_its_own_run_tells_nothing(spring):
    drawn, diagnosis = spring
    base = diagnosis.selection.base
    assert widths(drawn, base.fit.residual)["position"] > 20.0
    search = search_of(diagnosis)
    found = LawMap(search, base)
    driven = base.candidate.with_effect(disturbed(base.candidate.cls, ["acceleration"]))
    course = estimate_unknown_input(search, base, found.laws, "acceleration", driven)
    assert widths(drawn, course.unexplained)["position"] < 1.5


@pytest.mark.slow
def test_a_course_is_what_the_plant_has_more(drag):
    drawn, diagnosis = drag
    base = diagnosis.selection.base
    found = LawMap(search_of(diagnosis), base)
    (_, course, _), followed = found.courses["acceleration"].parts[0], found.courses["acceleration"]
    assert max(widths(drawn, base.fit.residual).values()) > 5.0
    assert all(width < 1.3 for width in widths(drawn, followed.unexplained).values())
    assert np.ptp(course.states["omega"].begin) == pytest.approx(
        np.ptp(drawn.clean["speed"]), rel=0.1
    )


def test_an_addition_is_added():
    plain, more = Motor(), stack(Motor, disturbed(Motor, ["friction"]))()
    plain.omega = more.omega = 3.0
    more.friction_addition = 0.25
    assert more.friction() == plain.friction() + 0.25


def test_the_least_noise_is_that_of_differences_however_much_a_model_lacks():
    """A slow wave a hundred times larger than the noise; a residual of nothing has a floor of 1."""
    noise = 0.02 * np.random.default_rng(1).standard_normal(5000)
    wave = 2.0 * np.sin(np.arange(5000) / 500.0)
    floor = noise_floor({"y": wave + noise, "z": np.zeros(5000)})
    assert floor["y"] == pytest.approx(0.02, rel=0.1)
    assert floor["z"] == 1.0
