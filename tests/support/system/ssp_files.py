"""Systems in files of SSP: compared, validated, changed, and refused."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import fmpy.ssp.ssd
import pytest
from lxml import etree

from fmus.kit.errors import UserError
from orchestration.system import ssp
from orchestration.system.checking import check
from tests.support.system.archive import BINDINGS, NAMESPACES

SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"


def contents(system):
    """The system with the bytes of its FMUs in place of their paths, and without classes."""
    bare = tuple(
        replace(m, cls=None, fmu=m.fmu.read_bytes(), parameters=dict(m.parameters))
        for m in system.members
    )
    return replace(system, members=bare)


def validate(text, schema, folder=SCHEMAS):
    """Hold XML against a schema of the standard, of SSP 1.0 unless another folder is given."""
    found = etree.XMLSchema(file=str(folder / schema))
    assert found.validate(etree.fromstring(text)), found.error_log


def schemas_of_2():
    """The folder of the schemas of SSP 2.0."""
    package = importlib.util.find_spec("pyssp_standard")
    if package is None:
        pytest.skip("pyssp-standard is not installed, which has the schemas of SSP 2.0")
    return Path(package.origin).parent / "resources" / "ssp2"


def refused(path, folder, *parts):
    """The file must be refused in one line that begins with its name, and nothing be unpacked
    outside of the folder.
    """
    around = sorted(path.parent.rglob("*"))
    with pytest.raises(UserError) as caught:
        check(ssp.read(path, folder))
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(str(path))
    for part in parts:
        assert part in text, text
    assert [p for p in sorted(path.parent.rglob("*")) if folder not in (p, *p.parents)] == around


def bound(text):
    """The description with other parameters for the drive."""

    def change(description):
        root = ElementTree.fromstring(description)
        drive = root.find(".//{*}Component")
        drive.remove(drive.find("{*}ParameterBindings"))
        new = ElementTree.fromstring(f"<x {NAMESPACES}>{BINDINGS.format(text)}</x>")
        drive.append(new[0])
        return ElementTree.tostring(root, encoding="unicode")

    return change


def refused_one(path, folder, *parts):
    """Refused by the reader or by the check of what it read, which begins with the name of the
    system.
    """
    with pytest.raises(UserError) as caught:
        check(ssp.read(path, folder))
    text = str(caught.value)
    assert text.startswith((str(path), "system sample: "))
    assert "\n" not in text
    for part in parts:
        assert part in text, text
