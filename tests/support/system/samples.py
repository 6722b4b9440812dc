"""Small FMUs that only describe themselves, and systems of them: enough for everything but
running.
"""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

from orchestration.system import Member

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{name}">
  <CoSimulation modelIdentifier="{name}"/>
  <ModelVariables>
{variables}
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
"""


def variable(reference: int, text: str) -> str:
    """Describe a variable given as "causality name type unit"."""
    causality, name, kind, unit = [*text.split(), "", ""][:4]
    attributes = f" unit={quoteattr(unit)}" if unit else ""
    start = "" if causality == "output" else ' start="0"' if kind != "Boolean" else ' start="false"'
    variability = ' variability="fixed"' if causality == "parameter" else ' variability="discrete"'
    head = (
        f'    <ScalarVariable name="{name}" valueReference="{reference}"'
        f' causality="{causality}"{variability}>'
    )
    return f"{head}<{kind or 'Real'}{attributes}{start}/></ScalarVariable>"


def tiny_fmu(path: Path, *variables: str) -> Path:
    """Write an FMU without a binary whose variables are each given as "causality name type
    unit".
    """
    lines = "\n".join(variable(k, text) for k, text in enumerate(variables))
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml", DESCRIPTION.format(name=path.stem, variables=lines)
        )
    return path


def pair(folder: Path) -> tuple[Member, Member]:
    """Two members: ``drive`` gives, ``load`` takes, in all types and some units."""
    drive = tiny_fmu(
        folder / "drive.fmu",
        "input command Real A",
        "output force Real N",
        "output reading Real mN",
        "output way Real m",
        "output heat Real degC",
        "output odd Real furlongish",
        "output count Integer",
        "output ready Boolean",
        "parameter gain Real N/A",
        "parameter steps Integer",
        "parameter armed Boolean",
    )
    load = tiny_fmu(
        folder / "load.fmu",
        "input force Real N",
        "input level Integer",
        "input hold Boolean",
        "input length Real mm",
        "input warm Real K",
        "output tension Real N",
        "parameter mass Real kg",
        "input odd Real furlongish",
    )
    return Member("drive", drive), Member(
        "load", load, {"level": 2.0, "hold": 1.0, "length": 0.5, "warm": 3.0, "odd": 1.0}
    )


def without_starts(fmu: Path) -> Path:
    """Take the start values out of an FMU that only describes itself, as some tools leave them."""
    with zipfile.ZipFile(fmu) as archive:
        text = archive.read("modelDescription.xml").decode()
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", re.sub(r' start="[^"]*"', "", text))
    return fmu
