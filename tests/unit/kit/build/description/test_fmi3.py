"""Claims: the description of FMI 3.0 is valid by its schema and by fmpy, and says what that of
FMI 2.0 says of the same component.
"""

from __future__ import annotations

import io
import re
from collections import defaultdict
from dataclasses import replace
from functools import cache
from pathlib import Path

import fmpy
import lxml.etree
from fmpy.validation import validate_fmu

import fmus
from fmus.kit import Parameter
from fmus.kit.build import archive
from fmus.kit.build.description import (
    Capabilities,
    build_description,
    describe_fmi2,
    describe_fmi3,
)
from fmus.kit.build.provenance import read_provenance
from fmus.kit.symbolic.tracing import trace
from tests.support.kit_models import GUID, every_model, telling_models
from tests.support.kit_samples import Divider, Thermostat

SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"
CAN = Capabilities(
    needs_execution_tool=False,
    interpolates_inputs=True,
    directional_derivatives=True,
    model_exchange=True,
)
TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String"}

traced = cache(trace)


def schema(name):
    return lxml.etree.XMLSchema(lxml.etree.parse(SCHEMAS / f"fmi3{name}.xsd"))


def description(cls, can=CAN):
    return describe_fmi3(cls, traced(cls), can, "1.2.3", GUID)


def read(text):
    """Read a description by fmpy."""
    return fmpy.read_model_description(io.BytesIO(archive.pack({"modelDescription.xml": text})))


@every_model
def test_description_is_valid_by_the_schema(cls):
    schema("ModelDescription").assertValid(lxml.etree.fromstring(description(cls)))


@every_model
def test_description_with_clocks_is_valid_by_the_schema(cls):
    """One for each group of states that are sampled together, after all other variables."""
    text = description(cls, replace(CAN, clocks=True))
    schema("ModelDescription").assertValid(lxml.etree.fromstring(text))
    variables = read(text).modelVariables
    clocks = [v for v in variables if v.type == "Clock"]
    assert [v.name for v in clocks] == [f"clock[{i + 1}]" for i in range(len(cls.layout.sampled))]
    references = [v.valueReference for v in variables]
    assert references == sorted(set(references))


@telling_models
def test_fmpy_finds_no_problem(cls, tmp_path):
    (tmp_path / "model.fmu").write_bytes(archive.pack({"modelDescription.xml": description(cls)}))
    assert validate_fmu(str(tmp_path / "model.fmu")) == []


def about(variable):
    """Attributes of a variable that both versions have."""
    return (
        variable.name,
        TYPES.get(variable.type, variable.type),
        variable.valueReference,
        variable.causality,
        variable.variability,
        variable.initial,
        variable.start,
        variable.min,
        variable.max,
        variable.nominal,
        variable.unit,
        variable.displayUnit,
        variable.description,
    )


def whole(name):
    """Name of the array of an element, or of a scalar."""
    return re.sub(r"\[[\d,]+\]", "", name)


def joined(variables):
    """Return variables as in FMI 2.0; an array by its first element, with all start values."""
    starts = defaultdict(list)
    first = {}
    for v in variables:
        starts[whole(v.name)].append(v.start)
        first.setdefault(whole(v.name), v)
    for name, v in first.items():
        v.name, v.description = name, whole(v.description or "")
        v.start = None if None in starts[name] else " ".join(starts[name])
    return [about(v) for v in first.values()]


@telling_models
def test_variables_are_those_of_fmi_2_and_the_time_and_the_indicators(cls):
    read_back = read(description(cls)).modelVariables
    of_3 = [v for v in read_back if v.causality != "independent" and "indicator" not in v.name]
    of_2 = read(describe_fmi2(cls, traced(cls), CAN, "1.2.3", GUID)).modelVariables
    assert [about(v) for v in of_3] == joined(of_2)
    time, *indicators = read_back[len(of_3) :]
    assert (time.name, time.causality, time.unit) == ("time", "independent", "s")
    count = traced(cls).indicators.numel()
    assert [v.name for v in indicators] == [f"indicator[{i + 1}]" for i in range(count)]
    references = [v.valueReference for v in (time, *indicators)]
    assert references == list(range(len(of_2), len(of_2) + count + 1))


@telling_models
def test_structure_is_that_of_fmi_2(cls):
    def structure(read_back):
        found = []
        for unknowns in (read_back.outputs, read_back.derivatives, read_back.initialUnknowns):
            of_whole = defaultdict(set)
            for unknown in unknowns:
                known = {whole(d.name) for d in unknown.dependencies} - {"time"}
                of_whole[whole(unknown.variable.name)] |= known
            found.append(dict(of_whole))
        return found

    of_3 = read(description(cls))
    of_2 = read(describe_fmi2(cls, traced(cls), CAN, "1.2.3", GUID))
    assert structure(of_3) == structure(of_2)
    derivatives = [v.derivative.name for v in of_3.modelVariables if v.derivative is not None]
    assert derivatives == list(dict.fromkeys(whole(state.name) for state in cls.layout.states))


def test_event_indicators_depend_on_what_their_laws_read():
    (warm,) = read(description(Thermostat)).eventIndicators[-1:]
    assert {d.name for d in warm.dependencies} <= {"temperature", "outside", "boost", "energy"}
    without = Capabilities(
        needs_execution_tool=False, interpolates_inputs=True, directional_derivatives=True
    )
    assert read(description(Thermostat, without)).eventIndicators == []


def test_capabilities():
    one = lxml.etree.fromstring(description(Thermostat)).find("CoSimulation")
    assert one.get("hasEventMode") == one.get("mightReturnEarlyFromDoStep") == "true"
    assert one.get("providesDirectionalDerivatives") == "true"
    assert one.get("providesAdjointDerivatives") == "true"
    assert one.get("maxOutputDerivativeOrder") == "1"
    assert one.get("canGetAndSetFMUState") == one.get("canSerializeFMUState") == "true"
    divider = lxml.etree.fromstring(description(Divider)).find("CoSimulation")
    assert divider.get("hasEventMode") == "true", "inputs may jump in events"
    assert divider.get("mightReturnEarlyFromDoStep") == "false", "nothing is sampled"


def test_provenance_of_a_stack_is_read_back():
    cls = fmus.kit.stack(
        fmus.component("ppy_actuator"), fmus.effects("ppy_actuator")["quadratic_strain"]
    )
    origin = read_provenance(lxml.etree.fromstring(description(cls)))
    assert (origin.component, origin.effects) == ("ppy_actuator", ("quadratic_strain",))
    plain = read_provenance(lxml.etree.fromstring(description(fmus.component("ppy_actuator"))))
    assert (plain.component, plain.effects) == ("ppy_actuator", ())
    assert read_provenance(lxml.etree.fromstring(description(Divider))) is None


def test_build_description_has_a_configuration_for_each_platform():
    text = build_description(Thermostat, "all.c", {"linux64": ["m"], "win64": ["ws2_32"]})
    root = lxml.etree.fromstring(text)
    schema("BuildDescription").assertValid(root)
    libraries = {
        one.get("platform"): [library.get("name") for library in one.iter("Library")]
        for one in root
    }
    assert libraries["x86_64-linux"] == ["m"]
    assert libraries["x86_64-windows"] == ["ws2_32"]
    assert libraries["aarch64-darwin"] == []
    assert {file.get("name") for file in root.iter("SourceFile")} == {"all.c"}


def test_a_parameter_that_is_declared_tunable_is_described_so():
    class Tuned(Divider):
        name = "tuned"

        gain = Parameter(1.0, "1", tunable=True, doc="gain")
        turns = Parameter(1, "1", type="integer", tunable=True, doc="turns")

    for describe in (describe_fmi2, describe_fmi3):
        variables = read(describe(Tuned, trace(Tuned), CAN, "1.2.3", GUID)).modelVariables
        found = {v.name: v.variability for v in variables if v.causality == "parameter"}
        assert {n for n, variability in found.items() if variability == "tunable"} == {
            "gain",
            "turns",
        }
        assert set(found.values()) == {"fixed", "tunable"}
