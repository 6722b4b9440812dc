import io
import re
import subprocess
import sys
import zipfile
from html.parser import HTMLParser
from pathlib import Path

import fmpy
import lxml.etree
import pytest
from fmpy.validation import validate_fmu

import fmus
from fmus.kit import Component, Effect, Output, Parameter, UserError, build, files, stack
from fmus.kit.build import archive, toolchain
from fmus.kit.build.description import CATEGORIES, Capabilities, describe
from fmus.kit.build.documentation import page
from fmus.kit.build.parameters import to_ssv
from fmus.kit.symbolic import codegen
from fmus.kit.symbolic.trace import trace
from fmus.kit.units import allowed, shown
from fmus.ppy_actuator.effects import EFFECTS
from tests.support.kit_samples import Curved, Divider, Doubled, Thermostat, Warmer

FMPY = Path(fmpy.__file__).parent
GUID = "{12345678-1234-1234-1234-123456789012}"
CLASSES = [
    Thermostat, Divider, Curved, stack(Thermostat, Warmer, Doubled),
    *map(fmus.component, fmus.COMPONENTS),
    *(stack(fmus.component(name), *fmus.effects(name).values()) for name in fmus.COMPONENTS if fmus.effects(name)),
]  # fmt: skip
classes = pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.name)
CAN = Capabilities(
    needs_execution_tool=False, interpolates_inputs=True, directional_derivatives=True, sources=("a.c", "b.c")
)


def description(cls, can=CAN):
    return describe(cls, trace(cls), can, "1.2.3", GUID)


def read(cls):
    """The description as fmpy reads it."""
    return fmpy.read_model_description(io.BytesIO(archive.pack({"modelDescription.xml": description(cls)})))


# --- modelDescription.xml ---------------------------------------------------------------------------------------------


@classes
def test_description_is_valid_by_the_schema(cls):
    schema = lxml.etree.XMLSchema(lxml.etree.parse(FMPY / "schema" / "fmi2" / "fmi2ModelDescription.xsd"))
    schema.assertValid(lxml.etree.fromstring(description(cls)))


@classes
def test_fmpy_finds_no_problem(cls, tmp_path):
    (tmp_path / "model.fmu").write_bytes(archive.pack({"modelDescription.xml": description(cls)}))
    assert validate_fmu(str(tmp_path / "model.fmu")) == []


@classes
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
    assert [v[n].unit for n in ("loss", "energy", "der(energy)", "der(temperature)")] == ["W/K", "J", "J/s", "K/s"]


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
        "temperature": ["temperature"], "on": [], "reading": [], "power": ["boost"], "warm": ["temperature"],
    }  # fmt: skip
    assert [u.variable.name for u in structure.derivatives] == ["der(temperature)", "der(energy)"]
    assert [d.name for d in structure.derivatives[0].dependencies] == ["outside", "boost", "temperature"]


def test_capabilities_are_told_as_they_are():
    one = read(Thermostat).coSimulation
    assert one.canHandleVariableCommunicationStepSize
    assert one.canGetAndSetFMUstate
    assert one.canSerializeFMUstate
    assert (one.needsExecutionTool, one.canInterpolateInputs, one.providesDirectionalDerivative) == (False, True, True)
    files = lxml.etree.fromstring(description(Thermostat)).iterfind("CoSimulation/SourceFiles/File")
    assert [file.get("name") for file in files] == ["a.c", "b.c"]
    other = Capabilities(needs_execution_tool=True, interpolates_inputs=False, directional_derivatives=False)
    root = lxml.etree.fromstring(description(Thermostat, other))
    node = root.find("CoSimulation")
    assert node.get("needsExecutionTool") == "true"
    assert node.get("canInterpolateInputs") == node.get("providesDirectionalDerivative") == "false"
    assert node.find("SourceFiles") is None


def test_header_and_experiment():
    read_back = read(Thermostat)
    assert (read_back.guid, read_back.modelName, read_back.fmiVersion) == (GUID, "thermostat", "2.0")
    assert read_back.description == "A heated room under a sampled two-point controller"
    experiment = read_back.defaultExperiment
    assert [float(x) for x in (experiment.startTime, experiment.stopTime, experiment.stepSize)] == [0.0, 60.0, 0.5]
    root = lxml.etree.fromstring(description(Thermostat))
    assert {c.get("name") for c in root.iter("Category")} == set(CATEGORIES)


def test_author_and_licence_are_the_components_own():
    def origin(cls):
        root = lxml.etree.fromstring(description(cls))
        return root.get("author"), root.get("license")

    class Signed(Divider):
        author = "A. Person"

    ours = fmus.component("ppy_actuator")
    project = ("the ppy-rig project", "BSD-3-Clause")
    assert origin(ours) == origin(stack(ours, *EFFECTS.values())) == project
    assert origin(Divider) == (None, None)
    assert origin(Signed) == ("A. Person", None)

    class Own(Effect):
        id = "own"

    assert origin(stack(ours, Own)) == (None, None)


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
    assert '{"p", "1", ROLE_PARAMETER, TYPE_REAL, 1.0, -INFINITY, INFINITY, 1.0}' in tables["model.c"]


# --- generated C ------------------------------------------------------------------------------------------------------


@classes
def test_generated_sources_are_deterministic(cls):
    first, second = (codegen.native_sources(trace(cls), GUID) for _ in range(2))
    assert first == second
    assert set(first) == {"model.h", "model.c", "laws.c"}
    assert first["laws.c"].startswith("#define CASADI_SYMBOL_EXPORT\n")
    for n, _ in enumerate(cls.layout.sampled):
        assert f"X(update_{n})" in first["model.h"]


def test_generated_sources_do_not_depend_on_the_hash_seed_or_the_folder(tmp_path):
    code = (
        "import hashlib, fmus; from fmus.kit import stack; from fmus.kit.build.package import python_package;"
        "from fmus.kit.symbolic import codegen; from fmus.kit.symbolic.trace import trace;"
        "from fmus.ppy_actuator.effects import EFFECTS;"
        "cls = stack(fmus.component('ppy_actuator'), *EFFECTS.values());"
        "files = codegen.native_sources(trace(cls), 'g') | python_package(cls);"
        "print(hashlib.sha256(repr(sorted(files.items())).encode()).hexdigest())"
    )
    digests = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True,
            cwd=folder, env={"PYTHONHASHSEED": seed, "PYTHONPATH": str(Path(fmus.__file__).parents[1])},
        ).stdout
        for seed, folder in (("1", tmp_path), ("2", Path.cwd()))
    }  # fmt: skip
    assert len(digests) == 1


def test_tables_carry_start_values_ranges_and_groups():
    files = codegen.python_sources(trace(Thermostat), GUID)
    sizes = dict(re.findall(r"#define MODEL_(\w+) (\d+)", files["model.h"]))
    assert sizes == {
        "PARAMETERS": "12", "INPUTS": "2", "STATES": "2", "DISCRETES": "3", "OUTPUTS": "2", "GROUPS": "2",
    }  # fmt: skip
    body = files["model.c"]
    assert '{"stages", "1", ROLE_PARAMETER, TYPE_INTEGER, 2.0, 1.0, 5.0, 1.0},' in body
    assert '{"boost", "1", ROLE_INPUT, TYPE_BOOLEAN, 0.0, -INFINITY, INFINITY, 1.0},' in body
    assert "model_start_of[] = {7, 8, 9, 10, 11};" in body
    assert "{0.0, 6}," in body
    assert "{0.3, -1}," in body


# --- archive ----------------------------------------------------------------------------------------------------------


def test_archive_bytes_depend_on_contents_only():
    files = {"b.txt": b"2", "binaries/linux64/x.so": b"3", "modelDescription.xml": b"1", "a.txt": b"0"}
    packed = archive.pack(files)
    assert packed == archive.pack(dict(reversed(files.items())))
    assert packed != archive.pack(files | {"a.txt": b"1"})
    with zipfile.ZipFile(io.BytesIO(packed)) as read_back:
        assert read_back.testzip() is None
        assert read_back.namelist() == ["modelDescription.xml", "a.txt", "b.txt", "binaries/linux64/x.so"]
        assert {name: read_back.read(name) for name in files} == files
        modes = {i.filename: i.external_attr >> 16 for i in read_back.infolist()}
    assert modes["binaries/linux64/x.so"] == 0o100755
    assert modes["a.txt"] == 0o100644


def test_writing_makes_the_folder_and_replaces(tmp_path):
    target = tmp_path / "new" / "folder" / "x.fmu"
    files.write(target, b"one")
    files.write(target, b"two")
    assert target.read_bytes() == b"two"
    assert list(target.parent.iterdir()) == [target]


def test_interrupted_writing_leaves_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "x.fmu"
    files.write(target, b"old")

    def full(path, contents):
        with path.open("wb") as file:
            file.write(contents[:1])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(UserError, match=r"cannot write .*x\.fmu: No space left on device"):
        files.write(target, b"new")
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_unwritable_places_are_told_in_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    for target in (tmp_path / "file" / "x.fmu", Path("/proc/none/x.fmu")):
        with pytest.raises(UserError, match=f"cannot write {re.escape(str(target))}: ") as caught:
            files.write(target, b"")
        assert "\n" not in str(caught.value)
    (tmp_path / "x.fmu").mkdir()
    with pytest.raises(UserError, match="cannot write"):
        files.write(tmp_path / "x.fmu", b"")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "x.fmu"]


@pytest.mark.parametrize("runtime", build.RUNTIMES)
def test_builds_are_reproducible(runtime):
    try:
        toolchain.find_compiler(toolchain.host_platform())
    except UserError as error:
        pytest.skip(str(error))
    cls = stack(fmus.component("ppy_actuator"), EFFECTS["quadratic_strain"])
    first, second = (build.build(cls, runtime, [toolchain.host_platform()]) for _ in range(2))
    assert first == second
    cls.remark = "A remark"
    other = build.build(cls, runtime, [toolchain.host_platform()])
    guids = {fmpy.read_model_description(io.BytesIO(b)).guid for b in (first, other)}
    assert len(guids) == 2


def test_unknown_runtime_is_refused():
    with pytest.raises(UserError, match="unknown runtime 'java'; there are: python, native"):
        build.build(fmus.component("ppy_actuator"), "java")


# --- parameter files --------------------------------------------------------------------------------------------------


@classes
def test_parameter_files_are_valid_by_the_schema(cls):
    schema = lxml.etree.XMLSchema(lxml.etree.parse(FMPY / "ssp" / "schema" / "SystemStructureParameterValues.xsd"))
    declared = {p.name: p for p in cls.layout.parameters}
    everything = {p.name: p.start for p in cls.layout.parameters}
    documents = [to_ssv("all", everything, declared, "every parameter"), to_ssv("none", {}, declared)]
    documents += [to_ssv(name, preset.values, declared, preset.doc) for name, preset in cls.presets.items()]
    for document in documents:
        schema.assertValid(lxml.etree.fromstring(document))


def test_parameter_files_hold_types_values_and_units():
    declared = {p.name: p for p in Thermostat.layout.parameters}
    root = lxml.etree.fromstring(to_ssv("hall", Thermostat.presets["hall"].values, declared, "a big room"))
    found = {}
    for parameter in root.iterfind(".//{*}Parameter"):
        (value,) = parameter
        found[parameter.get("name")] = (lxml.etree.QName(value).localname, value.get("value"), value.get("unit"))
    assert found == {
        "capacity": ("Real", "200.0", "J/K"), "enabled": ("Boolean", "true", None),
        "stages": ("Integer", "3", None), "setpoint": ("Real", "288.15", "K"),
    }  # fmt: skip
    units = {u.get("name"): dict(u[0].attrib) for u in root.iterfind(".//{*}Unit")}
    assert units == {"J/K": {"kg": "1", "m": "2", "s": "-2", "K": "-1"}, "K": {"K": "1"}}
    assert root.get("description") == "a big room"


# --- documentation ----------------------------------------------------------------------------------------------------


class Outline(HTMLParser):
    """Collects cells of tables, and checks that elements are closed."""

    def __init__(self):
        super().__init__()
        self.open, self.cells, self.loaded = [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "br", "img", "hr", "link"):
            self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")
        self.loaded += [value for name, value in attrs if name in ("src", "href") and tag in ("script", "link", "img")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "td" in self.open or "th" in self.open:
            self.cells[-1] += data


@classes
def test_documentation_is_one_page_with_every_variable(cls):
    outline = Outline()
    outline.feed(page(cls, Path("none.md")))
    assert outline.open == []
    assert outline.loaded == []
    for v in cls.layout.variables:
        assert v.name in outline.cells


def test_documentation_shows_the_readme_and_the_remark(tmp_path, monkeypatch):
    readme = tmp_path / "README.md"
    readme.write_text("# Rooms\n\n| a | b |\n|---|---|\n| 1 | é |\n", encoding="utf-8")
    monkeypatch.setattr(Thermostat, "remark", "with & without\nand more")
    text = page(Thermostat, readme)
    assert "<h1>Rooms</h1>" in text
    assert "<td>é</td>" in text
    assert "<li>with &amp; without</li><li>and more</li>" in text
    assert read(Thermostat).description.endswith(". with & without. and more")
    assert page(Thermostat, readme) == page(Thermostat, readme)


def test_values_are_shown_in_the_unit_people_read():
    v = {v.name: v for v in (*Thermostat.layout.variables, *fmus.component("ppy_actuator").layout.parameters)}
    assert shown(6.8e-5, v["alpha"]) == "0.068 mm/C"
    assert shown(295.0, v["setpoint"]) == "21.85 degC"
    assert shown(True, v["enabled"]) == "true"
    assert shown(3, v["stages"]) == "3"
    assert allowed(v["heater"]) == "≥ 0 W"
    assert allowed(v["stages"]) == "1 … 5"
    assert allowed(v["enabled"]) == ""
