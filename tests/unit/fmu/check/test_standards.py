"""Claims: the functions asked of a binary are those of the headers; a folder names its platform."""

from __future__ import annotations

import re

import pytest

from orchestration.fmu.check.standards import STANDARDS
from tests.support import hosts


@pytest.mark.parametrize(("version", "count"), [(2, 34), (3, 62)])
def test_required_functions_are_those_of_the_headers(version, count):
    """For co-simulation there are as many as chapters 2.1 and 4.2 of the standards have."""
    header = (hosts.HEADERS / f"fmi{version}Functions.h").read_text(encoding="utf-8")
    declared = set(
        re.findall(rf"^#define (fmi{version}\w+)\s+fmi{version}FullName\(", header, re.M)
    )
    standard = STANDARDS[version]
    required = {name: standard.required_functions(name) for name in standard.functions}
    assert set.union(*required.values()) == declared
    assert len(required["CoSimulation"]) == count


@pytest.mark.parametrize(
    ("version", "folder", "platform"),
    [
        (2, "linux64", ("ELF", "x86_64", ".so")),
        (2, "aarch64-linux", ("ELF", "arm64", ".so")),
        (2, "x86_64-linux", None),
        (3, "linux64", None),
        (3, "x86_64-linux", ("ELF", "x86_64", ".so")),
        (3, "x86_64-windows", ("PE", "x86_64", ".dll")),
        (3, "aarch64-darwin", ("Mach-O", "arm64", ".dylib")),
        (3, "aarch64-linux-gnu", ("ELF", "arm64", ".so")),
        (3, "riscv64-linux", ("ELF", "", ".so")),
        (3, "vax-vms", None),
    ],
)
def test_a_folder_names_its_platform(version, folder, platform):
    assert STANDARDS[version].platform(folder) == platform
