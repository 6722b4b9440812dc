"""The FMU `c/sleeper.c`: it has a text for a parameter, tells what it was given, and takes its time
for its steps.
"""

from __future__ import annotations

import functools
import subprocess
import tempfile
import zipfile
from pathlib import Path

import fmpy

from tests.support.hosts import HEADERS, TESTS, compiler

_REALS = (
    *(
        (name, "output", ' initial="calculated"', "continuous")
        for name in ("characters", "checksum")
    ),
    *(
        (name, "output", ' initial="calculated"', "continuous")
        for name in ("voltage_age", "link_state")
    ),
    *((name, "parameter", "", "fixed") for name in ("delay", "from", "until", "fails_at")),
)
_STARTS = {"fails_at": 1e9}


@functools.cache
def _library() -> bytes:
    with tempfile.TemporaryDirectory(prefix="sleeper_") as folder:
        library = Path(folder, "sleeper.so")
        command = [compiler(), "-std=c99", "-O2", "-fPIC", "-shared", f"-I{HEADERS}"]
        subprocess.run([*command, str(TESTS / "c" / "sleeper.c"), "-o", str(library)], check=True)
        return library.read_bytes()


def _start(name: str, initial: str) -> str:
    return "" if initial else f' start="{_STARTS.get(name, 0.0)}"'


def build_sleeper(folder: Path) -> Path:
    """Pack ``sleeper.fmu``; its text `label` is ``abc`` unless it is set."""
    reals = [
        f'<ScalarVariable name="{name}" valueReference="{k}" causality="{causality}"'
        f' variability="{changes}"{initial}><Real{_start(name, initial)}/></ScalarVariable>'
        for k, (name, causality, initial, changes) in enumerate(_REALS)
    ]
    text = (
        '<ScalarVariable name="label" valueReference="0" causality="parameter" variability="fixed" '
        'description="what it is told"><String start="abc"/></ScalarVariable>'
    )
    outputs = "".join(f'<Unknown index="{k}" dependencies=""/>' for k in range(1, 5))
    path = folder / "sleeper.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="2.0" modelName="sleeper" guid="sleeper">'
            '<CoSimulation modelIdentifier="sleeper"'
            ' canHandleVariableCommunicationStepSize="true"/>'
            '<DefaultExperiment startTime="0" stopTime="1" stepSize="0.1"/>'
            f"<ModelVariables>{''.join(reals)}{text}</ModelVariables>"
            f"<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>",
        )
        archive.writestr(f"binaries/{fmpy.platform}/sleeper.so", _library())
    return path
