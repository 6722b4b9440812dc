import io
from functools import cache
from pathlib import Path

import fmpy
import lxml.etree
import pytest
from fmpy.validation import validate_fmu

from fmus.kit import Component, Output, Parameter
from fmus.kit.build import archive
from fmus.kit.build.description import CATEGORIES, Capabilities, describe_fmi2
from fmus.kit.build.documentation import page
from fmus.kit.symbolic import codegen
from fmus.kit.symbolic.tracing import trace
from tests.support.kit_models import GUID, every_model, telling_models
from tests.support.kit_samples import Thermostat

ROOT = Path(__file__).parents[5]
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
CAN = Capabilities(
    needs_execution_tool=False,
    interpolates_inputs=True,
    directional_derivatives=True,
    sources=("a.c", "b.c"),
)
OF_PYTHON = Capabilities(
    needs_execution_tool=True, interpolates_inputs=False, directional_derivatives=False
)


traced = cache(trace)


def description(cls, can=CAN):
    return describe_fmi2(cls, traced(cls), can, "1.2.3", GUID)


def read(cls):
    """Read the description by fmpy."""
    return fmpy.read_model_description(
        io.BytesIO(archive.pack({"modelDescription.xml": description(cls)}))
    )


@every_model
def test_description_is_valid_by_the_schema(cls):
    schema = lxml.etree.XMLSchema(lxml.etree.parse(SCHEMA))
    schema.assertValid(lxml.etree.fromstring(description(cls)))


@telling_models
def test_fmpy_finds_no_problem(cls, tmp_path):
    (tmp_path / "model.fmu").write_bytes(archive.pack({"modelDescription.xml": description(cls)}))
    assert validate_fmu(str(tmp_path / "model.fmu")) == []


@every_model
def test_value_references_are_the_layout(cls):
    assert [(v.name, v.valueReference) for v in read(cls).modelVariables] == [
        (name, i) for i, name in enumerate(cls.layout.names)
    ]


def test_variables_of_every_kind():
    v = {v.name: v for v in read(Thermostat).modelVariables}

    def about(name):
        return v[name].type, v[name].causality, v[name].variability, v[name].initial, v[name].start

    assert about("loss") == ("Real", "parameter", "fixed", "exact", "0.5")
    assert about("enabled") == ("Boolean", "parameter", "fixed", "exact", "true")
    assert about("stages") == ("Integer", "parameter", "fixed", "exact", "2")
    assert about("temperature_start") == ("Real", "parameter", "fixed", "exact", "290")
    assert about("changes_start") == ("Integer", "parameter", "fixed", "exact", "0")
    assert about("outside") == ("Real", "input", "continuous", "exact", "280")
    assert about("boost") == ("Boolean", "input", "discrete", "exact", "false")
    assert about("temperature") == ("Real", "output", "continuous", "calculated", None)
    assert about("energy") == ("Real", "local", "continuous", "calculated", None)
    assert about("on") == ("Boolean", "output", "discrete", "calculated", None)
    assert about("changes") == ("Integer", "local", "discrete", "calculated", None)
    assert about("power") == ("Real", "output", "continuous", "calculated", None)
    assert about("warm") == ("Boolean", "output", "discrete", "calculated", None)
    assert about("der(energy)") == ("Real", "local", "continuous", "calculated", None)
    assert v["der(energy)"].derivative is v["energy"]
    assert (v["stages"].min, v["stages"].max) == ("1", "5")
    assert (v["capacity"].min, v["capacity"].max, v["heater"].max) == ("0.001", "1000000", None)
    assert v["temperature"].nominal == "300"
    assert v["loss"].description == "heat loss to the outside [made up]"
    assert all(variable.description for variable in v.values())
    assert [v[n].unit for n in ("loss", "energy", "der(energy)", "der(temperature)")] == [
        "W/K",
        "J",
        "J/s",
        "K/s",
    ]


def test_units_and_display_units():
    definitions = {u.name: u for u in read(Thermostat).unitDefinitions}
    displays = {d.name: (d.factor, d.offset) for d in definitions["K"].displayUnits}
    factor, offset = map(float, displays["degC"])
    assert 295.0 * factor + offset == pytest.approx(21.85)
    (energy,) = definitions["J"].displayUnits
    assert float(energy.factor) == pytest.approx(1e-3)
    base = definitions["W/K"].baseUnit
    assert (base.kg, base.m, base.s, base.K, base.A) == (1, 2, -3, -1, 0)


def test_model_structure():
    structure = read(Thermostat)
    by_name = {u.variable.name: [d.name for d in u.dependencies] for u in structure.outputs}
    assert by_name == {
        "temperature": ["temperature"],
        "on": [],
        "reading": [],
        "power": ["boost"],
        "warm": ["temperature"],
    }
    assert [u.variable.name for u in structure.derivatives] == ["der(temperature)", "der(energy)"]
    assert [d.name for d in structure.derivatives[0].dependencies] == [
        "outside",
        "boost",
        "temperature",
    ]


def test_states_that_no_host_can_derive_by_are_no_knowns():
    """As in the Python build: FMI 2.0.5, section 2.2.8, passes over derivatives there."""
    root = lxml.etree.fromstring(description(Thermostat, OF_PYTHON))
    names = [v.get("name") for v in root.iterfind("ModelVariables/ScalarVariable")]
    structure = {
        section.tag: {
            names[int(u.get("index")) - 1]: [
                names[int(k) - 1] for k in u.get("dependencies").split()
            ]
            for u in section
        }
        for section in root.find("ModelStructure")
    }
    assert structure["Outputs"] == {
        "temperature": [],
        "on": [],
        "reading": [],
        "power": ["boost"],
        "warm": [],
    }
    assert set(structure) == {"Outputs", "InitialUnknowns"}
    assert set(structure["InitialUnknowns"]) == set(structure["Outputs"])
    assert structure["InitialUnknowns"]["temperature"] == ["temperature_start"]


def test_capabilities_are_told_as_they_are():
    one = read(Thermostat).coSimulation
    assert one.canHandleVariableCommunicationStepSize
    assert one.canGetAndSetFMUstate
    assert one.canSerializeFMUstate
    assert (
        one.needsExecutionTool,
        one.canInterpolateInputs,
        one.providesDirectionalDerivative,
    ) == (False, True, True)
    files = lxml.etree.fromstring(description(Thermostat)).iterfind("CoSimulation/SourceFiles/File")
    assert [file.get("name") for file in files] == ["a.c", "b.c"]
    root = lxml.etree.fromstring(description(Thermostat, OF_PYTHON))
    node = root.find("CoSimulation")
    assert node.get("needsExecutionTool") == "true"
    assert node.get("canInterpolateInputs") == node.get("providesDirectionalDerivative") == "false"
    assert node.find("SourceFiles") is None


def test_header_and_experiment():
    read_back = read(Thermostat)
    assert (read_back.guid, read_back.modelName, read_back.fmiVersion) == (
        GUID,
        "thermostat",
        "2.0",
    )
    assert read_back.description == "A heated room under a sampled two-point controller"
    experiment = read_back.defaultExperiment
    assert [float(x) for x in (experiment.startTime, experiment.stopTime, experiment.stepSize)] == [
        0.0,
        60.0,
        0.5,
    ]
    root = lxml.etree.fromstring(description(Thermostat))
    assert {c.get("name") for c in root.iter("Category")} == set(CATEGORIES)


def test_one_unit_that_is_written_in_two_ways_is_defined_once():
    class Twice(Component):
        """Twice."""

        name = "twice"
        a = Parameter(1.0, "m/s^2", display="mm/s^2", doc="one way")
        b = Parameter(1.0, "m/s/s", display="mm/s/s", doc="another")

        @Output("m/s**2")
        def y(self):
            """Both."""
            return self.a + self.b

    (unit,) = read(Twice).unitDefinitions
    assert (unit.name, [d.name for d in unit.displayUnits]) == ("m/s2", ["mm/s2"])
    assert [v.unit for v in read(Twice).modelVariables] == ["m/s2"] * 3
    assert [v.displayUnit for v in read(Twice).modelVariables[:2]] == ["mm/s2"] * 2


def test_awkward_texts_are_escaped():
    class Awkward(Component):
        """Has <angles> & "quotes" — and a dash."""

        name = "awkward"
        p = Parameter(1.0, "1", doc='less < more & "so" — µ', source="page 3 & 4")

        @Output("1")
        def y(self):
            """A < B & C."""
            return self.p

    by_name = {v.name: v.description for v in read(Awkward).modelVariables}
    assert by_name == {"p": 'less < more & "so" — µ [page 3 & 4]', "y": "A < B & C"}
    assert "page 3 &amp; 4" in page(Awkward, Path("none.md"))
    tables = codegen.tables(trace(Awkward), GUID)
    assert (
        '{"p", "1", ROLE_PARAMETER, TYPE_REAL, 1.0, -INFINITY, INFINITY, 1.0, false}'
        in tables["tables.h"]
    )


def test_the_description_ends_in_the_remark(monkeypatch):
    monkeypatch.setattr(Thermostat, "remark", "with & without\nand more")
    assert read(Thermostat).description.endswith(". with & without. and more")
