"""Claims: a system that is written has what OMSimulator wants to know of it, in the form in which
it documents that.

OMSimulator cannot be installed from a package index alone (its package fetches a binary from
elsewhere; ``tests/interop/test_system_masters.py`` runs one that is there), so the oracle is its
documented form: its schema ``oms.xsd``, and how it reads a
description: elements by prefix and name, of several annotations the first only (pull request 890
and issues 751, 1094 and 1318 of its repository).
"""

from __future__ import annotations

import re
import zipfile
from xml.dom import minidom

import pytest

from orchestration.system import Port, System, library, ssp
from tests.support.system.archive import DESCRIPTION, repacked
from tests.support.system.samples import pair

SCHEMA = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
DECIMAL = re.compile(r"[0-9]+(\.[0-9]+)?")  # xs:decimal knows no exponent
IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def children(node, name):
    """Child elements of a name as it is written, prefix and all."""
    return [child for child in node.childNodes if child.nodeName == name]


def only(node, *path):
    for name in path:
        (node,) = children(node, name)
    return node


def written(system, path, connectors=False):
    ssp.write(system, path, connectors)
    with zipfile.ZipFile(path) as found:
        return minidom.parseString(found.read(DESCRIPTION)).documentElement


@pytest.mark.parametrize("connectors", [False, True])
@pytest.mark.parametrize("step", [1e-7, 2.5e-5, 0.1, 1.0, 3600.0])
def test_the_first_annotation_of_a_system_names_the_master_and_its_step(tmp_path, step, connectors):
    drive, _ = pair(tmp_path / "fmus")
    system = System("one", (drive,), (), {"command": (Port("drive", "command"),)}, step=step)
    root = written(system, tmp_path / "a.ssp", connectors)
    assert root.getAttribute("xmlns:oms") == SCHEMA
    first = children(only(root, "ssd:System", "ssd:Annotations"), "ssc:Annotation")[0]
    assert first.getAttribute("type") == "org.openmodelica"
    found = only(first, "oms:Annotations", "oms:SimulationInformation", "oms:FixedStepMaster")
    values = dict(found.attributes.items())
    assert values.pop("description") == "oms-ma"  # its Jacobi master with a fixed step
    assert set(values) == {"stepSize", "absoluteTolerance", "relativeTolerance"}
    assert all(DECIMAL.fullmatch(value) for value in values.values()), values
    assert float(values["stepSize"]) == step


@pytest.mark.parametrize("name", library.NAMES)
def test_the_systems_that_ship_have_names_and_times_that_it_takes(tmp_path, name):
    system = library.system(name)
    root = written(system, tmp_path / "a.ssp")
    top = only(root, "ssd:System")
    members = children(only(top, "ssd:Elements"), "ssd:Component")
    assert {
        child.nodeName for child in root.childNodes if child.nodeType == child.ELEMENT_NODE
    } <= {"ssd:System", "ssd:Units", "ssd:Enumerations", "ssd:DefaultExperiment"}
    for element in (top, *members):
        assert IDENTIFIER.fullmatch(element.getAttribute("name"))
    assert {member.getAttribute("type") for member in members} == {
        "application/x-fmu-sharedlibrary"
    }
    experiment = only(root, "ssd:DefaultExperiment")
    assert float(experiment.getAttribute("startTime")) == 0.0
    assert float(experiment.getAttribute("stopTime")) == system.stop


def test_what_it_writes_itself_is_passed_over(tmp_path):
    """Buses and a variable step in the system, a result file in the experiment: none of it is ours
    to follow.
    """
    drive, _ = pair(tmp_path / "fmus")
    system = System(
        "two", (drive,), (), {"command": (Port("drive", "command"),)}, step=0.5, stop=3.0
    )
    ssp.write(system, tmp_path / "a.ssp")
    solver = '<oms:VariableStepSolver description="cvode" maximumStepSize="0.001"/>'
    result = (
        '<oms:SimulationInformation resultFile="r.mat" loggingInterval="0.0" bufferSize="10"'
        ' signalFilter=""/>'
    )
    annotation = (
        "<ssc:Annotation"
        ' type="org.openmodelica"><oms:Annotations>{}</oms:Annotations></ssc:Annotation>'
    )

    def change(text):
        text = re.sub("<oms:FixedStepMaster.*/>", f"{solver}", text)
        text = text.replace(
            "<oms:Annotations>", '<oms:Annotations><oms:Buses><oms:Bus name="b"/></oms:Buses>'
        )
        first, _, last = text.rpartition("<ssd:Annotations>")
        return f"{first}<ssd:Annotations>{annotation.format(result)}{last}"

    read = ssp.read(repacked(tmp_path / "a.ssp", change), tmp_path / "unpacked")
    assert (read.step, read.stop) == (0.5, 3.0)
    assert [member.name for member in read.members] == ["drive"]
