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


def test_an_fmu_that_was_built_from_a_component_is_built_again(tmp_path):
    only = ("--runtime", "native", "--platforms", host_platform())
    works("build", "galvanostat", *only, "--out", "made", cwd=tmp_path)
    works("build", "made/native/galvanostat.fmu", *only, "--out", "again", cwd=tmp_path)
    made, again = (tmp_path / f"{at}/native/galvanostat.fmu" for at in ("made", "again"))
    assert made.read_bytes() == again.read_bytes()


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
    assert "noted: pythonfmu promises less: errors: every error is Fatal, not Error" in done.stderr


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
        kit, "build", lambda cls, kind, platforms, *others, **more: asked.append(platforms) or b""
    )
    for text in ("linux64, win64", "all", "all,linux64", None):
        given = [] if text is None else ["--platforms", text]
        assert (
            here("build", "galvanostat", "--runtime", "native", *given, cwd=tmp_path).returncode
            == 0
        )
    assert asked == [["linux64", "win64"], None, None, [host_platform()]]


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
    paths = {"fmu/fmi3/pid.fmu", "fmu/fmi3-python/pid.fmu"}
    assert set(works("build", "pid", *options, cwd=tmp_path).split()) == paths
    for path in paths:
        assert "no errors" in works("check", path, cwd=tmp_path)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("pid --fmi 3 --runtime pythonfmu", "pid: the build of pythonfmu is of FMI 2.0, not 3.0"),
        ("pid --fmi 4", "unknown version 4 of FMI; there are: 2, 3"),
        ("pid --clocks", "pid: FMI 2.0 has no clocks; build FMI 3.0"),
        ("pid --clocks --runtime pythonfmu", "pid: FMI 2.0 has no clocks; build FMI 3.0"),
        ("pid rig_proxy --runtime pythonfmu", "rig_proxy asks something outside of it"),
        ("pid --runtime pythonfmu --platforms darwin64", "pythonfmu has no binary for darwin64"),
        ("pid --platforms linux32", "--platforms linux32: there are linux64, win64, "),
        ("pid --platforms all,linux32", "--platforms linux32: there are linux64, win64, "),
        ("pid --platforms ", "--platforms '': there are linux64, win64, "),
        ("--set kp=1", "--with and --set are about one model; name it"),
    ],
)
def test_a_refusal_comes_first_and_alone(given, told, tmp_path):
    if "pythonfmu" in given:
        pytest.importorskip("pythonfmu", reason="pythonfmu is not installed")
    done = here("build", *given.split(" "), cwd=tmp_path)
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"error: {told}")
    assert (done.returncode, done.stdout) == (2, "")
    assert list(tmp_path.iterdir()) == []


def test_without_a_compiler_for_a_platform_nothing_is_begun(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    other = "darwin64" if host_platform() != "darwin64" else "linux64"
    done = here("build", "pid", "--platforms", f"{host_platform()},{other}", cwd=tmp_path)
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"error: no C compiler for {other} on this machine")


@pytest.mark.parametrize("given", ["4", "three", "3.5"])
def test_a_version_that_there_is_not_is_refused_in_a_line(given, tmp_path):
    done = here("build", "pid", "--fmi", given, cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "internal" not in done.stderr
