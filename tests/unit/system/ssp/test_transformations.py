"""Claims: transformations in a row act in the order of the values' way, whatever end a connection
names first, each after the conversion of its own units; what does not fit is refused.

Oracle: the composed functions, worked out by hand (SSP 1.0, 4.5.2).
"""

from __future__ import annotations

import zipfile
from itertools import product

import pytest

from fmus.kit.errors import UserError
from orchestration.system import check, ssp
from tests.support.system.archive import NAMESPACES
from tests.support.system.samples import tiny_fmu
from tests.support.system.ssp_files import contents, validate

COLOURS = {"red": 1, "green": 2, "blue": 4}
LIGHTS = {"stop": 10, "go": 20, "off": 4}


def linear(factor: float, offset: float) -> str:
    return f'<ssc:LinearTransformation factor="{factor}" offset="{offset}"/>'


def mapping(kind: str, *entries: tuple[object, object]) -> str:
    listed = "".join(f'<ssc:MapEntry source="{a}" target="{b}"/>' for a, b in entries)
    return f"<ssc:{kind}MappingTransformation>{listed}</ssc:{kind}MappingTransformation>"


def wire(first: tuple[str, str], second: tuple[str, str], inside: str, more: str = "") -> str:
    ends = "".join(
        f' {side}Element="{element}"' * bool(element) + f' {side}Connector="{connector}"'
        for side, (element, connector) in (("start", first), ("end", second))
    )
    return f"<ssd:Connection{ends}{more}>{inside}</ssd:Connection>"


def connector(name: str, kind: str, type_: str) -> str:
    return f'<ssd:Connector name="{name}" kind="{kind}">{type_}</ssd:Connector>'


@pytest.fixture
def read(tmp_path):
    """Read a system in which ``a`` in an inner system gives to ``b`` through its connector ``out``.

    Both are FMUs with an output and an input of each type.
    """
    kinds = ("Real m", "Integer", "Boolean")
    signals = [f"output from{k.split()[0]} {k}" for k in kinds]
    signals += [f"input to{k.split()[0]} {k}" for k in kinds]
    tiny_fmu(tmp_path / "part.fmu", *signals)
    colour, light = (
        f'<SimpleType name="{name}"><Enumeration>'
        + "".join(f'<Item name="{item}" value="{k}"/>' for item, k in items.items())
        + "</Enumeration></SimpleType>"
        for name, items in (("Colour", COLOURS), ("Light", LIGHTS))
    )
    changed = {
        "<ModelVariables>": f"<TypeDefinitions>{colour}{light}</TypeDefinitions><ModelVariables>",
        "</ModelVariables>": '<ScalarVariable name="fromEnumeration" valueReference="8"'
        ' causality="output" variability="discrete"><Enumeration declaredType="Colour"/>'
        '</ScalarVariable><ScalarVariable name="toEnumeration" valueReference="9"'
        ' causality="input" variability="discrete"><Enumeration declaredType="Light" start="4"/>'
        "</ScalarVariable></ModelVariables>",
    }
    _rewrite(tmp_path / "part.fmu", changed)

    def of(
        kind: str, inside: str, outside: str, place: str, swapped=(False, False), more="", end=""
    ):
        parts = [
            f'<ssd:Component name="{name}" type="application/x-fmu-sharedlibrary"'
            f' source="part.fmu"><ssd:Connectors>{connector(port, way, "")}</ssd:Connectors>'
            "</ssd:Component>"
            for name, port, way in (("a", f"from{kind}", "output"), ("b", f"to{kind}", "input"))
        ]
        within = [("a", f"from{kind}"), ("", "out")][:: -1 if swapped[0] else 1]
        beyond = [("inner", "out"), ("b", f"to{kind}")][:: -1 if swapped[1] else 1]
        inner = (
            f'<ssd:System name="inner"><ssd:Connectors>{connector("out", "output", place)}'
            f"</ssd:Connectors><ssd:Elements>{parts[0]}</ssd:Elements>"
            f"<ssd:Connections>{wire(*within, inside, more)}</ssd:Connections></ssd:System>"
        )
        text = (
            f'<ssd:SystemStructureDescription version="1.0" name="s" {NAMESPACES}>'
            f'<ssd:System name="s"><ssd:Elements>{parts[1]}{inner}</ssd:Elements>'
            f"<ssd:Connections>{wire(*beyond, outside)}</ssd:Connections></ssd:System>{end}"
            "</ssd:SystemStructureDescription>"
        )
        if "yes" not in text:
            validate(text, "SystemStructureDescription.xsd")
        (tmp_path / "s.ssd").write_text(text, "utf-8")
        return ssp.read(tmp_path / "s.ssd", tmp_path)

    return of


def _rewrite(path, changed):
    with zipfile.ZipFile(path) as archive:
        text = archive.read("modelDescription.xml").decode()
    for old, new in changed.items():
        text = text.replace(old, new)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)


@pytest.mark.parametrize("swapped", [*product([False, True], repeat=2)])
def test_the_inner_acts_first(read, swapped):
    """3 (2 y + 1) + 4, and not 2 (3 y + 4) + 1."""
    system = read("Real", linear(2, 1), linear(3, 4), "<ssc:Real/>", swapped)
    (only,) = system.connections
    assert (str(only.source), str(only.target)) == ("inner.a.fromReal", "b.toReal")
    assert (only.factor, only.offset, only.table) == (6.0, 7.0, ())


def test_units_are_those_of_the_connectors_between(read):
    """From m to mm and back; the offset between them is in mm."""
    millimetres = '<ssc:Real unit="mm"/>'
    suppressed = ' suppressUnitConversion="true"'
    (only,) = read("Real", linear(2, 1), "", millimetres, more=suppressed).connections
    assert (only.factor, only.offset) == pytest.approx((2e-3, 1e-3), rel=1e-15)
    (only,) = read("Real", "", "", millimetres).connections
    assert only.passes_on
    with pytest.raises(UserError, match=r"from 'm' to 'mm', by a factor that may come on top"):
        read("Real", linear(2, 1), "", millimetres)


@pytest.mark.parametrize(
    ("kind", "inside", "outside", "table"),
    [
        ("Boolean", [("true", "false"), ("0", "1")], [], ((0, 1), (1, 0))),
        ("Boolean", [("true", "false"), ("0", "1")], [("1", "0"), ("false", "true")], ()),
        ("Boolean", [], [("true", "false")], ((1, 0),)),
        ("Integer", [(1, 2), (2, 3)], [(2, 5), (9, -9)], ((1, 5), (2, 3), (9, -9))),
        ("Integer", [(1, 2)], [(2, 1)], ((2, 1),)),
    ],
)
def test_tables_follow_each_other(read, kind, inside, outside, table):
    """Values that are not in a table stay as they are."""
    read_ = read(
        kind,
        mapping(kind, *inside) if inside else "",
        mapping(kind, *outside) if outside else "",
        f"<ssc:{kind}/>",
    )
    (only,) = read_.connections
    assert (only.factor, only.offset, only.table) == (1.0, 0.0, table)


def test_items_are_mapped_by_name(read):
    """Red, of 1, is stop, of 10; green, of 2, is go, of 20; then 20 is 4."""
    system = read("Enumeration", mapping("Enumeration", ("red", "stop"), ("green", "go")), "", "")
    assert system.connections[0].table == ((1, 10), (2, 20))
    system = read(
        "Enumeration", mapping("Enumeration", ("red", "go")), mapping("Integer", (20, 4)), ""
    )
    assert system.connections[0].table == ((1, 4), (20, 4))


def test_items_between_are_those_of_the_connector_there(read):
    """Red, of 1, is go, of 7 there, and arrives as 7, or as off, of 4; 7 is no value of a light."""
    place = '<ssc:Enumeration name="Between"/>'
    items = '<ssc:Item name="go" value="7"/><ssc:Item name="wait" value="8"/>'
    end = f'<ssc:Enumeration name="Between">{items}</ssc:Enumeration>'
    end = f"<ssd:Enumerations>{end}</ssd:Enumerations>"
    first = mapping("Enumeration", ("red", "go"))
    assert read("Enumeration", first, "", place, end=end).connections[0].table == ((1, 7),)
    second = mapping("Enumeration", ("go", "off"), ("wait", "stop"))
    both = read("Enumeration", first, second, place, end=end).connections[0]
    assert both.table == ((1, 4), (7, 4), (8, 10))
    with pytest.raises(UserError, match=r"source of a .*: none named 'green'"):
        read("Enumeration", "", mapping("Enumeration", ("green", "off")), place, end=end)


@pytest.mark.parametrize(
    ("kind", "inside", "message"),
    [
        ("Integer", mapping("Integer", (1, 2), (1, 3)), "two entries for '1'"),
        ("Integer", mapping("Boolean", ("true", "false")), "does not fit integer and integer"),
        ("Boolean", mapping("Boolean", ("yes", "0")), "source of a .*: none named 'yes'"),
        ("Enumeration", mapping("Enumeration", ("pink", "go")), r"none named 'pink' .*red"),
        ("Integer", linear(2, 0), "is for real variables, these are integer"),
    ],
)
def test_what_does_not_fit_is_refused(read, kind, inside, message):
    place = "" if kind == "Enumeration" else f"<ssc:{kind}/>"
    with pytest.raises(UserError, match=message):
        check(read(kind, inside, "", place))


@pytest.mark.parametrize("kind", ["Boolean", "Integer", "Enumeration"])
def test_tables_are_written_and_read_again(read, tmp_path, kind):
    entries = {"Boolean": ("true", "false"), "Enumeration": ("red", "go")}.get(kind, (1, -7))
    place = "" if kind == "Enumeration" else f"<ssc:{kind}/>"
    system = read(kind, mapping(kind, entries), "", place)
    ssp.write(system, tmp_path / "again.ssp")
    assert contents(ssp.read(tmp_path / "again.ssp", tmp_path / "u")) == contents(system)
