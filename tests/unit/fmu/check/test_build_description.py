"""Claims: sources of FMI 3.0 that nobody can compile are found."""

from __future__ import annotations

import pytest

from orchestration.fmu.check import check_fmu
from tests.support.archive import contents
from tests.support.fmi3_fmus import foreign
from tests.support.fmu_faults import Change, check_that_fault_is_found, lines, packed

FILE = "sources/buildDescription.xml"
GOOD = (
    b'<fmiBuildDescription fmiVersion="3.0"><BuildConfiguration modelIdentifier="lag">'
    b'<SourceFileSet language="C99"><SourceFile name="lag.c"/></SourceFileSet>'
    b"</BuildConfiguration></fmiBuildDescription>"
)


def sources(description: bytes | None, *names: str) -> Change:
    def change(files: dict[str, bytes]) -> None:
        files |= {f"sources/{name}": b"int a;\n" for name in names}
        if description is not None:
            files[FILE] = description

    return change


FAULTS: dict[str, tuple[Change, str]] = {
    "none": (sources(None, "lag.c"), r"10 warning: there are sources/, but no sources/buildDescr"),
    "absent file": (sources(GOOD), r"10 error: .*: files listed but not in sources/: lag\.c"),
    "other model": (
        sources(GOOD.replace(b'"lag"', b'"gal"'), "lag.c"),
        r"10 error: sources/buildDescription\.xml: nothing builds lag",
    ),
    "schema": (
        sources(GOOD.replace(b"BuildConf", b"BuiltConf"), "lag.c"),
        r"1 error: .*BuiltConf",
    ),
    "damaged": (sources(GOOD[:50], "lag.c"), r"10 error: .*cannot be read: it is not well-formed"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_found(tmp_path, fault):
    check_that_fault_is_found(foreign("lag"), tmp_path, *FAULTS[fault])


def test_a_good_one_is_none(tmp_path):
    files = contents(foreign("lag"))
    sources(GOOD, "lag.c")(files)
    found = lines(check_fmu(packed(tmp_path, files)), "error", "warning")
    assert not [line for line in found if "sources" in line]
