"""Line 10: what an FMU brings along, and the reference result that it reproduces."""

from __future__ import annotations

import csv
import io
import re
import struct
import sys
import zipfile
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urljoin, urlsplit
from xml.etree import ElementTree

import numpy as np
import pytest

from fmus import component
from fmus.kit.build.toolchain import host_platform
from tests.contract.subjects import actuators_only, each_component
from tests.support import hosts

REFERENCES = "extra/org.fmi-standard.fmi-ls-ref"


@pytest.fixture
def folder(name) -> Path:
    """Return the folder of the component's sources."""
    return Path(sys.modules[component(name).__module__].__file__).parent


@pytest.fixture
def files(archive) -> dict[str, bytes]:
    with zipfile.ZipFile(archive) as opened:
        assert opened.testzip() is None
        return {name: opened.read(name) for name in opened.namelist()}


class Page(HTMLParser):
    """Text, tags and references of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.words, self.open, self.outside = "", [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.outside += [
            v for k, v in attributes if k in ("src", "href") and v and not v.startswith("#")
        ]
        if tag not in ("meta", "br", "img", "hr", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words += data


def test_documentation_is_a_page_with_every_variable_and_the_readme(files, folder, name):
    page = Page(files["documentation/index.html"].decode())
    assert page.open == [], "every element is closed"
    for variable in component(name).layout.variables:
        assert variable.name in page.words
    for line in (folder / "README.md").read_text().splitlines():
        if line.startswith("#"):
            assert line.strip("# ").replace("`", "") in page.words
    assert not [
        link for link in page.outside if not link.startswith(("https://", "http://", "mailto:"))
    ]


def test_icon_is_a_small_square_picture(files):
    picture = files["model.png"]
    assert picture[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", picture[16:24])
    assert 100 <= width == height <= 400
    assert len(picture) < 50_000


def test_licences(files):
    assert "BSD" in files["documentation/licenses/license.txt"].decode()
    assert len(files["documentation/licenses/third_party.txt"]) > 100


def test_what_is_needed_at_run_time_is_told(files, runtime):
    description = ElementTree.fromstring(files["modelDescription.xml"])
    needs = description.find("CoSimulation").attrib["needsExecutionTool"]
    assert needs == {"python": "true", "native": "false"}[runtime]
    assert ("documentation/externalDependencies.txt" in files) == (runtime == "python")
    if runtime == "python":
        assert "Python 3.11" in files["documentation/externalDependencies.txt"].decode()


def test_sources_are_with_the_native_build(files, runtime):
    description = ElementTree.fromstring(files["modelDescription.xml"])
    each = [[file.attrib["name"] for file in files] for files in description.iter("SourceFiles")]
    there = {name.removeprefix("sources/") for name in files if name.startswith("sources/")}
    if runtime == "python":
        assert not each
        assert not there
    else:
        assert each == [["all.c"], ["all.c"]], "of model exchange and of co-simulation"
        included = re.findall(r'#include "(.*)"', files["sources/all.c"].decode())
        assert len(included) >= 8
        assert {name for name in there if name.endswith(".c")} == {*included, "all.c"}
        assert {"model.h", "engine.h", "fmi2Functions.h"} <= there


def test_python_package_has_only_what_it_needs(files, runtime):
    packed = [name for name in files if name.startswith("resources/python/")]
    if runtime == "native":
        assert not packed
        return
    for name in packed:
        text = files[name].decode()
        for library in ("numpy", "casadi", "pint", "fmpy", "markdown_it"):
            assert f"import {library}" not in text, name
            assert f"from {library}" not in text, name


def test_binary_of_this_platform(files, name):
    assert [n for n in files if n.startswith(f"binaries/{host_platform()}/{name}.")]


def preset(files: dict[str, bytes], title: str) -> dict[str, float]:
    """Values of a preset's parameter file."""
    root = ElementTree.fromstring(files[f"resources/presets/{title}.ssv"])
    words = {"true": 1.0, "false": 0.0}
    texts = {
        p.attrib["name"]: p[0].attrib["value"] for p in root.iter() if p.tag.endswith("}Parameter")
    }
    return {name: words[text] if text in words else float(text) for name, text in texts.items()}


def test_presets_are_parameter_files(files, name):
    presets = component(name).presets
    there = {Path(file).stem for file in files if file.startswith("resources/presets/")}
    assert there == set(presets)
    for title in presets:
        assert preset(files, title) == presets[title].values


@actuators_only
def test_numbers_of_a_preset(files):
    values = preset(files, "five_layer")
    assert {k: values[k] for k in ("R1", "R2", "C")} == {"R1": 1.32, "R2": 2.72, "C": 0.46}
    assert values["k1"] == pytest.approx(6300 * 5 / 12)


# --- reference results
# ----------------------------------------------------------------------------------------------


def rows(text: str) -> tuple[list[str], np.ndarray]:
    header, *body = csv.reader(io.StringIO(text))
    return header, np.array(body, dtype=float)


def options(folder: Path, name: str) -> dict[str, str]:
    text = (folder / "reference" / f"{name}_ref.opt").read_text()
    return dict(line.split(",") for line in text.splitlines())


def test_cross_check_files_are_beside_the_model(folder, name):
    given = options(folder, name)
    assert {"StartTime", "StopTime", "StepSize", "RelTol"} <= set(given)
    for suffix in ("in", "ref"):
        header, table = rows((folder / "reference" / f"{name}_{suffix}.csv").read_text())
        assert header[0] == "time"
        assert table[0, 0] == float(given["StartTime"])
        assert table[-1, 0] == float(given["StopTime"])
        assert np.all(np.diff(table[:, 0]) >= 0.0)


def test_experiment_of_the_reference_result(files, folder, name):
    root = ElementTree.fromstring(files[f"{REFERENCES}/{name}.exp"])
    assert root.attrib["name"] == name
    (experiment,) = root.iter("Experiment")
    assert experiment.attrib["stopTime"] == options(folder, name)["StopTime"]
    assert experiment.attrib["stepSize"] == options(folder, name)["StepSize"]
    sources = [e.attrib["source"] for e in experiment]
    assert sources == [f"{name}_in.csv", f"{name}_ref.csv"]
    for source in sources:
        assert files[f"{REFERENCES}/{source}"] == (folder / "reference" / source).read_bytes()


# of the schema of the layered standard as released (1.0.0-beta.1), with sub-roles
ATTRIBUTES = {"type", "source", "role", "description"}
ROLES = re.compile(
    "document|requirement|specification|model|parameter|system|testcase|"
    "experiment(/(smoke-test|validation|uncertainty-analysis))?|result|method|rationale|report|"
    "request|delivery|configuration|signature|serialized-state(/.*)?|meta-data|other"
)


def test_manifest_of_related_files(files, name):
    manifest = ElementTree.fromstring(files[f"{REFERENCES}/fmi-ls-manifest.xml"])
    namespace = "{http://fmi-standard.org/fmi-ls-manifest}"
    assert manifest.tag == "fmiReferences"
    assert manifest.attrib == {
        f"{namespace}fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
        f"{namespace}fmi-ls-version": "1.0.0-beta.1",
        f"{namespace}fmi-ls-description": (
            "Layered Standard providing information on related files included in an FMU."
        ),
    }
    roles = {}
    for related in manifest:
        assert related.tag == "Related"
        assert set(related.attrib) == ATTRIBUTES
        assert ROLES.fullmatch(related.attrib["role"])
        assert related.attrib["description"]
        path = urlsplit(urljoin(f"file:///{REFERENCES}/", related.attrib["source"])).path[1:]
        assert path in files
        roles[path] = related.attrib["role"]
    presets = {n: "parameter" for n in files if n.startswith("resources/presets/")}
    assert roles == presets | {
        "documentation/index.html": "document",
        f"{REFERENCES}/{name}.exp": "experiment/validation",
        f"{REFERENCES}/{name}_in.csv": "testcase",
        f"{REFERENCES}/{name}_ref.csv": "result",
    }


@each_component
def test_fmu_reproduces_the_reference_result(archive, files, name):
    wanted, expected = rows(files[f"{REFERENCES}/{name}_ref.csv"].decode())
    fed, stimuli = rows(files[f"{REFERENCES}/{name}_in.csv"].decode())
    # The last row of a repeated time is the value after a jump.
    after = np.append(np.diff(expected[:, 0]) > 0.0, True)
    times = expected[after, 0]
    jumps = np.append(np.diff(stimuli[:, 0]) > 0.0, True)
    held = np.searchsorted(stimuli[jumps, 0], times + 1e-9, side="right") - 1
    inputs = {signal: stimuli[jumps, i][held] for i, signal in enumerate(fed) if i}
    found = hosts.run_fmpy(archive, times, inputs, wanted[1:])
    before = np.append(True, np.diff(expected[:, 0]) > 0.0) & ~after
    left = hosts.run_fmpy(archive, times, inputs, wanted[1:], feedthrough=False)
    scale = np.abs(expected[:, 1:]).max(axis=0)
    for i, signal in enumerate(wanted[1:]):
        assert np.abs(found[signal] - expected[after, i + 1]).max() <= 1e-7 * scale[i], signal
        at_jumps = np.isin(times, expected[before, 0])
        assert np.abs(left[signal][at_jumps] - expected[before, i + 1]).max() <= 1e-7 * scale[i], (
            signal
        )
