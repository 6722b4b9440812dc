"""Units in the grammar of the Modelica language, and back."""

import pytest

from fmus import MODELS, component
from fmus.kit import units
from fmus.kit.spelling import from_modelica, to_modelica

# by hand, from the specification of the language (3.6, chapter 19) and the names in Modelica.Units.SI
PAIRS = {
    "N*m": "N.m",
    "ohm": "Ohm",
    "mohm": "mOhm",
    "m/s^2": "m/s2",
    "s": "s",
    "V": "V",
    "C": "C",
    "N*s/m": "N.s/m",
    "A/V/s": "A/(V.s)",
    "kg*m^2": "kg.m2",
    "N*m*s/rad": "N.m.s/rad",
    "1/s": "1/s",
    "1": "1",
    "W/m^2/K": "W/(m2.K)",
    "degC": "degC",
    "mm/C": "mm/C",
    "us": "us",
    "J/kg/K": "J/(kg.K)",
    "%": "%",
}


@pytest.mark.parametrize(("ours", "modelica"), PAIRS.items())
def test_both_ways(ours, modelica):
    assert to_modelica(ours) == modelica
    assert from_modelica(modelica) == ours
    assert units.familiar(modelica) == units.familiar(ours) == ours


@pytest.mark.parametrize(
    ("ours", "modelica"),
    [
        ("m/s/s", "m/s2"),
        ("m/s**2", "m/s2"),
        ("(m/s)^2", "m2/s2"),
        ("((V)*s)^3", "V3.s3"),
        ("A·s", "A.s"),
        ("N m", "N.m"),
        ("kΩ", "kOhm"),
        ("V*s/s", "V"),
        ("V/V", "1"),
        ("s^-1", "1/s"),
        ("µm", "um"),
        ("°C", "degC"),
        ("1/(A.s)", "1/(A.s)"),
        ("A/(V*s)", "A/(V.s)"),
        ("A/V*s", "A.s/V"),
    ],
)
def test_other_ways_to_write_a_unit_are_brought_to_the_grammar(ours, modelica):
    assert to_modelica(ours) == modelica
    assert units.parse(modelica) == units.parse(ours)


@pytest.mark.parametrize("unit", ["V^0.5", "inH2O", "m^(1/2)", "2*m", "m(", "__import__('os')", ""])
def test_what_cannot_be_said_in_modelica_stays(unit):
    assert to_modelica(unit) == unit


@pytest.mark.parametrize(
    ("modelica", "same"),
    [
        ("s-1", "1/s"),
        ("m.s-2", "m/s^2"),
        ("kg.m2.s-3.A-1", "V"),
        ("(N.m)/rad", "N*m/rad"),
        ("m2", "m^2"),
        ("kOhm.m", "kohm*m"),
    ],
)
def test_units_of_other_tools_are_read(modelica, same):
    assert units.convert(3.0, modelica, same) == pytest.approx(3.0, rel=1e-15)


@pytest.mark.parametrize(
    "unit", ["rev/min", "bananas", "m2m", "m123", "Ohmage", "x" * 5000, "9.9.9.9"]
)
def test_what_nobody_knows_stays_and_cannot_be_converted(unit):
    assert units.familiar(unit) == unit
    with pytest.raises(units.UserError, match="unknown unit"):
        units.parse(unit)


@pytest.mark.parametrize("name", MODELS)
def test_units_of_our_models_come_back_as_they_were_declared(name):
    layout = component(name).layout
    declared = {unit for v in layout.variables for unit in (v.unit, v.display) if unit}
    assert {units.familiar(to_modelica(unit)) for unit in declared} == declared
