import math

import numpy as np
import pytest
import scipy.constants
from hypothesis import given
from hypothesis import strategies as st

import fmus
from fmus import MODELS, component
from fmus.kit import Parameter, UserError, units
from fmus.kit.units import (
    base_unit,
    convert,
    format_range,
    format_value,
    from_modelica,
    to_modelica,
)
from tests.support.kit_samples import Thermostat


@pytest.mark.parametrize(
    ("value", "unit", "to", "expected"),
    [
        (1.0, "in", "m", scipy.constants.inch),
        (1.0, "lbf", "N", scipy.constants.lbf),
        (1.0, "deg", "rad", scipy.constants.degree),
        (1.0, "hour", "s", scipy.constants.hour),
        (1.0, "eV", "J", scipy.constants.eV),
        (1.0, "g", "kg", scipy.constants.gram),
        (1.0, "psi", "Pa", scipy.constants.psi),
        (0.0, "degC", "K", scipy.constants.zero_Celsius),
        (212.0, "degF", "degC", 100.0),
        (25.0, "degC", "K", 298.15),
        (300.0, "K", "degC", 26.85),
        (6.8e-5, "m/C", "mm/C", 0.068),
        (6300.0, "N/m", "N/mm", 6.3),
        (1.7e6, "N*s/m", "N*s/mm", 1.7e3),
        (5.0, "%", "1", 0.05),
        (0.5, "1", "%", 50.0),
        (1.0, "mA*hour", "C", 3.6),
        (2.0, "kΩ", "ohm", 2000.0),
        (3.0, "N·m", "J", 3.0),
        (1.0, "V/A", "ohm", 1.0),
        (4.0, "C/V", "F", 4.0),
        (7.0, "ohm", "ohm", 7.0),
    ],
)
def test_conversion(value, unit, to, expected):
    assert convert(value, unit, to) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("unit", "exponents", "factor", "offset"),
    [
        ("V", {"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0, 0.0),
        ("ohm", {"kg": 1, "m": 2, "s": -3, "A": -2}, 1.0, 0.0),
        ("F", {"kg": -1, "m": -2, "s": 4, "A": 2}, 1.0, 0.0),
        ("C", {"A": 1, "s": 1}, 1.0, 0.0),
        ("N", {"kg": 1, "m": 1, "s": -2}, 1.0, 0.0),
        ("N/m", {"kg": 1, "s": -2}, 1.0, 0.0),
        ("N*s/m", {"kg": 1, "s": -1}, 1.0, 0.0),
        ("m/C", {"m": 1, "A": -1, "s": -1}, 1.0, 0.0),
        ("m/C^2", {"m": 1, "A": -2, "s": -2}, 1.0, 0.0),
        ("W/K", {"kg": 1, "m": 2, "s": -3, "K": -1}, 1.0, 0.0),
        ("rad", {"rad": 1}, 1.0, 0.0),
        ("1", {}, 1.0, 0.0),
        ("%", {}, 0.01, 0.0),
        ("mm", {"m": 1}, 1e-3, 0.0),
        ("deg", {"rad": 1}, math.pi / 180, 0.0),
        ("degC", {"K": 1}, 1.0, 273.15),
        ("degF", {"K": 1}, 5 / 9, 273.15 - 32 * 5 / 9),
        ("lbf/inch", {"kg": 1, "s": -2}, scipy.constants.lbf / scipy.constants.inch, 0.0),
        ("mol", {"mol": 1}, 1.0, 0.0),
        ("cd", {"cd": 1}, 1.0, 0.0),
    ],
)
def test_base_units(unit, exponents, factor, offset):
    base = base_unit(unit)
    assert base.exponents == exponents
    assert base.factor == pytest.approx(factor, rel=1e-9)
    assert base.offset == pytest.approx(offset, rel=1e-9, abs=1e-12)


@given(
    value=st.floats(-1e6, 1e6),
    unit=st.sampled_from(["mm", "degC", "degF", "%", "lbf", "mV", "uF", "deg"]),
)
def test_base_unit_says_what_convert_does(value, unit):
    base = base_unit(unit)
    to = {
        "mm": "m",
        "degC": "K",
        "degF": "K",
        "%": "1",
        "lbf": "N",
        "mV": "V",
        "uF": "F",
        "deg": "rad",
    }[unit]
    assert convert(value, unit, to) == pytest.approx(
        base.factor * value + base.offset, rel=1e-9, abs=1e-9
    )


@given(value=st.floats(-1e9, 1e9))
def test_there_and_back(value):
    for unit, display in (("m", "mm"), ("K", "degC"), ("m/C", "mm/C"), ("J", "kJ")):
        assert convert(convert(value, unit, display), display, unit) == pytest.approx(
            value, rel=1e-12, abs=1e-9
        )


def test_arrays_keep_their_shape():
    metres = convert(np.array([[1.0, 2.0], [3.0, np.nan]]), "mm", "m")
    np.testing.assert_allclose(metres, [[0.001, 0.002], [0.003, np.nan]], rtol=1e-15)


def test_what_cannot_be_converted_is_named():
    with pytest.raises(
        UserError, match=r"record.csv column force: unit 'mm' cannot be converted to 'N'"
    ):
        convert(1.0, "mm", "N", "record.csv column force")


@pytest.mark.parametrize("unit", ["newtonn", "Nm/", "arm per leg", "??", "N**", "3 mm"])
def test_unknown_units_are_refused_in_one_line(unit):
    with pytest.raises(UserError, match="unknown unit") as caught:
        units.parse(unit)
    assert repr(unit) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.timeout(10)
@pytest.mark.parametrize(
    "unit", ["9**9**9**9", "m**9**9", "(9)**9", "m^(9**9)", "m^999", "m" * 10**6, "(" * 10**6]
)
def test_what_would_be_computed_for_ever_is_no_unit(unit):
    with pytest.raises(UserError, match="unknown unit") as caught:
        units.parse(unit)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("unit", ["V/Hz**0.5", "bit"])
def test_units_that_fmi_cannot_tell_are_refused(unit):
    with pytest.raises(UserError, match="not made of integer powers of SI base units"):
        base_unit(unit)


def test_every_declared_unit_is_si_and_fits_its_display_unit():
    for cls in (Thermostat, *map(fmus.component, fmus.COMPONENTS)):
        for v in cls.layout.variables:
            assert base_unit(v.unit).factor == 1.0
            assert base_unit(v.unit).offset == 0.0
            if v.display:
                convert(1.0, v.unit, v.display)


def test_there_is_one_registry():
    assert units.registry() is units.registry()


@pytest.mark.parametrize(
    ("unit", "to"),
    [("Hz", "rpm"), ("turn/s", "Hz"), ("deg/s", "Hz"), ("Hz", "rad/s"), ("deg", "1")],
)
def test_an_angle_is_not_a_number(unit, to):
    with pytest.raises(UserError, match="cannot be converted"):
        units.convert(1.0, unit, to)


def test_angles_convert_among_themselves():
    assert units.convert(60.0, "rpm", "rad/s") == pytest.approx(2.0 * math.pi)
    assert units.convert(180.0, "deg", "rad") == pytest.approx(math.pi)
    assert units.convert(1.0, "kHz", "1/s") == pytest.approx(1000.0)


def test_values_are_shown_in_the_unit_people_read():
    v = {
        v.name: v
        for v in (*Thermostat.layout.variables, *fmus.component("ppy_actuator").layout.parameters)
    }
    assert format_value(6.8e-5, v["alpha"]) == "0.068 mm/C"
    assert format_value(295.0, v["setpoint"]) == "21.85 degC"
    assert format_value(True, v["enabled"]) == "true"
    assert format_value(3, v["stages"]) == "3"
    assert format_range(v["heater"]) == "≥ 0 W"
    assert format_range(v["stages"]) == "1 … 5"
    assert format_range(v["enabled"]) == ""


# by hand, from the specification of the language (3.6, chapter 19) and the names in
# Modelica.Units.SI
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
    assert units.to_familiar(modelica) == units.to_familiar(ours) == ours


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
        ("℃", "degC"),
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
    "unit", ["rev/minute.x", "bananas", "m2m", "m123", "Ohmage", "x" * 5000, "9.9.9.9"]
)
def test_what_nobody_knows_stays_and_cannot_be_converted(unit):
    assert units.to_familiar(unit) == unit
    with pytest.raises(units.UserError, match="unknown unit"):
        units.parse(unit)


@pytest.mark.parametrize("name", MODELS)
def test_units_of_our_models_come_back_as_they_were_declared(name):
    layout = component(name).layout
    declared = {unit for v in layout.variables for unit in (v.unit, v.display) if unit}
    assert {units.to_familiar(to_modelica(unit)) for unit in declared} == declared


COMMON = [*units._COHERENT, *(p + name for p in units._PREFIXES for name in units._PREFIXED)]
PRODUCTS = [
    f"{a}{sign}{b}" for a in units._COHERENT for b in units._COHERENT for sign in ("*", "/")
]


OTHERS = ["1", "N*s/m", "W/(m^2*K)", "V/A/s", "m**-2", "mm/C^2", "kN/mm", "mV/mA", "1/ms", "us^2"]


@pytest.mark.parametrize("names", [COMMON, PRODUCTS, OTHERS])
def test_common_units_are_what_pint_says(names, monkeypatch):
    known = {unit: units._common_base_unit(unit) for unit in names}
    monkeypatch.setattr(units, "_common_base_unit", lambda unit: None)
    assert known == {unit: base_unit.__wrapped__(unit) for unit in names}


def test_common_units_are_converted_as_pint_does(monkeypatch):
    values = np.random.default_rng(0).standard_normal(99) * 10.0 ** np.arange(-50, 49)
    pairs = [(p + name, name) for p in units._PREFIXES for name in units._PREFIXED]
    pairs = [(a, b) for a, b in pairs if a != "kg"]
    pairs += [("mm/C", "m/C"), ("mV/N", "V/N"), ("km*s", "m*s"), ("kN/mm", "N/m")]
    pairs += [(b, a) for a, b in pairs]
    converted = [convert(values, a, b) for a, b in pairs]
    monkeypatch.setattr(units, "_common_base_unit", lambda unit: None)
    np.testing.assert_array_equal(converted, [convert(values, a, b) for a, b in pairs])


@pytest.mark.parametrize(
    "unit", ["m^999", "m**2**3", "mi/s", "Mm^99", "9", "in", "µm", "", "m s", "K\u212a"]
)
def test_other_units_are_left_to_pint(unit):
    assert units._common_base_unit(unit) is None


def test_an_angle_stays_one_without_pint():
    with pytest.raises(UserError, match="'rad/s' cannot be converted to 'Hz'"):
        convert(1.0, "rad/s", "Hz")


@pytest.mark.parametrize(
    ("value", "unit", "display", "digits", "text"),
    [
        (0.013, "ohm", None, 3, "13.0 mΩ"),
        (18.2, "s", None, 2, "18 s"),
        (4512.0, "s", None, 3, "4510 s"),
        (1.7e6, "N*s/m", None, 3, "1.70 MN·s/m"),
        (6.8e-5, "m/C", "mm/C", 3, "68.0 µm/C"),
        (1.01, "1/C^2", None, 3, "1.01 C⁻²"),
        (300.0, "K", "degC", 3, "26.9 °C"),
        (-0.3, "rad", "deg", 3, "−17.2 °"),
        (999.97, "V", None, 3, "1.00 kV"),
        (0.0, "V", None, 3, "0 V"),
        (0.5, "1", None, 2, "0.50"),
        (5.0, "parsecs of nowhere", None, 2, "5.0 parsecs of nowhere"),
    ],
)
def test_values_have_prefixes_as_people_say_them(value, unit, display, digits, text):
    declared = Parameter(value, unit, display=display)
    assert units.format_prefixed(value, declared, digits) == text


@pytest.mark.parametrize(
    ("value", "like", "text"),
    [
        (0.99, 1.02, "0.990 C"),
        (1.05, -0.98, "1050 mC"),
        (0.0, 2e-3, "0 mC"),
        (2e-3, 0.0, "2.00 mC"),
        (2e-3, math.inf, "2.00 mC"),
        (2e-3, 0.99996, "0.00200 C"),
    ],
)
def test_values_beside_each_other_have_one_prefix(value, like, text):
    assert units.write_prefixed(value, "C", 3, like) == text


@given(st.floats(1e-12, 1e12), st.sampled_from(["V", "ohm", "N*s/m", "m/C"]))
def test_a_value_with_a_prefix_reads_back_to_its_digits(value, unit):
    number, _, shown = units.format_prefixed(value, Parameter(0.0, unit)).partition(" ")
    read = units.registry().Quantity(float(number), shown.replace("·", "*")).to(unit).magnitude
    assert read == pytest.approx(value, rel=0.5e-2)


@pytest.mark.parametrize(("unit", "to"), [("delta_degC", "degC"), ("degC", "delta_degC")])
def test_a_difference_of_temperatures_is_no_temperature(unit, to):
    with pytest.raises(UserError, match=r"T: delta_degC measures a difference, degC a temperature"):
        units.convert(5.0, unit, to, "T")
