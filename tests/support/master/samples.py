"""Members for the tests of the master: `c/member.c` with chosen abilities."""

from __future__ import annotations

import functools
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

import fmpy

from orchestration.system.model import Connection, Member, Port, System
from tests.support.hosts import HEADERS, TESTS, compiler

_PARAMETERS = {
    "tau": 1,
    "c": 1,
    "d": 0,
    "e": 0,
    "start": 0,
    "euler": 0,
    "status": 0,
    "when": 1e9,
    "nan": 0,
    "init": 0,
    "lag": 0,
    "trace": 0,
    "follow": 0,
}


@functools.cache
def _library(once: bool) -> bytes:
    with tempfile.TemporaryDirectory(prefix="member_") as folder:
        library = Path(folder, "member.so")
        command = [compiler(), "-std=c99", "-O2", "-fPIC", "-shared", f"-I{HEADERS}"]
        command += ["-DONCE"] if once else []
        subprocess.run(
            [*command, str(TESTS / "c" / "member.c"), "-o", str(library), "-lm"], check=True
        )
        return library.read_bytes()


def build_member(
    folder: Path, dependencies: bool | None = True, nominal: float = 1.0, **abilities: bool
) -> Path:
    """Pack ``member.fmu``.

    Parameters
    ----------
    folder : Path
    dependencies : bool or None
        Whether y depends on u at once; None: the FMU does not say, nor for x.
    nominal : float
        Of u, x and y.
    **abilities : bool
        Attributes of CoSimulation; by default states can be saved and step sizes vary.
    """
    can = {"canGetAndSetFMUstate": True, "canHandleVariableCommunicationStepSize": True} | abilities
    once = can.get("canBeInstantiatedOnlyOncePerProcess", False)
    attributes = " ".join(f'{name}="{str(value).lower()}"' for name, value in can.items())
    listed = (
        ["", ""]
        if dependencies is None
        else [' dependencies=""', f' dependencies="{1 if dependencies else ""}"']
    )
    signals = [
        ("u", "input", ""),
        ("x", "output", ' initial="calculated"'),
        ("y", "output", ' initial="calculated"'),
    ]
    variables = [
        f'<ScalarVariable name="{name}" valueReference="{k}" causality="{causality}"'
        f' variability="continuous"{initial}>'
        "<Real"
        f' nominal="{nominal}"{"" if initial else " start=" + chr(34) + "0" + chr(34)}/>'
        "</ScalarVariable>"
        for k, (name, causality, initial) in enumerate(signals)
    ] + [
        f'<ScalarVariable name="{name}" valueReference="{k}" causality="parameter"'
        f' variability="fixed"><Real start="{start}"/></ScalarVariable>'
        for k, (name, start) in enumerate(_PARAMETERS.items(), 3)
    ]
    path = folder / "member.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            f'<fmiModelDescription fmiVersion="2.0" modelName="Member" guid="member">'
            f'<CoSimulation modelIdentifier="member" {attributes}/>'
            f"<ModelVariables>{''.join(variables)}</ModelVariables>"
            f'<ModelStructure><Outputs><Unknown index="2"{listed[0]}/><Unknown'
            f' index="3"{listed[1]}/></Outputs>'
            "</ModelStructure></fmiModelDescription>",
        )
        archive.writestr(f"binaries/{fmpy.platform}/member.so", _library(once))
    return path


def ring(
    fmu: Path | Mapping[str, Path],
    parameters: Mapping[str, Mapping[str, float]],
    wires: str,
    **inputs: str,
) -> System:
    """A system of such members.

    Parameters
    ----------
    fmu : Path or Mapping
        Of all members, or of each.
    parameters : Mapping
        By member.
    wires : str
        As ``"a.x -> b.u; b.x -> -2 a.u + 1"``.
    **inputs : str
        Inputs of the system, and the port each feeds.
    """
    members = [
        Member(name, fmu if isinstance(fmu, Path) else fmu[name], own)
        for name, own in parameters.items()
    ]
    connections = []
    for wire in filter(None, (part.strip() for part in wires.split(";"))):
        source, target = (end.split() for end in wire.split("->"))
        offset = float(target.pop()) if len(target) > 2 else 0.0
        target = [word for word in target if word != "+"]
        factor = float(target.pop(0)) if len(target) == 2 else 1.0
        ports = [Port(*text.split(".")) for text in (source[0], target[0])]
        connections.append(Connection(*ports, factor=factor, offset=offset))
    fed = {name: (Port(*text.split(".")),) for name, text in inputs.items()}
    return System("ring", tuple(members), tuple(connections), fed)
