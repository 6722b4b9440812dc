"""Claims: the kernel is compiled once and found in the cache, and nobody needs it."""

from __future__ import annotations

from pathlib import Path

import pytest

from fmus.kit import UserError
from fmus.kit.build.building import toolchain
from orchestration.fmu.kernel import library
from tests.support.kernel import (
    CURRENT,
    TIME,
    forget_kernel,
    simulated,
)


def refused(*arguments, **options):
    raise UserError("zig failed")


@pytest.mark.parametrize("hindrance", ["compiler fails", "cache is a file", "no such platform"])
def test_what_hinders_compiling_hinders_nobody_from_simulating(
    fmu, tmp_path, monkeypatch, hindrance
):
    path = fmu("ppy_actuator", "native")
    expected = simulated(path, TIME, {"current": CURRENT})
    if hindrance == "no such platform":
        monkeypatch.setattr(toolchain, "host_platform", refused)
    else:
        Path(tmp_path, "file").touch()
        monkeypatch.setenv(
            "PPY_CACHE", str(tmp_path / "file" if hindrance == "cache is a file" else tmp_path)
        )
    if hindrance == "compiler fails":
        monkeypatch.setattr(toolchain, "compile_library", refused)
    forget_kernel()
    try:
        assert library.load_stepper() is None
        assert simulated(path, TIME, {"current": CURRENT}) == expected
    finally:
        forget_kernel()


def test_the_kernel_is_compiled_once_and_found_by_what_it_is_made_of(tmp_path, monkeypatch):
    monkeypatch.setenv("PPY_CACHE", str(tmp_path))
    for _ in range(2):
        forget_kernel()
        assert library.load_stepper() is not None
    assert len([path for path in tmp_path.iterdir() if path.suffix != ".sha256"]) == 1
    forget_kernel()
