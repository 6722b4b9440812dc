import io
import zipfile

import fmpy
import pytest

import fmus
from fmus.kit import UserError, build, stack
from fmus.kit.build import archive, toolchain
from fmus.kit.build.library_cache import library
from fmus.ppy_actuator.effects import EFFECTS
from tests.support.pace import slow_but


def test_archive_bytes_depend_on_contents_only():
    files = {
        "b.txt": b"2",
        "binaries/linux64/x.so": b"3",
        "modelDescription.xml": b"1",
        "a.txt": b"0",
    }
    packed = archive.pack(files)
    assert packed == archive.pack(dict(reversed(files.items())))
    assert packed != archive.pack(files | {"a.txt": b"1"})
    with zipfile.ZipFile(io.BytesIO(packed)) as read_back:
        assert read_back.testzip() is None
        assert read_back.namelist() == [
            "modelDescription.xml",
            "a.txt",
            "b.txt",
            "binaries/linux64/x.so",
        ]
        assert {name: read_back.read(name) for name in files} == files
        modes = {i.filename: i.external_attr >> 16 for i in read_back.infolist()}
    assert modes["binaries/linux64/x.so"] == 0o100755
    assert modes["a.txt"] == 0o100644


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


def test_the_same_sources_are_compiled_once(tmp_path, monkeypatch):
    """Another text, another file to compile, another library to link with: each is another library."""
    compiled = []

    def compiler(sources, include, target, *, libraries):
        compiled.append((sources[0].read_bytes(), libraries))
        return str(compiled[-1]).encode()

    monkeypatch.setenv("PPY_CACHE", str(tmp_path))
    monkeypatch.setattr(toolchain, "compile_library", compiler)
    monkeypatch.setattr(
        toolchain, "find_compiler", lambda target: toolchain.Compiler(("/usr/bin/cc",))
    )
    files = {"a.c": b"1", "b.c": b"2"}
    asked = [
        (files, "a.c", "linux64"),
        (files | {"b.c": b"3"}, "a.c", "linux64"),
        (files, "b.c", "linux64"),
    ]
    asked += [(files, "a.c", "win64"), (files, "a.c", "linux64", ("m",))]
    paths = [library(*arguments) for arguments in asked]
    assert len(set(paths)) == len(compiled) == len(asked)
    assert [library(*arguments) for arguments in asked] == paths
    assert len(compiled) == len(asked)
    assert [path.read_bytes() for path in paths] == [str(done).encode() for done in compiled]
    monkeypatch.setattr(
        toolchain, "find_compiler", lambda target: toolchain.Compiler(("/usr/bin/other",))
    )
    assert library(*asked[0]) not in paths


def test_unknown_runtime_is_refused():
    with pytest.raises(UserError, match="unknown runtime 'java'; there are: python, native"):
        build.build(fmus.component("ppy_actuator"), "java")
