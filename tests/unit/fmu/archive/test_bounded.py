"""Claims: an archive or XML that would take memory or time without bound is refused in a line,
before it does.
"""

from __future__ import annotations

import resource
import stat
import subprocess
import sys
import zipfile

import pytest

from fmus.kit import UserError
from orchestration.fmu.archive import Archive, bounded
from orchestration.fmu.check import check_fmu

HEAD = '<?xml version="1.0"?>'
DESCRIPTION = (
    '<fmiModelDescription fmiVersion="2.0" modelName="m"'
    ' guid="{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}">%s<CoSimulation'
    ' modelIdentifier="m"/><ModelVariables/><ModelStructure/></fmiModelDescription>'
)
MEGABYTE = b"\0" * 2**20
MEMORY = 2**30  # bytes that nothing of this may take


def fmu(folder, description=DESCRIPTION % "", more=()):
    path = folder / "m.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", HEAD + description)
        for name, contents in more:
            archive.writestr(name, contents)
    return path


def grown(archive_path, name, megabytes):
    """Append a file of zeros, of which a thousandth is in the archive."""
    with (
        zipfile.ZipFile(archive_path, "a", zipfile.ZIP_DEFLATED) as archive,
        archive.open(name, "w") as file,
    ):
        for _ in range(megabytes):
            file.write(MEGABYTE)


NESTED = DESCRIPTION % ("<a>" * 200 + "</a>" * 200)
BOMB = (
    '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>'
    + DESCRIPTION % "&b;"
)


@pytest.mark.parametrize(
    ("description", "said"),
    [
        (NESTED, "modelDescription.xml nests elements more than 100 deep"),
        (BOMB, "modelDescription.xml has a document type declaration; it is not read"),
        pytest.param(
            DESCRIPTION % ("<a/>" * 1_000_001),
            "modelDescription.xml has more than 1,000,000 elements",
            marks=pytest.mark.slow,
        ),
        (DESCRIPTION % (" " * 2**26), "modelDescription.xml has 67109"),
        (DESCRIPTION % "<", "modelDescription.xml cannot be read"),
    ],
    ids=["deep", "entities", "many", "long", "broken"],
)
def test_xml_without_bound_is_refused(tmp_path, description, said):
    path = fmu(tmp_path, description)
    with pytest.raises(UserError) as caught:
        Archive(path)
    assert str(caught.value).startswith(f"{path}: {said}")
    assert "\n" not in str(caught.value)


def test_many_entries_are_refused(tmp_path):
    path = fmu(tmp_path, more=[(f"resources/{k}", b"") for k in range(bounded.ENTRIES)])
    with pytest.raises(UserError, match=r"has 20,001 entries; at most 20,000 are read"):
        check_fmu(path)


@pytest.mark.slow
def test_what_unpacks_to_more_than_a_gigabyte_is_refused(tmp_path):
    path = fmu(tmp_path)
    grown(path, "resources/zeros", 1025)
    assert path.stat().st_size < 2**21
    with pytest.raises(
        UserError, match=r"unpacks to 1\.07e\+09 bytes; at most 1\.07e\+09 are unpacked"
    ):
        check_fmu(path)


@pytest.mark.slow
def test_what_is_below_the_bounds_takes_little_memory(tmp_path):
    """Close to a gigabyte of zeros, and a description of half a million elements."""
    path = fmu(tmp_path, DESCRIPTION % ("<a/>" * 500_000))
    grown(path, "resources/zeros", 900)
    program = (
        "import resource, sys; from pathlib import Path; from orchestration.fmu.check import"
        f" check_fmu;resource.setrlimit(resource.RLIMIT_AS, ({MEMORY},) *"
        " 2);print(len(check_fmu(Path(sys.argv[1]))) > 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(path)], capture_output=True, text=True, timeout=100
    )
    assert (done.stdout, done.returncode) == ("True\n", 0), done.stderr[-500:]
    assert resource.RLIMIT_AS  # of a platform that has it


@pytest.mark.parametrize(
    ("mode", "said"),
    [(stat.S_IFLNK | 0o777, "is a symbolic link"), (stat.S_IFREG | stat.S_ISUID | 0o755, "setuid")],
)
def test_links_and_rights_of_others_are_findings(tmp_path, mode, said):
    path, entry = fmu(tmp_path), zipfile.ZipInfo("resources/odd")
    entry.external_attr = mode << 16
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(entry, b"/etc/passwd")
    found = [str(finding) for finding in check_fmu(path)]
    assert any(said in text and "resources/odd" in text for text in found), found
