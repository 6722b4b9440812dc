"""The verdict on a member of a loop, from that on the model of all of them."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from orchestration.discrepancy.conclude import Verdict
from orchestration.discrepancy.systems.cut import ReasonCode
from orchestration.discrepancy.systems.loop_verdict import _verdict
from orchestration.discrepancy.systems.verdict import AdjustedParameter, MemberVerdict


def diagnosis(verdict, causes=(), inconclusive=False):
    """A diagnosis with some causes, each with one parameter of its own."""
    steps = [
        SimpleNamespace(
            chosen=SimpleNamespace(effect=SimpleNamespace(declared={f"{cause}_force": None})),
            alternatives=[SimpleNamespace(effect_name="other")],
        )
        for cause in causes
    ]
    return SimpleNamespace(
        verdict=verdict,
        causes=list(causes),
        alternatives=["other"] if causes else [],
        inconclusive=inconclusive,
        selection=SimpleNamespace(steps=steps),
    )


def parameter(differs):
    return AdjustedParameter(2.0, 1.0, "N", differs, (1.9, 2.1))


FINE = {"R": parameter(False)}
WORST = SimpleNamespace(rms=0.1, unit="m", noise_ratio=7.0, most_telling=None)


@pytest.mark.parametrize(
    ("said", "parameters", "verdict", "code"),
    [
        (diagnosis(Verdict.CONSISTENT), FINE, "consistent", "residual_is_noise"),
        (diagnosis(Verdict.RECALIBRATE), FINE, "consistent", "residual_is_noise"),
        (
            diagnosis(Verdict.RECALIBRATE),
            {"R": parameter(True)},
            "recalibrate",
            "parameters_changed",
        ),
        (diagnosis(Verdict.CAUSE, ["dry"]), FINE, "wrong", "cause_named"),
        (diagnosis(Verdict.UNEXPLAINED), FINE, "wrong", "residual_beyond_noise"),
        (
            diagnosis(Verdict.AMBIGUOUS, inconclusive=True),
            FINE,
            "cannot be judged",
            "not_excited",
        ),
    ],
)
def test_a_verdict_on_a_loop_is_one_on_its_member(said, parameters, verdict, code):
    reached, reason = _verdict(said, parameters, {"position": WORST})
    assert reached is MemberVerdict(verdict)
    assert reason.code == code


def test_a_cause_is_told_with_its_parameters_and_what_it_cannot_be_told_from():
    parameters = FINE | {"dry_force": parameter(True)}
    _, reason = _verdict(diagnosis(Verdict.CAUSE, ["dry"]), parameters, {"position": WORST})
    assert reason.code is ReasonCode.CAUSE_NAMED
    assert reason.facts["causes"] == ["dry"]
    assert reason.facts["alternatives"] == ["other"]
    assert list(reason.facts["parameters"]) == ["dry_force"]
