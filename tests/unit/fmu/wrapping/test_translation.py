"""Claims: a description of FMI 3.0 becomes a valid one of FMI 2.0 that says the same.

Oracles: the schema of FMI 2.0 and fmpy's own checks, and what fmpy reads in the one of FMI 3.0.
"""

from __future__ import annotations

import io
import itertools
import random
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import pytest

from fmus.kit import UserError
from orchestration.fmu import find_model
from orchestration.fmu.check import check_fmu
from orchestration.fmu.wrapping import translate
from tests.support.fmi3_fmus import description, foreign, pack, wide_body

MODELS = ("lag", "arrays", "sawtooth", "types")


def translated(text: str) -> Any:
    return translate(ElementTree.fromstring(text), "a.fmu")


def read(text: str, **validation: bool) -> Any:
    """The translation as fmpy reads it."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("modelDescription.xml", ElementTree.tostring(translated(text).root))
    packed.seek(0)
    return fmpy.read_model_description(packed, **validation)


@pytest.mark.parametrize("name", MODELS)
def test_it_is_valid_and_its_structure_complete(name):
    read(description(name), validate_variable_names=True, validate_model_structure=True)


def names_of(variable: Any) -> list[str]:
    if not variable.shape:
        return [variable.name]
    indices = itertools.product(*(range(1, size + 1) for size in variable.shape))
    texts = [",".join(map(str, index)) for index in indices]
    if variable.name.startswith("der("):
        return [f"{variable.name[:-1]}[{text}])" for text in texts]
    return [f"{variable.name}[{text}]" for text in texts]


def attribute(variable: Any, name: str) -> Any:
    return getattr(variable, name, None) or getattr(variable.declaredType, name, None)


@pytest.mark.parametrize("name", MODELS)
def test_every_element_says_what_its_variable_says(name):
    original = fmpy.read_model_description(str(foreign(name)), validate=False)
    there = {variable.name: variable for variable in read(description(name)).modelVariables}
    for variable in original.modelVariables:
        names = names_of(variable)
        starts = (variable.start or "").split()
        for k, own in enumerate(names):
            scalar = there.pop(own)
            fixed = variable.causality == "structuralParameter"
            local = fixed or (variable.alias and variable.causality != "output")
            assert scalar.causality == ("local" if local else variable.causality), own
            assert scalar.variability == variable.variability, own
            assert scalar.description == variable.description, own
            unit = "1" if scalar.type == "Real" and "Int" in variable.type else None
            assert attribute(scalar, "unit") == (attribute(variable, "unit") or unit), own
            if (
                starts
                and variable.type not in ("String", "Binary")
                and not (fixed or variable.alias)
            ):
                assert scalar.start == starts[k if len(starts) > 1 else 0], own
            if attribute(variable, "min") is not None:
                assert float(scalar.min) == float(attribute(variable, "min")), own
                assert float(scalar.max) == float(attribute(variable, "max")), own
    assert there == {}


def test_arrays_are_taken_row_by_row_from_one():
    root = translated(description("arrays")).root
    scalars = {node.get("name"): node for node in root.iterfind("ModelVariables/ScalarVariable")}
    starts = {name: node[0].get("start") for name, node in scalars.items()}
    assert [starts[f"A[{i},{k}]"] for i in (1, 2, 3) for k in (1, 2, 3)] == (
        ["-1", "0.5", "0", "0", "-2", "0.5", "0", "0", "-3"]
    )
    assert (starts["B[3,1]"], starts["u[2]"], starts["x[2]"]) == ("1", "0", "0.2")


def test_derivatives_and_dependencies_are_of_elements():
    read_back = read(description("arrays"))
    rates = {u.variable.name: u for u in read_back.derivatives}
    assert list(rates) == ["der(x[1])", "der(x[2])", "der(x[3])"]
    assert [u.variable.derivative.name for u in rates.values()] == ["x[1]", "x[2]", "x[3]"]
    depends = [v.name for v in rates["der(x[2])"].dependencies]
    assert depends == ["u[1]", "u[2]", "x[1]", "x[2]", "x[3]"]
    outputs = {u.variable.name: u for u in read(description("lag")).outputs}
    assert list(outputs) == ["y", "also_y"]
    assert [v.name for v in outputs["also_y"].dependencies] == ["x"]
    assert outputs["y"].dependenciesKind == ["constant"]


def test_types_become_those_that_hold_their_values():
    scalars = {v.name: v.type for v in read(description("types")).modelVariables}
    for kind in ("f32", "f64"):
        assert scalars[f"{kind}_in"] == scalars[f"{kind}_out"] == "Real"
    for kind in ("i8", "u8", "i16", "u16", "i32"):
        assert scalars[f"{kind}_in"] == scalars[f"{kind}_out"] == "Integer"
    for kind in ("u32", "i64", "u64"):
        assert (scalars[f"{kind}_in"], scalars[f"{kind}_out"]) == ("Real", "Real")
    assert (scalars["mood_in"], scalars["bool_in"]) == ("Enumeration", "Boolean")
    assert (scalars["word"], scalars["words[2]"]) == ("String", "String")


def test_a_display_unit_that_divides_is_left_out():
    variables = {v.name: v for v in read(description("lag")).modelVariables}
    assert (variables["tau"].unit, variables["tau"].displayUnit) == ("s", None)


def test_annotations_are_those_of_vendors():
    text = description("lag").replace(
        "</fmiModelDescription>",
        '<Annotations><Annotation type="org.x"><Note a="1"/></Annotation></Annotations>'
        "</fmiModelDescription>",
    )
    note = translated(text).root.find("VendorAnnotations/Tool[@name='org.x']/Note")
    assert note is not None
    assert note.get("a") == "1"


def test_dependencies_of_very_many_elements_are_not_listed():
    root = translated(description("wide", wide_body(2000))).root
    unknowns = root.findall("ModelStructure/Outputs/Unknown")
    assert len(unknowns) == 2000
    assert unknowns[0].get("dependencies") is None


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("lag", 'derivative="12"', 'derivative="99"', r"der\(x\): is the derivative of 99"),
        ("lag", 'dependencies="12"', 'dependencies="a"', "y: a dependency 'a' is no whole number"),
        ("lag", '"fixed fixed"', '"fixed"', "has 2 dependencies, but 1 kinds of them"),
    ],
)
def test_what_makes_no_sense_is_a_line(name, old, new, message):
    text = description(name)
    assert old in text
    with pytest.raises(UserError, match=message) as caught:
        translated(text.replace(old, new))
    assert str(caught.value).startswith("a.fmu: modelDescription.xml: ")
    assert "\n" not in str(caught.value)
    assert str(caught.value).isascii()


VALUES = ("-1", "1e400", "nan", "", "abc", "9" * 20, "4294967296", "2 3", "\u00b2", "&lt;", "A[1]")
TAGS = ("Float64", "Clock", "Binary", "Dimension", "Foo", "Int8", "String", "Start", "Alias")


def mutated(text: str, chance: random.Random) -> str:
    """The text with an attribute, an element or a character changed, doubled or left out."""
    attributes = list(re.finditer(r'(\w+)="([^"]*)"', text))
    elements = list(re.finditer(r"<\w+[^<>]*/>", text))
    match chance.randrange(5):
        case 0:
            found = chance.choice(attributes)
            return text[: found.start(2)] + chance.choice(VALUES) + text[found.end(2) :]
        case 1:
            found = chance.choice(attributes)
            return text[: found.start()] + text[found.end() :]
        case 2:
            tag = chance.choice(re.findall(r"<(\w+)", text))
            return text.replace(f"<{tag}", f"<{chance.choice(TAGS)}", 1)
        case 3:
            found = chance.choice(elements)
            return text[: found.start()] + chance.choice(("", 2 * found[0])) + text[found.end() :]
    place = chance.randrange(len(text))
    return text[:place] + chr(chance.randrange(32, 127)) + text[place + 1 :]


def refusal(look: Callable[[str], object], path: Path) -> str:
    """The message with which an FMU is refused; nothing if it is taken."""
    try:
        look(str(path))
    except UserError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", MODELS)
def test_a_damaged_description_is_read_or_refused_in_a_line(name, tmp_path):
    for seed in range(80):
        chance = random.Random(seed)
        text = description(name)
        for _ in range(chance.randint(1, 3)):
            text = mutated(text, chance)
        path = pack(tmp_path / "a.fmu", {"modelDescription.xml": text})
        for look in (find_model, check_fmu):
            assert "\n" not in refusal(look, path)
