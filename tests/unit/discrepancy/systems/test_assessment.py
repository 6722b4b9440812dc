"""A residual is measured minus simulated in every figure and every word of a member's output."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.systems.adjustment import ParameterSearch
from orchestration.discrepancy.systems.assessment import assess_outputs
from orchestration.discrepancy.systems.cut import isolated_members
from orchestration.discrepancy.systems.member import choose_interpolation, opened
from orchestration.system import Port, read_system_record
from tests.support.system.lags import SAMPLES, STEP, lags

TIME = STEP * np.arange(SAMPLES)


@pytest.fixture
def altered(tmp_path):
    """Open the second lag, its measured output with something added."""
    system = lags(tmp_path, 0.0)
    record, measured = read_system_record(tmp_path / "record.csv", system, {})

    def open_member(added):
        changed = measured | {Port("b", "x"): measured[Port("b", "x")] + added}
        return opened(isolated_members(system, changed, {})[1], record.time, 50, lambda used: None)

    return open_member


def test_a_step_up_of_the_measured_output_is_a_step_up_of_its_residual(altered):
    later = TIME > 50.0
    with altered(np.where(later, 0.2, 0.0)) as simulation:
        assessment = assess_outputs(simulation, {})["x"]
        search = ParameterSearch(simulation, {"x": assessment.simulated})
        search.names = ["tau"]
        residual = search.width["x"] * search._residual(search.start)
    assert assessment.random_walk.significant
    for values in (
        residual,
        assessment.measured - assessment.simulated,
        assessment.random_walk.trend,
    ):
        assert values[later].mean() - values[~later].mean() == pytest.approx(0.2, rel=0.02)
    assert residual[later].mean() > 0.1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_added_in_proportion_to_an_input_correlates_with_it_in_number_and_word(
    altered, sign
):
    with altered(np.zeros(SAMPLES)) as simulation:
        fed = simulation.isolated.inputs["u"].values
    with altered(0.02 * sign * (fed - fed.mean())) as simulation:
        assessment = assess_outputs(simulation, {})["x"]
    correlations = {c.signal: c for c in assessment.correlations}
    assert correlations["u"].lag == 0.0
    assert correlations["u"].significant
    assert np.sign(correlations["u"].strength) == sign
    assert assessment.regression.significant
    assert sign * np.corrcoef(assessment.regression.fitted, fed)[0, 1] > 0.9
    assert (
        correlations["u"]
        .describe("x")
        .startswith(f"x correlates with u: {'+' if sign > 0 else '-'}0.")
    )


def test_the_slopes_of_a_search_are_those_of_its_residual(altered):
    """Held against central differences: with one sign of the residual and another of its slopes
    nothing is found.
    """
    with altered(0.0) as simulation:
        choose_interpolation(simulation, {})
        search = ParameterSearch(simulation, simulation.simulate({}))
        search.names = ["tau"]
        q = search.start + 0.2
        slopes = search._slopes(q)
        up, down = (search._rows(q + sign * 0.005).copy() for sign in (1.0, -1.0))
        assert slopes[:, 0] == pytest.approx(
            (up - down) / 0.01, rel=0.03, abs=0.02 * np.abs(slopes).max()
        )
