"""Claims: members are FMUs of the package for co-simulation, with the values bound to them."""

from __future__ import annotations

import pytest

from orchestration.system import ssp
from tests.support.system.archive import BINDINGS, INLINE, NAMESPACES, SET, repacked
from tests.support.system.ssp_files import bound, refused, refused_one


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ('name="drive" type', 'name="load" type', ["two members have one name"]),
        (
            "resources/drive.fmu",
            "resources/gone.fmu",
            ["member drive", "resources/gone.fmu is missing"],
        ),
        ("resources/drive.fmu", "../drive.fmu", ["member drive", "'../drive.fmu' leads out"]),
        ("resources/drive.fmu", "resources/%2e%2e/%2e%2e/drive.fmu", ["member drive", "leads out"]),
        ("resources/drive.fmu", "/drive.fmu", ["member drive", "leads out"]),
        ("resources/drive.fmu", "C:/drive.fmu", ["member drive", "leads out"]),
        ("resources/drive.fmu", "", ["member drive", "'' leads out"]),
        (
            "resources/drive.fmu",
            "SystemStructure.ssd",
            ["SystemStructure.ssd", "not a zip archive"],
        ),
        (
            "application/x-fmu-sharedlibrary",
            "application/x-ssp-package",
            ["of type application/x-ssp-package"],
        ),
        ('implementation="CoSimulation"', 'implementation="ModelExchange"', ["model exchange"]),
        (
            "</ssd:Elements>",
            '<ssd:SignalDictionaryReference name="bus" dictionary="b"/></ssd:Elements>',
            ["bus: there is no signal dictionary named 'b'"],
        ),
    ],
)
def test_members_that_cannot_be_run(system, tmp_path, old, new, parts):
    ssp.write(system, tmp_path / "with.ssp", connectors=True)
    refused_one(
        repacked(tmp_path / "with.ssp", lambda text: text.replace(old, new)), tmp_path / "u", *parts
    )


def parameters(path, folder):
    """Parameters of the drive, read."""
    return dict(ssp.read(path, folder).members[0].parameters)


def test_values_are_converted_to_the_units_of_the_fmu(archive, tmp_path):
    text = INLINE.format(
        '<ssv:Parameter name="gain"><ssv:Real value="2e3" unit="mN/A"/></ssv:Parameter>'
    )
    other = repacked(archive, bound(text))
    assert parameters(other, tmp_path / "u") == {"gain": pytest.approx(2.0)}


def test_values_in_a_file_of_their_own(archive, tmp_path):
    values = SET.format('<ssv:Parameter name="in"><ssv:Real value="2"/></ssv:Parameter>')
    values = values.replace("<ssv:ParameterSet", f"<ssv:ParameterSet {NAMESPACES}")
    text = '<ssd:ParameterBinding source="resources/my%20set.ssv" prefix="ga"/>'
    other = repacked(archive, bound(text), [("resources/my set.ssv", values)])
    assert parameters(other, tmp_path / "u") == {"gain": 2.0}


def test_values_of_the_system_go_over_those_of_the_member(archive, tmp_path):
    values = INLINE.format('<ssv:Parameter name="drive.gain"><ssv:Real value="7"/></ssv:Parameter>')
    block = f"{BINDINGS.format(values)}<ssd:Elements>".replace(
        "<ssv:ParameterSet", f"<ssv:ParameterSet {NAMESPACES}"
    )
    other = repacked(archive, lambda text: text.replace("<ssd:Elements>", block))
    assert parameters(other, tmp_path / "u") == {"gain": 7.0, "steps": -3.0, "armed": 1.0}


@pytest.mark.parametrize(
    ("value", "parts"),
    [
        (
            '<ssv:Parameter name="gian"><ssv:Real value="1"/></ssv:Parameter>',
            ["'gian'", "did you mean gain"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:Real value="1" unit="V"/></ssv:Parameter>',
            ["gain", "'V'", "'N/A'"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:Real value="1" unit="bananas"/></ssv:Parameter>',
            ["gain", "bananas"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:Real value="much"/></ssv:Parameter>',
            ["gain", "'much' is not a number"],
        ),
        ('<ssv:Parameter name="gain"><ssv:Real/></ssv:Parameter>', ["'' is not a number"]),
        (
            '<ssv:Parameter name="gain"><ssv:Integer value="1"/></ssv:Parameter>',
            ["given as integer", "has it as real"],
        ),
        (
            '<ssv:Parameter name="armed"><ssv:Boolean value="on"/></ssv:Parameter>',
            ["'on' is neither true nor false"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:String value="1"/></ssv:Parameter>',
            ["given as string", "has it as real"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:Binary value="1"/></ssv:Parameter>',
            ["given as string", "has it as real"],
        ),
        ('<ssv:Parameter name="gain"/>', ["parameter gain is nothing"]),
    ],
)
def test_parameters_that_cannot_be_set(archive, tmp_path, value, parts):
    refused(repacked(archive, bound(INLINE.format(value))), tmp_path / "u", "member drive", *parts)


@pytest.mark.parametrize(
    ("binding", "part"),
    [
        ('<ssd:ParameterBinding source="resources/gone.ssv"/>', "resources/gone.ssv is missing"),
        ('<ssd:ParameterBinding source="../gone.ssv"/>', "'../gone.ssv' leads out"),
        ('<ssd:ParameterBinding source="file:///etc/passwd"/>', "'file:///etc/passwd' leads out"),
        (
            '<ssd:ParameterBinding source="SystemStructure.ssd"/>',
            "is a SystemStructureDescription, not a ParameterSet",
        ),
        ('<ssd:ParameterBinding source="resources/drive.fmu"/>', "it is not well-formed XML"),
        ('<ssd:ParameterBinding sourceBase="component" source="x"/>', "inside of an FMU"),
    ],
)
def test_bindings_that_cannot_be_followed(archive, tmp_path, binding, part):
    refused(repacked(archive, bound(binding)), tmp_path / "u", part)


def mapped(name, element, target, more="", inside=""):
    """A binding of one parameter with an entry of a mapping."""
    values = INLINE.format(f'<ssv:Parameter name="{name}">{element}</ssv:Parameter>')
    space = 'xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"'
    mapping = (
        f'<ssd:ParameterMapping><ssm:ParameterMapping {space} version="1.0">'
        f'<ssm:MappingEntry source="{name}" target="{target}"{more}>{inside}</ssm:MappingEntry>'
        "</ssm:ParameterMapping></ssd:ParameterMapping></ssd:ParameterBinding>"
    )
    assert "</ssd:ParameterBinding>" in values
    return bound(values.replace("</ssd:ParameterBinding>", mapping))


LINEAR = '<ssc:LinearTransformation factor="2" offset="1"/>'
SUPPRESSED = ' suppressUnitConversion="true"'


@pytest.mark.parametrize(
    ("unit", "more", "inside", "value"),
    [
        ("", "", "", 3.0),
        ("mN/A", "", "", 0.003),
        ("mN/A", SUPPRESSED, "", 3.0),
        ("", "", LINEAR, 7.0),
        ("N/A", "", LINEAR, 7.0),
        ("mN/A", SUPPRESSED, LINEAR, 7.0),
    ],
)
def test_a_mapping_transforms_in_place_of_a_conversion(
    archive, tmp_path, unit, more, inside, value
):
    """2 x 3 + 1 in the unit of the FMU, N/A."""
    element = f'<ssv:Real value="3" unit="{unit}"/>'.replace(' unit=""', "")
    other = repacked(archive, mapped("size", element, "gain", more, inside))
    assert parameters(other, tmp_path / "u") == {"gain": pytest.approx(value, rel=1e-15)}


@pytest.mark.parametrize(
    ("element", "target", "inside", "part"),
    [
        ('<ssv:Real value="3" unit="mN/A"/>', "gain", LINEAR, "may come on top of the conversion"),
        ('<ssv:Integer value="3"/>', "steps", LINEAR, "for real parameters, this is integer"),
        ('<ssv:Boolean value="true"/>', "armed", LINEAR, "for real parameters, this is boolean"),
        (
            '<ssv:Real value="3"/>',
            "gain",
            LINEAR.replace('"2"', '"two"'),
            "factor 'two' of a LinearTransformation is not a finite number",
        ),
    ],
)
def test_transformations_of_parameters_that_do_not_fit(
    archive, tmp_path, element, target, inside, part
):
    other = repacked(archive, mapped("size", element, target, inside=inside))
    refused(other, tmp_path / "u", "member drive", part)


def test_a_file_that_is_no_mapping(archive, tmp_path):
    mapping = '<ssd:ParameterMapping source="resources/drive.ssv"/></ssd:ParameterBinding>'
    values = INLINE.format('<ssv:Parameter name="gain"><ssv:Real value="1"/></ssv:Parameter>')
    other = repacked(archive, bound(values.replace("</ssd:ParameterBinding>", mapping)))
    refused(other, tmp_path / "u", "drive.ssv is a ParameterSet, not a ParameterMapping")
