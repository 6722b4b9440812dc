"""FMUs that write down every call, for both versions of FMI and both interfaces; see
`c/recorder.c`.
"""

from __future__ import annotations

import atexit
import functools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import fmpy

from tests.support.fmi3_fmus import pack
from tests.support.hosts import HEADERS, TESTS, compiler

NAMES = ("k", "tau", "keeps", "ends", "fails", "u", "y", "x", "der(x)")
_PARAMETERS = {"k": 1.0, "tau": 1.0, "keeps": 0.0, "ends": 1e300, "fails": 1e300}
EXPERIMENT = '<DefaultExperiment startTime="-1" stopTime="1" stepSize="0.25" tolerance="1e-7"/>'
INTERFACES = ("CoSimulation", "ModelExchange")


class Call(NamedTuple):
    """A call that an FMU has noted."""

    process: int
    instance: int
    function: str
    arguments: list[str]


def values_set(call: Call) -> dict[str, float]:
    """The values that a call has set, by name."""
    pairs = (text.split("=") for text in call.arguments)
    return {NAMES[int(reference)]: float(value) for reference, value in pairs}


def values_read(call: Call) -> list[str]:
    """The names of the variables that a call has read."""
    return [NAMES[int(reference)] for reference in call.arguments]


def _interfaces(version: int, interfaces: Sequence[str], varies: str) -> str:
    """The elements of the interfaces."""
    elements = {
        "CoSimulation": '<CoSimulation modelIdentifier="recorder"'
        f' canHandleVariableCommunicationStepSize="{varies}"/>',
        "ModelExchange": '<ModelExchange modelIdentifier="recorder"'
        + (' needsCompletedIntegratorStep="true"' if version == 3 else "")
        + "/>",
    }
    return "".join(elements[name] for name in INTERFACES[::-1] if name in interfaces)


def _description2(interfaces: Sequence[str], varies: str) -> str:
    parameters = "".join(
        f'<ScalarVariable name="{name}" valueReference="{k}" causality="parameter"'
        f' variability="fixed"><Real start="{start!r}"/></ScalarVariable>'
        for k, (name, start) in enumerate(_PARAMETERS.items())
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="recorder" guid="recorder"
    numberOfEventIndicators="0">
{_interfaces(2, interfaces, varies)}
{EXPERIMENT}
<ModelVariables>{parameters}
<ScalarVariable name="u" valueReference="5" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="6" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="x" valueReference="7" causality="local"><Real/></ScalarVariable>
<ScalarVariable name="der(x)" valueReference="8" causality="local"><Real derivative="8"/>
</ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="7"/></Outputs>
<Derivatives><Unknown index="9"/></Derivatives>
<InitialUnknowns><Unknown index="7"/><Unknown index="8"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"""


def _description3(interfaces: Sequence[str], varies: str) -> str:
    parameters = "".join(
        f'<Float64 name="{name}" valueReference="{k}" causality="parameter" variability="fixed"'
        f' start="{start!r}"/>'
        for k, (name, start) in enumerate(_PARAMETERS.items())
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="recorder" instantiationToken="recorder">
{_interfaces(3, interfaces, varies)}
{EXPERIMENT}
<ModelVariables>{parameters}
<Float64 name="u" valueReference="5" causality="input" start="0"/>
<Float64 name="y" valueReference="6" causality="output"/>
<Float64 name="x" valueReference="7" causality="local" initial="calculated"/>
<Float64 name="der(x)" valueReference="8" causality="local" derivative="7"/>
<Float64 name="time" valueReference="9" causality="independent" variability="continuous"/>
</ModelVariables>
<ModelStructure><Output valueReference="6"/><ContinuousStateDerivative valueReference="8"/>
<InitialUnknown valueReference="6"/><InitialUnknown valueReference="7"/></ModelStructure>
</fmiModelDescription>
"""


@functools.cache
def recorder(
    version: int, interfaces: tuple[str, ...] = INTERFACES, *, fixed_step: bool = False
) -> Path:
    """Compile the FMU, once a process."""
    folder = Path(tempfile.mkdtemp(prefix="recorder_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    library = folder / f"recorder{fmpy.sharedLibraryExtension}"
    command = [compiler(), "-D_GNU_SOURCE", "-O1", "-fPIC", "-shared", "-w", f"-I{HEADERS}"]
    command += [f"-DVERSION={version}", "-include", "unistd.h", str(TESTS / "c" / "recorder.c")]
    subprocess.run([*command, "-o", str(library), "-lm"], check=True, capture_output=True)
    describe = _description2 if version == 2 else _description3
    platform = fmpy.platform if version == 2 else fmpy.platform_tuple
    path = folder / f"recorder{version}.fmu"
    return pack(
        path,
        {
            "modelDescription.xml": describe(interfaces, "false" if fixed_step else "true"),
            f"binaries/{platform}/{library.name}": library.read_bytes(),
        },
    )


def recorded(task: Callable[[], Any]) -> tuple[Any, list[Call]]:
    """Do a task; return its result, and the calls of recorders in it and in its processes."""
    with tempfile.TemporaryDirectory(prefix="recorded_") as folder:
        path = Path(folder, "calls")
        path.touch()
        with patch.dict(os.environ, {"RECORDED_CALLS": str(path)}):
            result = task()
        lines = path.read_text().splitlines()
    calls = []
    for line in lines:
        process, instance, function, *arguments = line.split()
        calls.append(Call(int(process), int(instance), function, arguments))
    return result, calls


def by_instance(calls: Sequence[Call]) -> list[list[Call]]:
    """The calls of each instance, in their order."""
    lives: list[list[Call]] = []
    present: dict[tuple[int, int], list[Call]] = {}
    for call in calls:
        key = (call.process, call.instance)
        if call.function == "Instantiate":  # numbers begin again with a library loaded anew
            present[key] = []
            lives.append(present[key])
        present[key].append(call)
    return lives
