"""Claims: what is connected to one entry of a signal dictionary is connected, on all levels and
through dictionaries that are connected with each other; what is ambiguous is refused.

Oracle: the flat connections that the standard means (SSP 1.0, 5.3.3), written out by hand.
"""

from __future__ import annotations

import zipfile
from itertools import combinations

import pytest

from fmus.kit.errors import UserError
from orchestration.system import check, ssp
from tests.support.system.archive import NAMESPACES
from tests.support.system.samples import tiny_fmu
from tests.support.system.ssp_files import validate

SPACE = 'xmlns:ssb="http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"'
HEAD = f'<ssd:SystemStructureDescription version="1.0" name="s" {NAMESPACES} {SPACE}>'
TAIL = "</ssd:SystemStructureDescription>"
LINEAR = '<ssc:LinearTransformation factor="2" offset="1"/>'


def member(name: str) -> str:
    connectors = "".join(
        f'<ssd:Connector name="{one}" kind="{kind}"><ssc:Real/></ssd:Connector>'
        for one, kind in (("u", "input"), ("y", "output"))
    )
    return (
        f'<ssd:Component name="{name}" type="application/x-fmu-sharedlibrary" source="part.fmu">'
        f"<ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>"
    )


def wires(*texts: str) -> str:
    """Connections of texts ``"a.y b.u"``, with what is in them after the ends."""
    made = []
    for text in texts:
        first, second, inside = [*text.split(maxsplit=2), ""][:3]
        ends = ""
        for side, end in (("start", first), ("end", second)):
            owner, _, connector = end.rpartition(".")
            ends += f' {side}Element="{owner}"' if owner else ""
            ends += f' {side}Connector="{connector}"'
        made.append(f"<ssd:Connection{ends}>{inside}</ssd:Connection>")
    return f"<ssd:Connections>{''.join(made)}</ssd:Connections>"


def entries(*names: str, unit: str = "", version: str = "1.0") -> str:
    type_ = f'<ssc:Real unit="{unit}"/>' if unit else "<ssc:Real/>"
    listed = "".join(
        f'<ssb:DictionaryEntry name="{name}">{type_}</ssb:DictionaryEntry>' for name in names
    )
    units = f'<ssb:Units><ssc:Unit name="{unit}"><ssc:BaseUnit/></ssc:Unit></ssb:Units>'
    return (
        f'<ssb:SignalDictionary {SPACE} xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
        f' version="{version}">{listed}{units if unit else ""}</ssb:SignalDictionary>'
    )


def dictionaries(**contents: str) -> str:
    listed = "".join(
        f'<ssd:SignalDictionary name="{name}" source="{text}"/>'
        if text.endswith(".ssb")
        else f'<ssd:SignalDictionary name="{name}">{text}</ssd:SignalDictionary>'
        for name, text in contents.items()
    )
    return f"<ssd:SignalDictionaries>{listed}</ssd:SignalDictionaries>"


def reference(name: str, dictionary: str, *signals: str) -> str:
    connectors = "".join(
        f'<ssd:Connector name="{one}" kind="inout"><ssc:Real/></ssd:Connector>' for one in signals
    )
    inside = f"<ssd:Connectors>{connectors}</ssd:Connectors>" if connectors else ""
    return (
        f'<ssd:SignalDictionaryReference name="{name}" dictionary="{dictionary}">{inside}'
        "</ssd:SignalDictionaryReference>"
    )


def system(elements: str, connections: str, more: str = "", name: str = "s", head: str = "") -> str:
    return (
        f'<ssd:System name="{name}">{head}<ssd:Elements>{elements}</ssd:Elements>{connections}'
        f"{more}</ssd:System>"
    )


@pytest.fixture
def read(tmp_path):
    """Read a system of FMUs ``part``; ``bus.ssb`` is beside the description."""
    tiny_fmu(tmp_path / "part.fmu", "input u Real m", "output y Real m")
    (tmp_path / "bus.ssb").write_text(entries("speed", "force"), "utf-8")
    validate(entries("speed", "force"), "SystemStructureSignalDictionary.xsd")

    def of(top: str):
        text = HEAD + top + TAIL
        validate(text, "SystemStructureDescription.xsd")
        (tmp_path / "s.ssd").write_text(text, "utf-8")
        found = ssp.read(tmp_path / "s.ssd", tmp_path)
        ends = {f"{c.source} {c.target}": (c.factor, c.offset) for c in found.connections}
        assert len(ends) == len(found.connections)
        return ends, found

    return of


@pytest.mark.parametrize("bus", ["bus.ssb", entries("speed", "force")])
def test_an_entry_connects_one_with_many_on_all_levels(read, bus):
    """The inner system finds the dictionary in the one around it."""
    inner = system(
        member("c") + member("d") + reference("here", "signals", "speed", "force"),
        wires("here.speed c.u", "d.u here.force"),
        name="inner",
    )
    ends, _ = read(
        system(
            member("a") + member("b") + reference("bus", "signals", "speed", "force") + inner,
            wires("a.y bus.speed", "bus.speed b.u", "b.y bus.force"),
            dictionaries(signals=bus),
        )
    )
    assert ends == dict.fromkeys(("a.y b.u", "a.y inner.c.u", "b.y inner.d.u"), (1.0, 0.0))


def test_a_dictionary_of_its_own_comes_before_one_around_it(read):
    own = dictionaries(signals=entries("speed"))
    inner = system(
        member("c") + reference("here", "signals", "speed"), wires("here.speed c.u"), own, "inner"
    )
    elements = member("a") + reference("bus", "signals", "speed") + inner
    ends, _ = read(system(elements, wires("a.y bus.speed"), own))
    assert ends == {}


def test_dictionaries_connected_with_each_other_and_units_of_entries(read):
    """2 y + 1 before the first; then from m to mm and, at the target, back."""
    both = dictionaries(one=entries("speed", unit="m"), two=entries("v", unit="mm"))
    elements = member("a") + member("b")
    elements += reference("first", "one", "speed") + reference("second", "two", "v")
    ends, _ = read(
        system(
            elements,
            wires(f"a.y first.speed {LINEAR}", "second.v first.speed", "b.u second.v"),
            both,
        )
    )
    assert list(ends) == ["a.y b.u"]
    assert ends["a.y b.u"] == pytest.approx((2.0, 1.0), rel=1e-15)


def test_connectors_of_the_system(read):
    head = (
        '<ssd:Connectors><ssd:Connector name="in" kind="input"><ssc:Real/></ssd:Connector>'
        '<ssd:Connector name="out" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>'
    )
    ends, found = read(
        system(
            member("a") + member("b") + reference("bus", "signals", "speed", "force"),
            wires(
                "in bus.speed", "bus.speed a.u", "b.u bus.speed", "a.y bus.force", "out bus.force"
            ),
            dictionaries(signals="bus.ssb"),
            head=head,
        )
    )
    assert ends == {}
    assert {name: {str(p) for p in ports} for name, ports in found.inputs.items()} == {
        "in": {"a.u", "b.u"}
    }
    assert {name: str(port) for name, port in found.outputs.items()} == {"out": "a.y"}


@pytest.mark.parametrize(
    ("connections", "defined", "message"),
    [
        (
            wires("a.y bus.sped"),
            "bus.ssb",
            r"bus: no connector or entry named 'sped' \(did you mean speed\?\)",
        ),
        (
            wires("a.y bus.speed"),
            "other.ssb",
            r"signal dictionary signals: .*other\.ssb is missing",
        ),
        (wires("a.y bus.speed"), "part.ssb", r"part\.ssb is a ParameterSet, not a SignalDict"),
        (wires("a.y bus.speed"), entries("speed", version="7"), r"SSP version 7"),
    ],
)
def test_what_is_ambiguous_or_missing_is_refused(read, tmp_path, connections, defined, message):
    (tmp_path / "part.ssb").write_text(
        '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
        ' version="1.0" name="p"/>'
    )
    elements = member("a") + member("b") + member("c") + reference("bus", "signals")
    with pytest.raises(UserError, match=message):
        read(system(elements, connections, dictionaries(signals=defined)))


def test_two_sources_of_an_entry_are_refused(read):
    elements = member("a") + member("b") + member("c") + reference("bus", "signals")
    connections = wires("a.y bus.speed", "b.y bus.speed", "c.u bus.speed")
    _, found = read(system(elements, connections, dictionaries(signals="bus.ssb")))
    with pytest.raises(UserError, match=r"b\.y is an output where an input is needed"):
        check(found)


def test_a_loop_at_an_entry_connects_nothing(read):
    elements = member("a") + member("b") + reference("bus", "signals") + reference("x", "signals")
    connections = wires("a.y bus.speed", "bus.speed x.speed", "x.speed b.u")
    ends, _ = read(system(elements, connections, dictionaries(signals="bus.ssb")))
    assert [*ends] == ["a.y b.u"]


def test_entries_that_are_all_connected_with_each_other_are_one(read):
    """Ways from end to end grow with the factorial of the entries, connections do not."""
    names = [f"e{k}" for k in range(12)]
    elements = member("a") + member("b") + reference("bus", "signals", *names)
    between = [f"bus.{one} bus.{other}" for one, other in combinations(names, 2)]
    connections = wires("a.y bus.e0", *between, "bus.e11 b.u")
    ends, _ = read(system(elements, connections, dictionaries(signals=entries(*names))))
    assert ends == {"a.y b.u": (1.0, 0.0)}


def test_another_way_on_which_a_value_changes_is_refused(read):
    names = ["e0", "e1", "e2"]
    elements = member("a") + member("b") + reference("bus", "signals", *names)
    between = [f"bus.e0 bus.e1 {LINEAR}", "bus.e1 bus.e2", "bus.e0 bus.e2"]
    connections = wires("a.y bus.e0", *between, "bus.e2 b.u")
    with pytest.raises(UserError, match=r"there is another way between these, and values change"):
        read(system(elements, connections, dictionaries(signals=entries(*names))))


def test_a_dictionary_in_an_archive(read, tmp_path):
    text = system(
        member("a") + member("b") + reference("bus", "signals", "speed"),
        wires("bus.speed b.u", "bus.speed a.y"),
        dictionaries(signals="bus.ssb"),
    )
    with zipfile.ZipFile(tmp_path / "s.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", HEAD + text + TAIL)
        for name in ("bus.ssb", "part.fmu"):
            archive.write(tmp_path / name, name)
    (only,) = ssp.read(tmp_path / "s.ssp", tmp_path / "u").connections
    assert (str(only.source), str(only.target)) == ("a.y", "b.u")
