"""Foreign FMUs of FMI 3.0, compiled from small C models with solutions in closed form."""

from __future__ import annotations

import atexit
import functools
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

import fmpy

from tests.support.archive import contents, edited
from tests.support.hosts import HEADERS, TESTS, compiler

FRAME = TESTS / "c" / "fmi3"
SANITIZED = (
    "-g",
    "-O1",
    "-std=c99",
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
)
FLAGS = ("-std=c99", "-O1", "-fPIC", "-shared", "-w")
_FLAGS = (
    'canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="true"'
)

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{name}"
    description="A small foreign model">
  <ModelExchange modelIdentifier="{name}" {flags}/>
  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"
      {flags}{events}/>
"""
_TAIL = "</fmiModelDescription>\n"
_TIME = '<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>'

LAG = f"""
  <UnitDefinitions>
    <Unit name="A"><BaseUnit A="1"/><DisplayUnit name="mA" factor="1000"/>
      <DisplayUnit name="kA" factor="0.001"/></Unit>
    <Unit name="s"><BaseUnit s="1"/><DisplayUnit name="Hz" inverse="true"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <Float64Type name="Current" unit="A" displayUnit="mA" min="-100" max="100" nominal="2"
        quantity="Current" description="Of all currents"/>
  </TypeDefinitions>
  <DefaultExperiment startTime="0" stopTime="2" stepSize="0.05"/>
  <ModelVariables>
    {_TIME}
    <Float64 name="u" valueReference="10" causality="input" declaredType="Current" start="0"
        description="Current in"/>
    <Float64 name="y" valueReference="11" causality="output" declaredType="Current">
      <Alias name="also_y" description="The same" displayUnit="kA"/>
    </Float64>
    <Float64 name="x" valueReference="12" causality="local" initial="exact" start="0.25"/>
    <Float64 name="der(x)" valueReference="13" derivative="12"/>
    <Float64 name="k" valueReference="7" causality="parameter" variability="fixed" start="2"
        min="0" max="10" description="Gain"/>
    <Float64 name="tau" valueReference="900" causality="parameter" variability="tunable"
        start="0.5" min="0.01" max="10" unit="s" displayUnit="Hz" description="Time constant"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="11" dependencies="12" dependenciesKind="constant"/>
    <ContinuousStateDerivative valueReference="13" dependencies="10 12"
        dependenciesKind="fixed fixed"/>
    <InitialUnknown valueReference="11" dependencies="12"/>
    <InitialUnknown valueReference="13" dependencies="10 12"/>
  </ModelStructure>
"""

_ARRAYS = f"""
  <DefaultExperiment startTime="0" stopTime="2" stepSize="0.1"/>
  <ModelVariables>
    {_TIME}
    <UInt64 name="n" valueReference="1" causality="structuralParameter" variability="fixed"
        start="3" description="Number of states"/>
    <Float64 name="A" valueReference="2" causality="parameter" variability="tunable"
        start="-1 0.5 0 0 -2 0.5 0 0 -3" description="Rates by states">
      <Dimension valueReference="1"/><Dimension valueReference="1"/>
    </Float64>
    <Float64 name="B" valueReference="3" causality="parameter" variability="tunable"
        start="1 0 0 1 1 0" description="Rates by inputs">
      <Dimension valueReference="1"/><Dimension start="2"/>
    </Float64>
    <Float64 name="C" valueReference="4" causality="parameter" variability="tunable"
        start="1 0 1 0 1 0" description="Outputs by states">
      <Dimension start="2"/><Dimension valueReference="1"/>
    </Float64>
    <Float64 name="u" valueReference="5" causality="input" start="0" description="Inputs">
      <Dimension start="2"/>
    </Float64>
    <Float64 name="x" valueReference="6" causality="local" initial="exact" start="0.1 0.2 0.3"
        description="States">
      <Dimension valueReference="1"/>
    </Float64>
    <Float64 name="der(x)" valueReference="7" derivative="6" description="Rates">
      <Dimension valueReference="1"/>
    </Float64>
    <Float64 name="y" valueReference="8" causality="output" description="Outputs">
      <Dimension start="2"/>
    </Float64>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="8" dependencies="6" dependenciesKind="dependent"/>
    <ContinuousStateDerivative valueReference="7" dependencies="5 6"/>
    <InitialUnknown valueReference="7" dependencies="5 6"/>
    <InitialUnknown valueReference="8" dependencies="6"/>
  </ModelStructure>
"""

_SAWTOOTH = f"""
  <DefaultExperiment startTime="0" stopTime="2" stepSize="0.05"/>
  <ModelVariables>
    {_TIME}
    <Float64 name="x" valueReference="1" causality="output" initial="exact" start="0"/>
    <Float64 name="der(x)" valueReference="2" derivative="1"/>
    <Float64 name="slope" valueReference="3" causality="parameter" start="1"/>
    <Float64 name="period" valueReference="4" causality="parameter" start="0.3"/>
    <Int32 name="count" valueReference="5" causality="output"/>
    <Int32 name="manner" valueReference="6" causality="parameter" start="0"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1"/><Output valueReference="5"/>
    <ContinuousStateDerivative valueReference="2"/>
    <InitialUnknown valueReference="2"/><InitialUnknown valueReference="5"/>
  </ModelStructure>
"""

# name in the model: value references of the input and of the output
_PAIRS = {
    "Float32": ("f32", 1),
    "Float64": ("f64", 3),
    "Int8": ("i8", 5),
    "UInt8": ("u8", 7),
    "Int16": ("i16", 9),
    "UInt16": ("u16", 11),
    "Int32": ("i32", 13),
    "UInt32": ("u32", 15),
    "Int64": ("i64", 17),
    "UInt64": ("u64", 19),
    "Boolean": ("bool", 21),
}


def _pair(kind: str, name: str, reference: int) -> str:
    start = "false" if kind == "Boolean" else "0"
    return (
        f'<{kind} name="{name}_in" valueReference="{reference}" causality="input"'
        f' start="{start}"/>'
        f'<{kind} name="{name}_out" valueReference="{reference + 1}" causality="output"/>'
    )


def _types() -> str:
    outputs = [*range(2, 25, 2), 27, 29, 31, 32, 34]
    structure = "".join(
        f'<{tag} valueReference="{reference}"/>'
        for tag in ("Output", "InitialUnknown")
        for reference in outputs
    )
    return f"""
  <TypeDefinitions>
    <EnumerationType name="Mood"><Item name="glad" value="1"/><Item name="sad" value="-4"/>
    </EnumerationType>
  </TypeDefinitions>
  <ModelVariables>
    {_TIME}
    {"".join(_pair(kind, *named) for kind, named in _PAIRS.items())}
    <Enumeration name="mood_in" valueReference="23" causality="input" declaredType="Mood"
        start="1"/>
    <Enumeration name="mood_out" valueReference="24" causality="output" declaredType="Mood"/>
    <String name="word" valueReference="25" causality="parameter"><Start value="abc"/></String>
    <String name="words" valueReference="26" causality="parameter"><Dimension start="2"/>
      <Start value="de"/><Start value="f"/></String>
    <Int32 name="length" valueReference="27" causality="output"/>
    <Int32 name="whole" valueReference="28" causality="parameter" start="1 2 3 4 5 6">
      <Dimension start="2"/><Dimension start="3"/></Int32>
    <Int32 name="sum" valueReference="29" causality="output"/>
    <Boolean name="bits" valueReference="30" causality="parameter" start="false">
      <Dimension start="3"/></Boolean>
    <Boolean name="parity" valueReference="31" causality="output"/>
    <Float64 name="from_file" valueReference="32" causality="output"/>
    <Binary name="blob" valueReference="99" causality="parameter"><Start value="00ff"/></Binary>
    <Binary name="blobs" valueReference="33" causality="parameter"><Dimension start="2"/>
      <Start value="07"/><Start value="07"/></Binary>
    <Binary name="mirrored" valueReference="34" causality="output"/>
  </ModelVariables>
  <ModelStructure>{structure}</ModelStructure>
"""


def wide_body(count: int) -> str:
    """The variables and the structure of an FMU with arrays of many elements."""
    return f"""
  <ModelVariables>
    {_TIME}
    <Float64 name="u" valueReference="1" causality="input" start="0"><Dimension start="{count}"/>
    </Float64>
    <Float64 name="y" valueReference="2" causality="output"><Dimension start="{count}"/></Float64>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="2" dependencies="1"/><InitialUnknown valueReference="2"/>
  </ModelStructure>
"""


_CLOCKED = f"""
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.07"/>
  <ModelVariables>
    {_TIME}
    <Clock name="every" valueReference="10" causality="input" intervalVariability="constant"
        intervalDecimal="0.1" priority="1"/>
    <Clock name="once" valueReference="11" causality="input" intervalVariability="countdown"/>
    <Clock name="slower" valueReference="12" causality="input" intervalVariability="changing"/>
    <Clock name="idle" valueReference="13" causality="input" intervalVariability="triggered"/>
    <Int32 name="u" valueReference="1" causality="input" start="1"/>
    <Int32 name="sum" valueReference="2" causality="output"/>
    <Int32 name="count" valueReference="3" causality="output"/>
    <Float64 name="fired" valueReference="4" causality="output" variability="discrete"/>
    <Int32 name="changes" valueReference="5" causality="output"/>
    <Clock name="even" valueReference="14" causality="output" intervalVariability="triggered"
        clocks="10"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="14" dependencies="10"/>
    <Output valueReference="2"/><Output valueReference="3"/><Output valueReference="4"/>
    <Output valueReference="5"/>
  </ModelStructure>
"""

_ROBERTS = f"""
  <DefaultExperiment startTime="0" stopTime="1e11" stepSize="1e9" tolerance="1e-7"/>
  <ModelVariables>
    {_TIME}
    <Float64 name="y" valueReference="1" causality="output" initial="exact" start="1 0 0">
      <Dimension start="3"/></Float64>
    <Float64 name="der(y)" valueReference="2" derivative="1"><Dimension start="3"/></Float64>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1"/><ContinuousStateDerivative valueReference="2"/>
    <InitialUnknown valueReference="2"/>
  </ModelStructure>
"""

_BODIES = {
    "clocked": _CLOCKED,
    "roberts": _ROBERTS,
    "lag": LAG,
    "arrays": _ARRAYS,
    "sawtooth": _SAWTOOTH,
    "types": _types(),
}


def description(name: str, body: str | None = None) -> str:
    """The model description of one of the models."""
    has_events = name in ("sawtooth", "clocked")
    events = ' hasEventMode="true" mightReturnEarlyFromDoStep="true"' * has_events
    head = _HEAD.format(name=name, flags=_FLAGS, events=events)
    return head + (body or _BODIES[name]) + _TAIL


def compile_model(name: str, library: Path, *flags: str) -> Path:
    """Compile a model in its frame to a shared library."""
    command = [compiler(), *FLAGS, f"-I{HEADERS}", f"-I{FRAME}", f'-DMODEL="{name}.h"', *flags]
    command += [str(FRAME / "frame.c"), "-o", str(library), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    return library


def pack(path: Path, files: Mapping[str, bytes | str]) -> Path:
    """Write an archive."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, contents in files.items():
            archive.writestr(name, contents)
    return path


def build(name: str, folder: Path, *flags: str, body: str | None = None) -> Path:
    """Compile one of the models ``lag``, ``arrays``, ``sawtooth``, ``types`` to an FMU."""
    with tempfile.TemporaryDirectory(prefix="fmi3_") as scratch:
        library = compile_model(name, Path(scratch, "library"), *flags).read_bytes()
    files: dict[str, bytes | str] = {
        "modelDescription.xml": description(name, body),
        f"binaries/{fmpy.platform_tuple}/{name}{fmpy.sharedLibraryExtension}": library,
    }
    if name == "types":
        files["resources/here.txt"] = "4.25\n"
    return pack(folder / f"{name}.fmu", files)


def build_wide(count: int, folder: Path) -> Path:
    """Compile an FMU whose input and output are arrays of many elements."""
    return build("wide", folder, f"-DN={count}", body=wide_body(count))


@functools.cache
def foreign(name: str) -> Path:
    """One of the models as an FMU, compiled once a process."""
    folder = Path(tempfile.mkdtemp(prefix="foreign3_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return build(name, folder)


def of_interface(path: Path, interface: str, folder: Path) -> Path:
    """A copy of a model with ``CoSimulation``, ``ModelExchange`` or ``ScheduledExecution`` only."""
    text = contents(path)["modelDescription.xml"].decode()
    for tag in {"CoSimulation", "ModelExchange"} - {interface}:
        start = text.index(f"<{tag}")
        end = text.index("/>", start) + 2
        is_replaced = interface == "ScheduledExecution" and tag == "CoSimulation"
        put = f'<ScheduledExecution modelIdentifier="{path.stem}"/>' if is_replaced else ""
        text = text[:start] + put + text[end:]
    return _described(path, folder / f"{interface}.fmu", text)


def _described(path: Path, target: Path, text: str) -> Path:
    """A copy of an FMU with another description."""

    def edit(member: str, data: bytes) -> tuple[str, bytes]:
        return member, text.encode() if member == "modelDescription.xml" else data

    made: Path = edited(path, target, edit)
    return made


def changed(name: str, folder: Path, old: str, new: str) -> Path:
    """One of the models with a text of its description replaced, which must be there."""
    text = description(name)
    assert old in text
    return _described(foreign(name), folder / "changed.fmu", text.replace(old, new))
