"""Claims: ``ppy build`` makes FMUs, the same ones again, and only those that are asked for."""

from pathlib import Path

import pytest

from fmus.kit.build.toolchain import host_platform
from tests.support.command import here, works


def test_build_then_check_then_simulate_the_file(tmp_path):
    """One component, both builds, for this machine."""
    printed = works(
        "build", "ppy_actuator", "--platforms", host_platform(), "--out", "made", cwd=tmp_path
    )
    paths = [Path("made") / runtime / "ppy_actuator.fmu" for runtime in ("python", "native")]
    assert [Path(line) for line in printed.split()] == paths
    assert sorted(p for p in (tmp_path / "made").rglob("*") if p.is_file()) == sorted(
        tmp_path / p for p in paths
    )
    for path in paths:
        text = works("check", path, cwd=tmp_path)
        assert f"{path}: no errors" in text
    again = works(
        "build", "ppy_actuator", "--platforms", host_platform(), "--out", "again", cwd=tmp_path
    )
    for line in again.split():
        assert (tmp_path / line).read_bytes() == (
            tmp_path / line.replace("again", "made", 1)
        ).read_bytes()
    works(
        "simulate", paths[1], "--set", "current=0.5", "--stop", 2, "--out", "run.csv", cwd=tmp_path
    )
    assert (tmp_path / "run.csv").exists()


def test_build_runtime_builds_only_that(tmp_path):
    printed = works(
        "build",
        "ppy_actuator_length_driven",
        "--runtime",
        "native",
        "--platforms",
        host_platform(),
        cwd=tmp_path,
    )
    assert Path(printed.strip()) == Path("fmu/native/ppy_actuator_length_driven.fmu")


def test_build_runtime_pythonfmu_says_what_it_cannot_promise(tmp_path):
    pytest.importorskip("pythonfmu", reason="pythonfmu is not installed")
    done = here(
        "build", "galvanostat", "--runtime", "pythonfmu", "--platforms", "linux64", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert [Path(line) for line in done.stdout.split()] == [Path("fmu/pythonfmu/galvanostat.fmu")]
    assert (
        "noted: pythonfmu promises less: errors: whatever fails is Fatal, not Error" in done.stderr
    )


def platforms_of(path):
    from orchestration.fmu.archive import Archive

    with Archive(path) as archive:
        return archive.platforms


def test_build_is_for_this_machine_unless_others_are_asked(tmp_path):
    done = here("build", "galvanostat", "--runtime", "native", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"galvanostat: native for {host_platform()}" in done.stderr
    assert platforms_of(tmp_path / "fmu/native/galvanostat.fmu") == [host_platform()]


def test_build_for_some_platforms_and_for_all(tmp_path, monkeypatch):
    from fmus.kit import build as kit

    asked = []
    monkeypatch.setattr(
        kit, "build", lambda cls, kind, platforms, *others: asked.append(platforms) or b""
    )
    for given in (["--platforms", "linux64, win64"], ["--platforms", "all"], []):
        assert (
            here("build", "galvanostat", "--runtime", "native", *given, cwd=tmp_path).returncode
            == 0
        )
    assert asked == [["linux64", "win64"], None, [host_platform()]]


def test_of_all_platforms_one_that_fails_is_named_and_the_rest_is_written(tmp_path, monkeypatch):
    from fmus.kit import UserError
    from fmus.kit.build import toolchain

    def compile_library(sources, include, target, *, libraries=()):
        if target == "win64":
            raise UserError("zig failed for win64: not done after 1800 s, and ended")
        return b"library"

    monkeypatch.setenv("PPY_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(toolchain, "compile_library", compile_library)
    done = here("build", "galvanostat", "--runtime", "native", "--platforms", "all", cwd=tmp_path)
    path = Path("fmu/native/galvanostat.fmu")
    assert done.returncode == 1
    assert done.stdout.split() == [str(path)]
    assert f"noted: {path} is without win64: zig failed for win64: not done after" in done.stderr
    assert platforms_of(tmp_path / path) == ["aarch64-linux", "darwin64", "linux64"]


def test_fmi_3_is_built_beside_and_checked(tmp_path):
    options = ("--fmi", 3, "--platforms", host_platform())
    path = Path("fmu/fmi3/pid.fmu")
    assert Path(works("build", "pid", *options, cwd=tmp_path).strip()) == path
    assert "no errors" in works("check", path, cwd=tmp_path)


@pytest.mark.parametrize("given", ["4", "three", "3.5"])
def test_a_version_that_there_is_not_is_refused_in_a_line(given, tmp_path):
    done = here("build", "pid", "--fmi", given, cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "internal" not in done.stderr
