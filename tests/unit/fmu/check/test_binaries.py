"""Claims: the functions that a binary must export are those of the headers of FMI 2.0."""

from __future__ import annotations

import re

from tests.support import hosts


def test_required_functions_are_those_of_the_headers():
    from orchestration.fmu.check.binaries import _FUNCTIONS

    header = (hosts.HEADERS / "fmi2Functions.h").read_text(encoding="utf-8")
    declared = set(re.findall(r"^#define (fmi2\w+)\s+fmi2FullName\(", header, re.M))
    assert {f"fmi2{name}" for names in _FUNCTIONS.values() for name in names.split()} == declared
    assert (
        len(_FUNCTIONS["CoSimulation"].split()) == 34
    )  # as counted in FMI 2.0.4, chapters 2.1 and 4.2
