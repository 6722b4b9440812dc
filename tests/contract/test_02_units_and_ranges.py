"""Line 2: units, descriptions and ranges."""

from __future__ import annotations

import math
import re
import zipfile
from xml.etree import ElementTree

import pytest

from tests.contract.subjects import actuators_only

# Exponents of SI base units, worked out by hand: C = A s, V = W/A, Ohm = V/A, F = C/V, H = V s/A, N
# = kg m/s^2.
AMPERE, METRE, SECOND, KILOGRAM, RADIAN = ({unit: 1} for unit in ("A", "m", "s", "kg", "rad"))
BASE = {
    "1": {},
    "A": AMPERE,
    "m": METRE,
    "s": SECOND,
    "kg": KILOGRAM,
    "rad": RADIAN,
    "C": {"A": 1, "s": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "Hz": {"s": -1},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
}
# Display value = factor * value in the unit
DISPLAY = {
    ("m", "mm"): 1e3,
    ("m/C", "mm/C"): 1e3,
    ("A", "mA"): 1e3,
    ("V", "mV"): 1e3,
    ("s", "us"): 1e6,
    ("1", "%"): 1e2,
    ("rad", "deg"): 180.0 / math.pi,
    ("m/N", "mm/N"): 1e3,
    ("kg", "g"): 1e3,
    ("s", "ms"): 1e3,
    ("m/s", "mm/s"): 1e3,
    ("rad/s", "deg/s"): 180.0 / math.pi,
}
POSITIVE = {
    "ppy_actuator": "R2 C k1 b1 k2 b2",
    "ppy_actuator_length_driven": "R2 C k1 b1 k2 b2",
    "ppy_actuator_voltage_driven": "R1 R2 C k1 b1 k2 b2",
    "galvanostat": "current_limit compliance_voltage protection_period control_period",
    "voice_coil_dma": "R L m force_cutoff position_cutoff sample_period",
    "isotonic_stand": "placing_time full_scale lvdt_sensitivity sample_period",
    "degradation_estimator": "sample_period forgetting_time remaining_weight initial_covariance",
    "foot": "l1 l2 l3 k_an b_an r_po",
    "displacement_controller": "sample_period integral_time current_limit R2 C approach_time",
    "state_feedback": "sample_period charge_per_current current_limit charge_limit",
    "feedforward": "sample_period current_limit rate_limit R1 R2 C alpha k1 b1 k2 b2",
    "learning_controller": "sample_period current_limit",
    "impedance_controller": "sample_period force_max",
    "adaptive_controller": "sample_period model_time displacement_per_current current_limit",
    "pid": "sample_period integral_time",
    "foot_design": "l1 l2 l3 k_an b_an r_po",
    "foot_dynamic": "l1 l2 l3 k_an b_an r_po ankle_inertia tm_inertia mtp_inertia",
    "foot_displacement_driven": "l4 k_an b_an mtp_inertia ground_depth slip_velocity",
    "foot_free": "l1 l4 k_an r_po ankle_inertia mtp2_inertia ground_depth slip_velocity",
}


def exponents(unit: str) -> dict[str, int]:
    """Return the SI exponents of a unit in the grammar of the Modelica language (3.6, chapter 19).

    One numerator, at most one denominator, which is in brackets if it has several factors; factors
    have points between them, powers stand behind their names.
    """
    factor = r"[A-Za-z]+(?:-?[1-9])?"
    product = rf"{factor}(?:\.{factor})*"
    match = re.fullmatch(rf"(1|{product})(?:/(?:({factor})|\(({factor}\.{product})\)))?", unit)
    assert match, f"{unit!r} is not in the grammar of Modelica"
    total: dict[str, int] = {}
    for sign, part in ((1, match[1]), (-1, match[2] or match[3] or "")):
        for name, power in re.findall(r"([A-Za-z]+)(-?\d)?", part):
            for base, exponent in BASE[name].items():
                total[base] = total.get(base, 0) + sign * exponent * int(power or 1)
    return {base: exponent for base, exponent in total.items() if exponent}


@pytest.fixture
def root(archive):
    with zipfile.ZipFile(archive) as opened:
        return ElementTree.fromstring(opened.read("modelDescription.xml"))


def reals(root) -> dict[str, ElementTree.Element]:
    return {
        v.attrib["name"]: v.find("Real")
        for v in root.iter("ScalarVariable")
        if v.find("Real") is not None
    }


def test_units_are_defined_by_their_si_exponents(root):
    defined = {}
    for unit in root.iter("Unit"):
        base = dict(unit.find("BaseUnit").attrib)
        assert float(base.pop("factor", 1.0)) == 1.0, "everything internal is SI"
        assert float(base.pop("offset", 0.0)) == 0.0
        defined[unit.attrib["name"]] = {base_unit: int(power) for base_unit, power in base.items()}
    assert defined == {name: exponents(name) for name in defined}
    assert set(defined) == {real.attrib["unit"] for real in reals(root).values()}


def test_display_units_convert_rightly(root):
    found = {
        (unit.attrib["name"], d.attrib["name"]): (
            float(d.attrib["factor"]),
            float(d.attrib.get("offset", 0)),
        )
        for unit in root.iter("Unit")
        for d in unit.iter("DisplayUnit")
    }
    assert found == {pair: (pytest.approx(DISPLAY[pair], rel=1e-15), 0.0) for pair in found}
    used = {
        (r.attrib["unit"], r.attrib["displayUnit"])
        for r in reals(root).values()
        if "displayUnit" in r.attrib
    }
    assert used == set(found)


def test_every_variable_has_its_unit_and_a_description(root, subject):
    words = subject.signals.split()
    units = {v: real.attrib["unit"] for v, real in reals(root).items()}
    causality = {v.attrib["name"]: v.attrib["causality"] for v in root.iter("ScalarVariable")}
    for signal, unit in zip(words[::2], words[1::2], strict=True):
        assert units.get(signal, "-") == unit, signal
        assert causality[signal] in ("input", "output"), signal
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
    assert not [name for name in types if re.search(r"\s", name)], (
        "Modelica tools make identifiers of them"
    )


def test_physical_parameters_have_ranges_around_their_default(root, name):
    for variable, real in reals(root).items():
        low, high = (
            float(real.attrib.get(key, fallback))
            for key, fallback in (("min", -math.inf), ("max", math.inf))
        )
        if "start" in real.attrib:
            assert low <= float(real.attrib["start"]) <= high, variable
    for parameter in POSITIVE[name].split():
        assert (
            0.0
            < float(reals(root)[parameter].attrib["min"])
            < float(reals(root)[parameter].attrib["max"])
            < math.inf
        )


@actuators_only
def test_small_quantities_have_a_nominal_value(root):
    for name in (
        "kelvin_elongation",
        "maxwell_elongation",
        "mechanical_displacement",
        "electrochemical_displacement",
    ):
        assert float(reals(root)[name].attrib["nominal"]) == 1e-4
