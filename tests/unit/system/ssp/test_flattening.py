"""Claims: a system in a system is read as its members under longer names, with what SSP says of
connections through its connectors, of parameters, and of units.

Oracle: the flat system that the standard means, written out by hand.
"""

from __future__ import annotations

import pytest

from fmus.kit.errors import UserError
from orchestration.system import Connection, Port, ssp
from tests.support.system.archive import NAMESPACES, SET
from tests.support.system.samples import tiny_fmu

MAPPING_SPACE = (
    'xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" version="1.0"'
)
INNER = (
    '<ssd:System name="inner">'
    '<ssd:Connectors><ssd:Connector name="in" kind="input"><ssc:Real/></ssd:Connector>'
    '<ssd:Connector name="out" kind="output"><ssc:Real/></ssd:Connector>'
    '<ssd:Connector name="gain" kind="parameter"><ssc:Real/></ssd:Connector></ssd:Connectors>'
    "{bindings}<ssd:Elements>{elements}</ssd:Elements><ssd:Connections>"
    '<ssd:Connection startConnector="in" endElement="a" endConnector="u"/>'
    '<ssd:Connection startConnector="in" endElement="b" endConnector="u"/>'
    '<ssd:Connection startElement="a" startConnector="y" endConnector="out"/>'
    '<ssd:Connection startConnector="gain" endElement="b" endConnector="k"/>'
    "</ssd:Connections></ssd:System>"
)
_WIRE = '<ssd:Connection startElement="{}" startConnector="{}" endElement="{}" endConnector="{}">{}'


def member(name: str) -> str:
    connectors = "".join(
        f'<ssd:Connector name="{one}" kind="{kind}"><ssc:Real/></ssd:Connector>'
        for one, kind in (("u", "input"), ("y", "output"), ("k", "parameter"))
    )
    return (
        f'<ssd:Component name="{name}" type="application/x-fmu-sharedlibrary" source="part.fmu">'
        f"<ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>"
    )


def wire(*ends: str, inside: str = "") -> str:
    return _WIRE.format(*ends, inside) + "</ssd:Connection>"


def values(**given: float) -> str:
    return SET.format(
        "".join(
            f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"/></ssv:Parameter>'
            for name, value in given.items()
        )
    )


def binding(given: str, mapping: str = "") -> str:
    return (
        f"<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>{given}"
        f"</ssd:ParameterValues>{mapping}</ssd:ParameterBinding></ssd:ParameterBindings>"
    )


@pytest.fixture
def read(tmp_path):
    """Read a system of FMUs ``part`` with an input, an output and a parameter."""
    tiny_fmu(tmp_path / "part.fmu", "input u Real m", "output y Real mm", "parameter k")

    def of(elements: str, connections: str, outside: str = ""):
        text = (
            f'<ssd:SystemStructureDescription version="1.0" name="s" {NAMESPACES}>'
            f'<ssd:System name="s">{outside}<ssd:Elements>{elements}</ssd:Elements>'
            f"<ssd:Connections>{connections}</ssd:Connections></ssd:System>"
            "</ssd:SystemStructureDescription>"
        )
        (tmp_path / "s.ssd").write_text(text, "utf-8")
        return ssp.read(tmp_path / "s.ssd", tmp_path)

    return of


def inner(bindings: str = "") -> str:
    return INNER.format(elements=member("a") + member("b"), bindings=bindings)


def test_what_goes_through_an_inner_system_is_connected_directly(read):
    """From mm to m at each, and an input that feeds two."""
    system = read(
        member("first") + inner() + member("last"),
        wire("first", "y", "inner", "in") + wire("inner", "out", "last", "u"),
    )
    assert [m.name for m in system.members] == ["first", "last", "inner.a", "inner.b"]
    ends = {
        (Port("first", "y"), Port("inner.a", "u")),
        (Port("first", "y"), Port("inner.b", "u")),
        (Port("inner.a", "y"), Port("last", "u")),
    }
    assert {(c.source, c.target) for c in system.connections} == ends
    assert {(c.factor, c.offset) for c in system.connections} == {(1e-3, 0.0)}


def test_systems_three_deep_and_ports_by_their_names(read):
    outer = f'<ssd:System name="outer"><ssd:Elements>{inner()}</ssd:Elements></ssd:System>'
    system = read(outer, "")
    assert [m.name for m in system.members] == ["outer.inner.a", "outer.inner.b"]
    assert system.port("outer.inner.a.u") == Port("outer.inner.a", "u")
    assert dict(system.given({"outer.inner.b.k": 2.0}).members[1].parameters) == {"k": 2.0}
    with pytest.raises(UserError, match=r"no member named 'outer'"):
        system.port("outer.c.u")


def test_parameters_reach_members_by_their_path_and_through_connectors(read):
    """Values of the outer system count; a mapping sets no parameters but those it names."""
    system = read(inner(binding(values(**{"a.k": 3.0, "b.k": 4.0}))), "")
    assert [dict(m.parameters) for m in system.members] == [{"k": 3.0}, {"k": 4.0}]
    own = binding(values(**{"inner.gain": 5.0}))
    system = read(inner(binding(values(**{"b.k": 4.0}))), "", own)
    assert [dict(m.parameters) for m in system.members] == [{}, {"k": 5.0}]
    entry = '<ssm:MappingEntry source="size" target="inner.a.k"/>'
    mapping = (
        f"<ssd:ParameterMapping><ssm:ParameterMapping {MAPPING_SPACE}>{entry}"
        "</ssm:ParameterMapping></ssd:ParameterMapping>"
    )
    system = read(inner(), "", binding(values(size=6.0, other=7.0), mapping))
    assert [dict(m.parameters) for m in system.members] == [{"k": 6.0}, {}]


def test_an_empty_element_is_the_system(read):
    outside = (
        '<ssd:Connectors><ssd:Connector name="r" kind="input"><ssc:Real/></ssd:Connector>'
        "</ssd:Connectors>"
    )
    assert read(member("a"), wire("", "r", "a", "u"), outside).inputs == {"r": (Port("a", "u"),)}


def test_a_factor_beside_a_conversion_is_refused_and_alone_it_is_kept(read):
    factor = '<ssc:LinearTransformation factor="2"/>'
    elements = member("a") + member("b")
    with pytest.raises(UserError, match=r"may come on top of the conversion"):
        read(elements, wire("a", "y", "b", "u", inside=factor))
    plain = wire("a", "y", "b", "u", inside=factor)
    suppressed = plain.replace("<ssd:Connection ", '<ssd:Connection suppressUnitConversion="true" ')
    (kept,) = read(elements, suppressed).connections
    assert kept == Connection(Port("a", "y"), Port("b", "u"), 2.0, 0.0)


def test_an_element_of_an_array_is_not_joined(read):
    inner_ = inner().replace(
        'endElement="a" endConnector="u"/>', 'endElement="a" endConnector="u"></ssd:Connection>'
    )
    outer = wire("first", "y", "inner", "in")
    outer = outer.replace(' endConnector="in"', ' endConnector="in" endIndices="1"')
    with pytest.raises(UserError, match="elements of arrays are not known there"):
        read(member("first") + inner_, outer)


@pytest.mark.parametrize("unnamed", [inner().replace('"inner"', '""'), member("")])
def test_an_element_without_a_name_is_refused(read, unnamed):
    """Its members would be those of the system around it."""
    with pytest.raises(UserError, match=r"outer: a (System|Component) has an empty name"):
        read(f'<ssd:System name="outer"><ssd:Elements>{unnamed}</ssd:Elements></ssd:System>', "")
