"""Claims: a unit of an FMU means what the FMU defines, and has a name that the kit reads."""

from __future__ import annotations

from math import pi

import pytest

from fmus.kit import units
from orchestration.fmu.archive import read_description
from tests.support.mirror import mirror, variable

SPEED = f'<BaseUnit rad="1" s="-1" factor="{pi / 30.0!r}"/>'
# name, definition, the unit that it becomes, and one of it in SI units
DEFINED = {
    "rev/min": (SPEED, "rev/min", pi / 30.0),
    "1/min": (SPEED, "rpm", pi / 30.0),
    "U/min": (SPEED, "rpm", pi / 30.0),
    "Hz": ('<BaseUnit s="-1"/>', "Hz", 1.0),
    "deg": (f'<BaseUnit rad="1" factor="{pi / 180.0!r}"/>', "deg", pi / 180.0),
    "thumb": ('<BaseUnit m="1" factor="0.0254"/>', "0.0254*m", 0.0254),
    "N.m": ('<BaseUnit kg="1" m="2" s="-2"/>', "N*m", 1.0),
    "Force": ('<BaseUnit kg="1" m="1" s="-2"/>', "N", 1.0),
    "C": ('<BaseUnit K="1" offset="273.15"/>', "degC", 274.15),
    "V": ("<BaseUnit/>", "V", 1.0),
    "one": ("<BaseUnit/>", "1", 1.0),
    "mOhm": ("", "mohm", 1e-3),
    "bananas": ("", "bananas", None),
}


def read(tmp_path, element: str, definitions: str):
    path = mirror(tmp_path / "x.fmu", [variable("x", 0, "parameter", element)], definitions)
    return read_description(path).modelVariables[0]


@pytest.mark.parametrize("name", DEFINED)
def test_a_unit_means_what_the_fmu_defines(name, tmp_path):
    definition, spelt, in_si = DEFINED[name]
    one = read(tmp_path, f'<Real unit="{name}"/>', f'<Unit name="{name}">{definition}</Unit>')
    assert one.unit == spelt
    if in_si is not None:
        base = units.base_unit(spelt)
        assert base.factor + base.offset == pytest.approx(in_si)


def test_a_display_unit_is_defined_beside_its_unit(tmp_path):
    kelvin = (
        '<Unit name="K"><BaseUnit K="1"/><DisplayUnit name="Celsius" offset="-273.15"/></Unit>'
        '<Unit name="m"><BaseUnit m="1"/><DisplayUnit name="thumb"'
        ' factor="39.37007874015748"/></Unit>'
    )
    shown = read(tmp_path, '<Real unit="K" displayUnit="Celsius"/>', kelvin)
    assert (shown.unit, shown.displayUnit) == ("K", "degC")
    relative = '<Real unit="K" displayUnit="Celsius" relativeQuantity="true"/>'
    assert read(tmp_path, relative, kelvin).displayUnit == "delta_degC"
    thumb = read(tmp_path, '<Real unit="m" displayUnit="thumb"/>', kelvin).displayUnit
    assert units.convert(1.0, thumb, "m") == pytest.approx(0.0254)
    unknown = read(tmp_path, '<Real unit="m" displayUnit="bananas"/>', kelvin)
    assert (unknown.unit, unknown.displayUnit) == ("m", "m")
