"""Claims: libraries before an FMU are compiled for every platform, or it is told what they need."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from fmus.kit import UserError
from fmus.kit.build import toolchain
from orchestration.fmu import unpack
from orchestration.fmu.check.shared_library import read_library
from orchestration.fmu.wrapping import compiled
from tests.support.fmi3_fmus import build


def test_without_a_compiler_it_says_what_is_needed(monkeypatch, scratch, tmp_path):
    def none_here(target: str) -> None:
        raise UserError("no C compiler")

    monkeypatch.setattr(toolchain, "find_compiler", none_here)
    with pytest.raises(UserError, match=r"FMI 3\.0 needs a C compiler here: no C compiler"):
        unpack(build("lag", tmp_path))
    assert list(scratch.iterdir()) == []


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("platform", sorted(toolchain.ZIG_TARGETS))
@pytest.mark.parametrize(
    ("source", "versions", "functions"),
    [
        ("all.c", (2, 3), {"fmi2DoStep", "fmi2NewDiscreteStates"}),
        ("solver.c", (2,), {"fmi2DoStep"}),
        ("calls2.c", (2,), {"fmi2DoStep", "fmi2NewDiscreteStates"}),
        ("calls3.c", (3,), {"fmi3DoStep", "fmi3UpdateDiscreteStates"}),
    ],
)
def test_libraries_are_compiled_for_every_platform(platform, source, versions, functions):
    """On Windows they take other functions of the system."""
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip("only zig compiles for every platform")
    headers = [toolchain.fmi_headers(version) for version in versions]
    libraries = compiled.LIBRARIES.get(platform, ())
    sources = [Path(compiled.__file__).parent / source]
    built = toolchain.compile_library(sources, headers, platform, libraries=libraries)
    assert functions <= read_library(built).exports
