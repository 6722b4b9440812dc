"""Every reason has its words, and the words of several are one line."""

from __future__ import annotations

import pytest

from orchestration.discrepancy.report.system import (
    describe_reason,
    describe_reasons,
    describe_source,
)
from orchestration.discrepancy.residuals.operating_regions import OperatingRegion
from orchestration.discrepancy.systems.cut import InputOrigin, InputSource, Reason, ReasonCode
from orchestration.discrepancy.systems.verdict import (
    AdjustedParameter,
    MemberDiagnosis,
    MemberVerdict,
)
from orchestration.system import Port

REGION = OperatingRegion("x", "u", 0.5, float("inf"), "A", 100, 2.0, (0.5, 1.5), 2.0, 0.0)
OFF = {
    "output": "x",
    "rms": 0.0771,
    "unit": "m",
    "noise_ratio": 26.0,
    "adjusted": False,
    "complete": True,
    "most_telling": None,
}
FACTS = {
    ReasonCode.INPUT_NOT_MEASURED: {"input": "u", "signal": "a.x"},
    ReasonCode.INPUT_WITH_GAPS: {"input": "u", "signal": "a.x"},
    ReasonCode.SIMULATION_FAILED: {"message": "no"},
    ReasonCode.LOOP_SIMULATION_FAILED: {"message": "no"},
    ReasonCode.TOO_UNCERTAIN: {"outputs": ["x", "y"]},
    ReasonCode.RESIDUAL_BEYOND_NOISE: OFF,
    ReasonCode.PARAMETERS_CHANGED: {"parameters": {"tau": AdjustedParameter(1.4, 1.0, "s", True)}},
    ReasonCode.CAUSE_NAMED: {
        "causes": ["drag(v)"],
        "alternatives": ["stiction(v)"],
        "parameters": {"tau": AdjustedParameter(1.4, 1.0, "s", True)},
    },
    ReasonCode.OUTPUTS_UNMOVED: {"outputs": ["x"]},
}


@pytest.mark.parametrize("code", ReasonCode)
def test_every_reason_has_words(code):
    assert describe_reason(Reason(code, FACTS.get(code, {})))


def test_a_residual_is_told_with_what_was_tried_and_what_tells_most():
    assert (
        describe_reason(Reason(ReasonCode.RESIDUAL_BEYOND_NOISE, OFF))
        == "x is off by 0.0771 m rms, 26.0 noise widths"
    )
    tried = OFF | {"adjusted": True, "complete": False, "most_telling": REGION}
    assert (
        describe_reason(Reason(ReasonCode.RESIDUAL_BEYOND_NOISE, tried))
        == "x is off by 0.0771 m rms, 26.0 noise widths, whatever its parameters (the search for"
        " parameters was cut short); x is 2.0× worse where u is above 0.5 A"
    )


def test_reasons_are_one_line():
    codes = (ReasonCode.RESIDUAL_IS_NOISE, ReasonCode.TOO_UNCERTAIN, ReasonCode.OUTPUTS_UNMOVED)
    reasons = [Reason(code, FACTS.get(code, {})) for code in codes]
    assert (
        describe_reasons(MemberDiagnosis("m", "m.fmu", "m", MemberVerdict.CONSISTENT, reasons))
        == "nothing is left that noise cannot account for; x, y says nothing: what its inputs do"
        " between samples, or their noise, moves it too far; x does not move in this record,"
        " which says little of it"
    )


@pytest.mark.parametrize(
    ("given", "linear", "words"),
    [
        (
            InputSource(InputOrigin.MEASURED, Port("a", "u")),
            False,
            "measured, held between samples",
        ),
        (InputSource(InputOrigin.UPSTREAM, Port("b", "x")), True, "b.x, linear between samples"),
        (InputSource(InputOrigin.SETTING, value=0.5), False, "0.5 (setting)"),
        (InputSource(InputOrigin.DEFAULT, value=2.0), False, "2 (value in the system)"),
    ],
)
def test_where_an_input_is_from(given, linear, words):
    assert describe_source(given, linear) == words
