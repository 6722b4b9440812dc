"""Line 2: units, descriptions and ranges."""

from __future__ import annotations

import math
import zipfile
from xml.etree import ElementTree

import pytest

# Exponents of SI base units, worked out by hand: C = A s, V = W/A, ohm = V/A, F = C/V, N = kg m/s^2.
UNITS = {
    "A": {"A": 1},
    "C": {"A": 1, "s": 1},
    "C/s": {"A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/C": {"m": 1, "A": -1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N*s/m": {"kg": 1, "s": -1},
}
# Display value = factor * value in the unit + offset
DISPLAY = {("m", "mm"): 1000.0, ("m/C", "mm/C"): 1000.0}
VARIABLES = {
    "R1": "ohm", "R2": "ohm", "C": "F", "alpha": "m/C", "k1": "N/m", "b1": "N*s/m", "k2": "N/m", "b2": "N*s/m",
    "current": "A", "voltage": "V", "charge": "C", "charge_start": "C", "der(charge)": "C/s",
    "electrochemical_displacement": "m", "mechanical_displacement": "m", "kelvin_elongation": "m",
    "maxwell_elongation": "m", "der(kelvin_elongation)": "m/s", "der(maxwell_elongation)": "m/s",
}  # fmt: skip
EXTRA = {
    "ppy_actuator": {"force": "N", "displacement": "m"},
    "ppy_actuator_length_driven": {"length_change": "m", "tension": "N"},
}
POSITIVE = ("R2", "C", "k1", "b1", "k2", "b2")


@pytest.fixture
def root(archive):
    with zipfile.ZipFile(archive) as opened:
        return ElementTree.fromstring(opened.read("modelDescription.xml"))


def reals(root) -> dict[str, ElementTree.Element]:
    return {v.attrib["name"]: v.find("Real") for v in root.iter("ScalarVariable") if v.find("Real") is not None}


def test_units_are_defined_by_their_si_exponents(root):
    defined = {}
    for unit in root.iter("Unit"):
        base = dict(unit.find("BaseUnit").attrib)
        assert float(base.pop("factor", 1.0)) == 1.0, "everything internal is SI"
        assert float(base.pop("offset", 0.0)) == 0.0
        defined[unit.attrib["name"]] = {name: int(power) for name, power in base.items()}
    assert defined == {name: UNITS[name] for name in defined}
    assert set(defined) == {real.attrib["unit"] for real in reals(root).values()}


def test_display_units_convert_rightly(root):
    found = {
        (unit.attrib["name"], d.attrib["name"]): (float(d.attrib["factor"]), float(d.attrib.get("offset", 0)))
        for unit in root.iter("Unit")
        for d in unit.iter("DisplayUnit")
    }
    assert found == {pair: (pytest.approx(DISPLAY[pair], rel=1e-15), 0.0) for pair in found}
    used = {(r.attrib["unit"], r.attrib["displayUnit"]) for r in reals(root).values() if "displayUnit" in r.attrib}
    assert used == set(found)


def test_every_variable_has_its_unit_and_a_description(root, name):
    units = {v: real.attrib["unit"] for v, real in reals(root).items()}
    expected = VARIABLES | EXTRA[name]
    assert {v: units[v] for v in expected} == expected
    for variable in root.iter("ScalarVariable"):
        assert len(variable.attrib["description"]) > 8, variable.attrib["name"]


def test_types_are_defined_and_agree_with_their_variables(root):
    types = {t.attrib["name"]: t.find("Real") for t in root.find("TypeDefinitions")}
    declared = set()
    for name, real in reals(root).items():
        if "derivative" in real.attrib:
            continue
        kind = types[real.attrib["declaredType"]]
        declared.add(real.attrib["declaredType"])
        assert kind.attrib["quantity"]
        assert kind.attrib["unit"] == real.attrib["unit"], name
        assert kind.attrib.get("displayUnit") == real.attrib.get("displayUnit"), name
    assert declared == set(types)


def test_physical_parameters_have_ranges_around_their_default(root):
    for name, real in reals(root).items():
        low, high = (float(real.attrib.get(key, fallback)) for key, fallback in (("min", -math.inf), ("max", math.inf)))
        if "start" in real.attrib:
            assert low <= float(real.attrib["start"]) <= high, name
        if name in POSITIVE:
            assert 0.0 < low < high < math.inf, name
    assert float(reals(root)["R1"].attrib["min"]) == 0.0


def test_small_quantities_have_a_nominal_value(root):
    for name in ("kelvin_elongation", "maxwell_elongation", "mechanical_displacement", "electrochemical_displacement"):
        assert float(reals(root)[name].attrib["nominal"]) == 1e-4
