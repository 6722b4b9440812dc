import io
import zipfile

import fmpy
import pytest

import fmus
from fmus.kit import UserError, build, stack
from fmus.kit.build import toolchain
from fmus.ppy_actuator.effects import EFFECTS
from tests.support.kit_samples import Divider
from tests.support.pace import slow_but


@pytest.mark.slow
@pytest.mark.parametrize("runtime", slow_but(build.RUNTIMES, "native"))
def test_builds_are_reproducible(runtime, tmp_path, monkeypatch):
    try:
        toolchain.find_compiler(toolchain.host_platform())
    except UserError as error:
        pytest.skip(str(error))
    cls = stack(fmus.component("ppy_actuator"), EFFECTS["quadratic_strain"])
    builds = []
    for cache in "ab":  # neither knows of the other
        monkeypatch.setenv("PPY_CACHE", str(tmp_path / cache))
        builds.append(build.build(cls, runtime, [toolchain.host_platform()]))
    assert builds[0] == builds[1]
    first = builds[0]
    cls.remark = "A remark"
    other = build.build(cls, runtime, [toolchain.host_platform()])
    guids = {fmpy.read_model_description(io.BytesIO(b)).guid for b in (first, other)}
    assert len(guids) == 2


@pytest.mark.parametrize("runtime", build.RUNTIMES)
def test_windows_headers_agree_with_our_names(runtime):
    """A build for Linux alone would not show a clash with <windows.h>."""
    pytest.importorskip("ziglang")
    made = build.build(fmus.component("galvanostat"), runtime, ["win64"])
    with zipfile.ZipFile(io.BytesIO(made)) as archive:
        assert archive.read("binaries/win64/galvanostat.dll").startswith(b"MZ")


@pytest.fixture
def compiled_but_for(monkeypatch, tmp_path):
    """Compilers that make nothing of note, and fail for some platforms."""

    def fail_for(*platforms):
        def compile_library(sources, include, target, *, libraries=()):
            if target in platforms:
                raise UserError(f"zig failed for {target}: error: no room")
            return target.encode()

        monkeypatch.setenv("PPY_CACHE", str(tmp_path / "cache"))
        monkeypatch.setattr(toolchain, "compile_library", compile_library)

    return fail_for


def test_a_platform_that_fails_is_told_and_the_others_are_kept(compiled_but_for):
    compiled_but_for("win64")
    failures = {}
    wanted = ["linux64", "win64", "darwin64"]
    cls = fmus.component("galvanostat")
    contents = build.build(cls, "native", wanted, failed=failures.__setitem__)
    assert {name: str(error) for name, error in failures.items()} == {
        "win64": "zig failed for win64: error: no room"
    }
    with zipfile.ZipFile(io.BytesIO(contents)) as archive:
        made = {name for name in archive.namelist() if name.startswith("binaries/")}
    assert made == {"binaries/linux64/galvanostat.so", "binaries/darwin64/galvanostat.dylib"}
    with pytest.raises(UserError, match="zig failed for win64: error: no room"):
        build.build(cls, "native", wanted)


def test_where_every_platform_fails_nothing_is_made(compiled_but_for):
    compiled_but_for("linux64", "win64")
    told = []
    with pytest.raises(UserError, match="zig failed for win64"):
        build.build(
            fmus.component("galvanostat"),
            "native",
            ["linux64", "win64"],
            failed=lambda platform, error: told.append(platform),
        )
    assert told == ["linux64"]


@pytest.mark.parametrize(
    ("name", "arguments", "told"),
    [
        ("pid", ("java",), "unknown runtime 'java'; there are: python, native, pythonfmu"),
        ("pid", ("native", None, 1), "unknown version 1 of FMI"),
        ("pid", ("pythonfmu", None, 3), "pid: the build of pythonfmu is of FMI 2.0, not 3.0"),
        ("pid", ("native", ["plan9"]), "unknown platform 'plan9'"),
    ],
)
def test_what_cannot_be_built_is_refused_before_anything_is_made(
    name, arguments, told, monkeypatch
):
    def made(*_):
        raise AssertionError("made")

    monkeypatch.setattr("fmus.kit.build.building.plan_build", made)
    with pytest.raises(UserError, match=told):
        build.check_build(fmus.component(name), *arguments)
    build.check_build(fmus.component("pid"), "native", [toolchain.host_platform()], 3)


def test_unknown_runtime_is_refused():
    with pytest.raises(UserError, match="unknown runtime 'java'; there are: python, native"):
        build.build(fmus.component("ppy_actuator"), "java")


@pytest.mark.parametrize(
    ("name", "runtime", "version", "message"),
    [
        ("pid", "native", 4, "unknown version 4 of FMI; there are: 2, 3"),
        ("pid", "pythonfmu", 3, "pid: the build of pythonfmu is of FMI 2.0, not 3.0"),
    ],
)
def test_a_version_that_cannot_be_built_is_refused(name, runtime, version, message):
    with pytest.raises(UserError, match=message):
        build.build(fmus.component(name), runtime, fmi=version)


def test_platforms_of_fmi_3_are_named_after_their_architecture():
    packed = build.build(fmus.component("pid"), "native", ["linux64"], fmi=3)
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        names = set(archive.namelist())
    assert "binaries/x86_64-linux/pid.so" in names
    assert {"sources/buildDescription.xml", "terminalsAndIcons/terminalsAndIcons.xml"} <= names


@pytest.mark.parametrize("cls", [fmus.component("pid"), Divider])
def test_an_icon_that_is_declared_is_there(cls):
    files = build.plan_build(cls, "native", 3).files
    declared = files.get("terminalsAndIcons/terminalsAndIcons.xml", b"")
    assert (b"<Icon" in declared) == ("terminalsAndIcons/icon.png" in files) == (cls is not Divider)
