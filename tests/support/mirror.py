"""FMUs whose outputs are what was set, with any variables, types and units; see `c/mirror.c`."""

from __future__ import annotations

import functools
import subprocess
import tempfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

import fmpy

from tests.support.fmi3_fmus import pack
from tests.support.hosts import HEADERS, TESTS, compiler


@functools.cache
def _library() -> bytes:
    """The compiled library, once a process."""
    with tempfile.TemporaryDirectory(prefix="mirror_") as folder:
        library = Path(folder, "mirror.so")
        source = TESTS / "c" / "mirror.c"
        command = [compiler(), "-O1", "-fPIC", "-shared", "-w", f"-I{HEADERS}", str(source)]
        subprocess.run([*command, "-o", str(library)], check=True, capture_output=True)
        return library.read_bytes()


def variable(name: str, reference: int, causality: str, value: str, **more: str) -> str:
    """A scalar variable; `value` is the element of its type."""
    varies = {"parameter": "fixed", "local": "fixed"}.get(causality, "discrete")
    attributes = {"name": name, "valueReference": str(reference), "causality": causality}
    attributes |= {"variability": varies} | more
    words = " ".join(f"{key}={quoteattr(text)}" for key, text in attributes.items())
    return f"<ScalarVariable {words}>{value}</ScalarVariable>"


def mirror(path: Path, variables: list[str], units: str = "", types: str = "") -> Path:
    """Write an FMU with these variables."""
    outputs = [k for k, text in enumerate(variables, 1) if 'causality="output"' in text]
    unknowns = "".join(f'<Unknown index="{k}"/>' for k in outputs)
    description = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="mirror" guid="mirror">
<CoSimulation modelIdentifier="mirror" canHandleVariableCommunicationStepSize="true"/>
<UnitDefinitions>{units}</UnitDefinitions><TypeDefinitions>{types}</TypeDefinitions>
<DefaultExperiment startTime="0" stopTime="0.2" stepSize="0.1"/>
<ModelVariables>{"".join(variables)}</ModelVariables>
<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure>
</fmiModelDescription>"""
    binary = f"binaries/{fmpy.platform}/mirror{fmpy.sharedLibraryExtension}"
    return pack(path, {"modelDescription.xml": description, binary: _library()})
