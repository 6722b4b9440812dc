"""Claims: ``ppy system`` lists, shows, draws, exports and checks; whatever is wrong is one line and
exit code 2.
"""

from __future__ import annotations

import re
import shutil
import zipfile

import pytest

from orchestration.system import library, ssp
from tests.support.command import here, refused
from tests.support.system.archive import repacked
from tests.support.system.samples import tiny_fmu

EARLIER = "the result of earlier work\n"


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The file of a good system."""
    path = tmp_path_factory.mktemp("bench") / "bench.ssp"
    ssp.write(library.system("dma_bench"), path)
    return path


@pytest.fixture
def folder(tmp_path, bench):
    """A folder with a good system, a bench as a file, and earlier results."""
    shutil.copy(bench, tmp_path)
    for name in ("out.ssp", "out.png"):
        (tmp_path / name).write_text(EARLIER, encoding="utf-8")
    return tmp_path


def done(folder, *arguments):
    """The command must succeed; returns what it said."""
    process = here("system", *arguments, cwd=folder)
    assert process.returncode == 0, process.stderr
    return process.stdout


def test_list(tmp_path):
    lines = done(tmp_path, "list").splitlines()
    assert [line.split()[0] for line in lines] == list(library.NAMES)


@pytest.mark.parametrize("name", ["dma_bench", "bench.ssp"])
def test_show(folder, name):
    text = done(folder, "show", name)
    for part in (
        "dma_bench",
        "voice_coil_dma.fmu",
        "hold=0",
        "bench.position",
        "actuator.length_change",
        "input current",
        "output tension",
        "step 0.0001 s, duration 5 s",
    ):
        assert part in text


def test_show_tells_a_factor(folder):
    other = repacked(
        folder / "bench.ssp",
        lambda text: text.replace(
            'startConnector="position" endElement="actuator" endConnector="length_change" />',
            'startConnector="position" endElement="actuator" endConnector="length_change">'
            '<ssc:LinearTransformation factor="2" offset="-0.5"/></ssd:Connection>',
        ),
    )
    assert "bench.position × 2 -0.5" in done(folder, "show", other.name)


@pytest.mark.parametrize("name", ["[/bold]", "[red]x", ":warning:"])
def test_show_names_that_look_like_markup(folder, name):
    """Of the system, of a member, and of an input: each as it is."""
    named = r'(name|startElement|endElement|startConnector)="(dma_bench|bench|force_reference)"'
    other = repacked(folder / "bench.ssp", lambda text: re.sub(named, rf'\1="{name}"', text))
    text = done(folder, "show", other.name)
    for part in (f"{name}  Voice coil", f"{name}.position", f"input {name}"):
        assert part in text


@pytest.mark.parametrize("name", ["dma_bench", "bench.ssp"])
def test_draw(folder, name):
    expected = "dma_bench.png" if name == "dma_bench" else "bench.png"
    assert f"wrote {expected}" in done(folder, "draw", name)
    assert (folder / expected).read_bytes().startswith(b"\x89PNG")
    done(folder, "draw", name, "--out", "new.svg")
    assert b"<svg" in (folder / "new.svg").read_bytes()


def test_export_and_check(folder, runtime):
    assert "wrote dma_bench.ssp" in done(folder, "export", "dma_bench", "--runtime", runtime)
    with zipfile.ZipFile(folder / "dma_bench.ssp") as found:
        exported = found.read("resources/voice_coil_dma.fmu")
    member = library.system("dma_bench", runtime).members[0]
    assert exported == member.fmu.read_bytes()
    assert "dma_bench.ssp: 2 members, 2 connections, no errors, 0 warnings" in done(
        folder, "check", "dma_bench.ssp"
    )
    done(folder, "export", "dma_bench.ssp", "--out", "copy.ssp", "--connectors")
    done(folder, "export", "copy.ssp", "--out", "again.ssp")
    assert (folder / "again.ssp").read_bytes() == (folder / "dma_bench.ssp").read_bytes()


def test_check_tells_what_is_odd(folder):
    process = here("system", "check", "bench.ssp", cwd=folder)
    assert process.stderr == ""
    strange = tiny_fmu(folder / "films.fmu", "input u Real", "output y Real")
    text = (
        "<ssd:SystemStructureDescription"
        ' xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" version="1.0"'
        ' name="a"><ssd:System name="films"><ssd:Connectors><ssd:Connector name="u"'
        ' kind="input"/></ssd:Connectors><ssd:Elements><ssd:Component name="one"'
        ' source="films.fmu"/></ssd:Elements><ssd:Connections><ssd:Connection startConnector="u"'
        ' endElement="one"'
        ' endConnector="u"/></ssd:Connections></ssd:System></ssd:SystemStructureDescription>'
    )
    (folder / "films.ssd").write_text(text, encoding="utf-8")
    process = here("system", "check", "films.ssd", cwd=folder)
    assert process.returncode == 0
    assert f"warning: one: {strange.name} has no binary for" in process.stderr
    assert "films.ssd: 1 members, 0 connections, no errors, 1 warnings" in process.stdout


WIRE = 'endElement="bench" endConnector="tension" />'


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (
            lambda t: t.replace(
                'startConnector="tension" ' + WIRE, 'startConnector="charge" ' + WIRE
            ),
            ["actuator.charge -> bench.tension", "'C' of actuator.charge", "'N' of bench.tension"],
        ),
        (
            lambda t: t.replace(
                "</ssd:Connections>",
                '<ssd:Connection startElement="actuator" startConnector="tension" '
                + WIRE
                + "</ssd:Connections>",
                1,
            ),
            ["bench.tension has two sources"],
        ),
        (
            lambda t: t.replace("resources/voice_coil_dma.fmu", "resources/gone.fmu"),
            ["member bench", "resources/gone.fmu is missing"],
        ),
        (
            lambda t: t.replace("resources/voice_coil_dma.fmu", "../gone.fmu"),
            ["bench", "'../gone.fmu' leads out"],
        ),
    ],
    ids=["unit", "two sources", "missing FMU", "FMU outside"],
)
@pytest.mark.parametrize("command", ["check", "show", "draw", "export"])
def test_files_that_make_no_sense(folder, command, change, parts):
    repacked(folder / "bench.ssp", change, name="bad.ssp")
    out = {"draw": ["--out", "out.png"], "export": ["--out", "out.ssp"]}.get(command, [])
    refused(folder, "system", command, "bad.ssp", *out, parts=parts)


def test_an_archive_that_escapes(folder):
    repacked(folder / "bench.ssp", None, [("../outside.txt", "x")], name="bad.ssp")
    line = refused(
        folder,
        "system",
        "check",
        "bad.ssp",
        parts=["bad.ssp", "'../outside.txt' leads out of the archive"],
    )
    assert line == "error: bad.ssp: '../outside.txt' leads out of the archive; it is not opened"


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["show", "dma_bnch"], ["no system named 'dma_bnch'", "did you mean dma_bench"]),
        (["show", "gone.ssp"], ["gone.ssp", "no such file"]),
        (["show", "out.png"], ["out.png", ".ssp or .ssd", "dma_bench"]),
        (["check", "out.ssp"], ["out.ssp", "not a zip archive"]),
        (["check", "."], [".ssp or .ssd"]),
        (["draw", ""], [".ssp or .ssd"]),
        (["export", ""], [".ssp or .ssd"]),
        (["draw", "dma_bench", "--out", "out.bmp"], ["out.bmp", ".png, .svg, .pdf"]),
        (["draw", "dma_bench", "--out", "out.png/x.png"], ["cannot write out.png"]),
        (["export", "dma_bench", "--out", "out.zip"], ["out.zip", ".ssp or .ssd"]),
        (["export", "dma_bench", "--out", "out.ssp/x.ssp"], ["cannot write out.ssp"]),
        (["export", "dma_bench", "--runtime", "fortran"], ["'fortran'", "native, python"]),
        (["export", "bench.ssp", "--out", "bench.ssp"], ["--out bench.ssp", "the system itself"]),
        (["export", "bench.ssp"], ["--out bench.ssp", "the system itself"]),
        ([], ["system --help"]),
        (["fly"], ["No such command 'fly'", "system --help"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_what_cannot_be_done(folder, arguments, parts):
    refused(folder, "system", *arguments, parts=parts)


def test_a_runtime_that_there_is_not_is_refused_before_anything_is_built(folder):
    process = here("system", "export", "dma_bench", "--runtime", "nope", cwd=folder)
    assert process.returncode == 2
    assert process.stderr.splitlines() == ["error: --runtime 'nope': there are native, python"]


def test_a_folder_in_the_way(folder):
    (folder / "there.ssp").mkdir()
    refused(
        folder, "system", "export", "dma_bench", "--out", "there.ssp", parts=["there.ssp", "folder"]
    )


def test_what_was_unpacked_is_gone(folder, tmp_path_factory, monkeypatch):
    private = tmp_path_factory.mktemp("tmp")
    monkeypatch.setattr("tempfile.tempdir", str(private))
    done(folder, "check", "bench.ssp")
    assert list(private.iterdir()) == []
