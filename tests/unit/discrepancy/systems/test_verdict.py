"""Claims: the verdict on a member is the gravest that its outputs and parameters call for."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.random_walk import RandomWalkTest
from orchestration.discrepancy.residuals.regression import ResidualRegression
from orchestration.discrepancy.systems.assessment import OutputAssessment
from orchestration.discrepancy.systems.cut import ReasonCode
from orchestration.discrepancy.systems.verdict import AdjustedParameter, MemberVerdict, verdict_of

N = 100
SWING = np.sin(np.arange(N))
NOTHING = np.zeros(N)


def assessed(explained=0.0, uncertainty=0.0, measured=SWING):
    """An output with noise of 0.01, of whose residual a regression explains an RMS."""
    p_value = 1e-9 if explained else 1.0
    return OutputAssessment(
        regression=ResidualRegression(explained, p_value, NOTHING),
        random_walk=RandomWalkTest(0.0, 1.0, 0.0, NOTHING),
        correlations=[],
        regions=[],
        measured=measured,
        simulated=measured,
        unit="V",
        fit_percent=99.0,
        rms=float(np.hypot(0.01, explained)),
        noise_std=0.01,
        input_uncertainty=uncertainty,
        whiteness=None,
    )


def parameter(differs):
    return {"R": AdjustedParameter(2.0, 1.0, "ohm", differs)}


@pytest.mark.parametrize(
    ("outputs", "parameters", "verdict", "codes"),
    [
        ([assessed()], {}, "consistent", ["residual_is_noise"]),
        ([assessed()], parameter(False), "consistent", ["residual_is_noise"]),
        ([assessed()], parameter(True), "recalibrate", ["parameters_changed"]),
        ([assessed(0.1)], parameter(True), "wrong", ["residual_beyond_noise"]),
        ([assessed(0.1, uncertainty=0.1)], {}, "consistent", ["residual_is_noise"]),
        ([assessed(0.1, uncertainty=0.5)], {}, "cannot be judged", ["too_uncertain"]),
        (
            [assessed(), assessed(uncertainty=0.5)],
            {},
            "consistent",
            ["residual_is_noise", "too_uncertain"],
        ),
        (
            [assessed(measured=0.001 * SWING)],
            {},
            "consistent",
            ["residual_is_noise", "outputs_unmoved"],
        ),
    ],
)
def test_the_gravest_counts(outputs, parameters, verdict, codes):
    final = {f"y{k}": output for k, output in enumerate(outputs)}
    reached, reasons = verdict_of(final, parameters, None)
    assert reached == MemberVerdict(verdict)
    assert [reason.code for reason in reasons] == codes


def test_the_worst_output_is_named():
    final = {"small": assessed(0.1), "large": assessed(0.2)}
    _, reasons = verdict_of(final, {}, None)
    assert reasons[0].code is ReasonCode.RESIDUAL_BEYOND_NOISE
    assert reasons[0].facts["output"] == "large"
