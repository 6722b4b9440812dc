"""Claims: FMUs that cannot be run on this machine are refused in one line, and nothing is left of
them.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from fmus.kit import UserError
from fmus.kit.build.toolchain import host_platform
from orchestration.fmu.archive import read_description
from orchestration.fmu.instance import Fmu
from tests.support.archive import edited
from tests.support.fmi3_fmus import foreign


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (
            lambda n, c: None if n == "modelDescription.xml" else (n, c),
            "a zip archive but not an FMU",
        ),
        (
            lambda n, c: ("SystemStructure.ssd" if n == "modelDescription.xml" else n, c),
            r"other\.fmu: a system \(SSP\), where an FMU is needed$",
        ),
        (
            lambda n, c: (n, c.replace(b'fmiVersion="2.0"', b'fmiVersion="3.1"')),
            "FMI version 3.1; this program knows FMI 2.0 and 3.0$",
        ),
        (
            lambda n, c: (n, c.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"')),
            "FMI version 1.0; this program knows",
        ),
        (
            lambda n, c: (
                n,
                c.replace(b"CoSimulation", b"Other").replace(b"ModelExchange", b"Other"),
            ),
            "has neither an element CoSimulation nor ModelExchange$",
        ),
        (
            lambda n, c: (n, c.replace(b"ModelVariables", b"Variables")),
            r"Description\.xml has no element ModelVariables$",
        ),
        (lambda n, c: (n, c[:500]), r"modelDescription\.xml cannot be read: "),
        (
            lambda n, c: (n, c.replace(b"modelIdentifier", b"identifier")),
            r"Description\.xml: \w+ has no attribute modelIdentifier$",
        ),
        (
            lambda n, c: (n, c.replace(b'modelIdentifier="', b'modelIdentifier="../../')),
            r"Description\.xml: modelIdentifier '\.\./\.\./ppy_actuator' is no name of a library$",
        ),
        (
            lambda n, c: (n, c.replace(b'stopTime="', b'stopTime="soon ')),
            r"Description\.xml: DefaultExperiment: stopTime 'soon [\d.]+' is not a finite number",
        ),
    ],
)
def test_descriptions_that_cannot_be_run_are_refused(fmu, tmp_path, edit, message):
    path = edited(fmu("ppy_actuator", "native"), tmp_path / "other.fmu", edit)
    with pytest.raises(UserError, match=message) as caught:
        read_description(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda n, c: (n.replace(host_platform(), "win32"), c), r"no binary for \w+; it has win32"),
        (
            lambda n, c: None if n.startswith("binaries") else (n, c),
            r"no binary for \w+; it has none",
        ),
        (
            lambda n, c: (n, b"no library" if n.startswith("binaries") else c),
            r"cannot be loaded \(",
        ),
        (lambda n, c: (n, c.replace(b'guid="{', b'guid="{0')), r"GUID|guid"),
    ],
)
def test_binaries_that_cannot_be_run_are_refused(fmu, tmp_path, scratch, edit, message):
    path = edited(fmu("ppy_actuator", "native"), tmp_path / "other.fmu", edit)
    here = Path.cwd()
    with pytest.raises(UserError, match=message) as caught, Fmu(path):
        pass
    assert Path.cwd() == here
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert list(scratch.iterdir()) == []


CLOCK = b'<Clock name="tick" valueReference="99" causality="input" intervalVariability="constant"/>'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            b"</ModelVariables>",
            CLOCK + b"</ModelVariables>",
            "tick: is a clock of a constant interv",
        ),
        (b'"3.0"', b'"3.0-beta.2"', r"FMI version 3\.0-beta\.2; this program knows FMI 2\.0 and 3"),
        (b'start="0.5"', b'start="0.5 1"', "tau: has 2 start values; expected 1$"),
        (b"<ModelVariables>", b"", r"modelDescription\.xml cannot be read: it is not well-formed"),
    ],
)
def test_descriptions_of_fmi_3_that_cannot_be_run_are_refused(tmp_path, old, new, message):
    def edit(name, contents):
        return name, contents.replace(old, new) if name.endswith(".xml") else contents

    path = edited(foreign("lag"), tmp_path / "other.fmu", edit)
    with pytest.raises(UserError, match=message) as caught:
        read_description(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
