"""Claims: a fault of the model description is found, and told in a line of the contract."""

from __future__ import annotations

import pytest

from tests.support.archive import on_linux
from tests.support.fmu_faults import Change, check_that_fault_is_found, pattern, put, text

FAULTS: dict[str, tuple[Change, str]] = {
    "undefined unit": (
        pattern(r'(name="R1".*?) unit="Ohm"', r'\1 unit="B"'),
        r'1 error: .*unit "B"',
    ),
    "schema": (text("<LogCategories>", "<LogCats/><LogCategories>"), r"1 error: .*LogCats"),
    "initial unknowns": (
        pattern(r"<InitialUnknowns>.*</InitialUnknowns>", ""),
        r"1 error: .*InitialUnknowns",
    ),
    "no dependencies": (
        pattern(r"(<Outputs>.*?<Unknown index=\"\d+\") dependencies=\"[^\"]*\"", r"\1"),
        r"1 warning: ModelStructure/Outputs: no dependencies.*charge",
    ),
    "bad index": (text('<Unknown index="', '<Unknown index="99'), r"1 error: "),
    "no co-simulation": (
        pattern(r"<CoSimulation .*</CoSimulation>", ""),
        r"1 warning: for model exchange alone",
    ),
    "identifier": (
        pattern('modelIdentifier="ppy_actuator"', 'modelIdentifier="ppy actuator"'),
        r"1 error: modelIdentifier 'ppy actuator' is no identifier",
    ),
    "unit without base": (text('<BaseUnit A="1" />', ""), r"2 warning: unit 'A' has no BaseUnit"),
    "fractional exponent": (
        text('<BaseUnit A="1" />', '<BaseUnit A="0.5" />'),
        r"2 error: unit 'A': exponent A='0.5'",
    ),
    "factor zero": (
        text('<BaseUnit A="1" />', '<BaseUnit A="1" factor="0" />'),
        r"2 error: unit 'A': factor='0'",
    ),
    "display factor": (
        text('factor="1000"', 'factor="thousand"'),
        r"2 error: display unit 'mm' of 'm': factor=",
    ),
    "no unit": (pattern(r' unit="Ohm"', ""), r"2 warning: no unit for R1, R2"),
    "no description": (
        pattern(r'(name="R1"[^>]*?) description="[^"]*"', r"\1"),
        r"2 warning: no description for R1$",
    ),
    "min above max": (
        pattern(r'min="0" max="1000000"', 'min="2" max="1"'),
        r"2 error: R1: min = 2 is above max = 1",
    ),
    "start outside": (
        text('start="0.43"', 'start="-1"'),
        r"2 error: R1: start = -1 is outside .* 0 to 1e\+06",
    ),
    "start not finite": (
        text('start="0.43"', 'start="NaN"'),
        r"2 error: R1: start = nan is not finite",
    ),
    "nominal": (
        text('nominal="0.0001"', 'nominal="0"'),
        r"2 error: \w+: nominal = 0, expected a positive",
    ),
    "no state": (
        pattern('canGetAndSetFMUstate="true"', ""),
        r"5 warning: canGetAndSetFMUstate is false",
    ),
    "once": (
        text("<CoSimulation", '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true"'),
        r"6 warning: .*Once",
    ),
    "fixed step": (
        text('canHandleVariableCommunicationStepSize="true"', ""),
        r"8 warning: canHandleVariable",
    ),
    "no derivative": (
        pattern('providesDirectionalDerivative="true"', ""),
        r"11 note: providesDirectional",
    ),
    "backslash": (put("a\\b.txt", b"x"), r"1 error: .*backslash"),
}


@on_linux
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_found(fmu, tmp_path, fault):
    check_that_fault_is_found(fmu("ppy_actuator", "native"), tmp_path, *FAULTS[fault])
