import importlib.util
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from fmus.kit import UserError, build
from fmus.kit.build import toolchain
from fmus.kit.build.toolchain import cached_library, compile_library, find_compiler
from tests.support.kit_samples import Divider

HERE = toolchain.host_platform()
zig = pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="zig is not installed")
SOURCE = '__attribute__((visibility("default"))) double answer(void) { return 42.0; }\n'


@pytest.fixture
def no_compiler(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.delenv("CC", raising=False)


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "answer.c"
    path.write_text(SOURCE)
    return path


@pytest.mark.usefixtures("no_compiler")
@pytest.mark.parametrize("target", toolchain.ZIG_TARGETS)
def test_without_a_compiler_the_message_says_what_to_install(target):
    with pytest.raises(
        UserError, match=f"^no C compiler for {target} on this machine; pip install "
    ) as caught:
        find_compiler(target)
    assert "ppy-rig[native]" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("no_compiler")
def test_a_build_without_a_compiler_says_it_too():
    with pytest.raises(UserError, match=r'pip install "ppy-rig\[native\]"'):
        build.build(Divider, "native")


def test_unknown_platforms_are_refused():
    with pytest.raises(
        UserError,
        match=(
            "unknown platform 'linux32'; FMI platforms built here: linux64, win64, darwin64,"
            " aarch64-linux"
        ),
    ):
        find_compiler("linux32")


@pytest.mark.skipif(HERE == "win64", reason="zig only")
def test_the_system_compiler_serves_this_platform_only(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(
        shutil, "which", lambda name: f"/usr/bin/{name}" if name in ("clang", "my-cc") else None
    )
    monkeypatch.delenv("CC", raising=False)
    assert find_compiler(HERE).label == "clang"
    monkeypatch.setenv("CC", "my-cc")
    assert find_compiler(HERE).command == (str(Path("/usr/bin/my-cc")),)
    assert find_compiler(HERE).targets == ()
    with pytest.raises(UserError, match="no C compiler for win64"):
        find_compiler("win64")
    assert build.available_platforms() == [HERE]


@zig
def test_zig_serves_every_platform():
    assert build.available_platforms() == ["linux64", "win64", "darwin64", "aarch64-linux"]
    assert find_compiler("darwin64").label == "zig"


def test_a_failing_compilation_is_told_in_one_line(tmp_path):
    try:
        label = find_compiler(HERE).label
    except UserError as error:
        pytest.skip(str(error))
    broken = tmp_path / "broken.c"
    broken.write_text("int f(void) {\n    return undeclared_name;\n}\n")
    with pytest.raises(
        UserError, match=f"^{label} failed for .*broken.c:2.*undeclared_name"
    ) as caught:
        compile_library([broken], [], HERE)
    assert "\n" not in str(caught.value)


def test_a_compiler_that_says_nothing_is_told_too(monkeypatch, source):
    silent = subprocess.CompletedProcess([], 1, stdout="", stderr="")
    monkeypatch.setattr(toolchain, "run_program", lambda *given: silent)
    monkeypatch.setattr(
        toolchain, "find_compiler", lambda target: toolchain.Compiler(("/usr/bin/cc",))
    )
    with pytest.raises(UserError, match=r"^cc failed for linux64: no message$"):
        compile_library([source], [], "linux64")


@pytest.mark.slow
@zig
@pytest.mark.parametrize(
    ("target", "magic"),
    [
        ("linux64", b"\x7fELF\x02\x01"),
        # on a new machine the compiler builds the libraries of the platform first
        pytest.param("win64", b"MZ", marks=pytest.mark.slow),
        ("aarch64-linux", b"\x7fELF\x02\x01"),
    ],
)
def test_libraries_have_the_format_of_their_platform(target, magic, source):
    library = compile_library([source], [], target, libraries=["m"])
    assert library.startswith(magic)
    assert b"answer" in library
    if target == "win64":
        (offset,) = struct.unpack_from("<I", library, 0x3C)
        assert library[offset : offset + 4] == b"PE\0\0"
        assert struct.unpack_from("<H", library, offset + 4) == (0x8664,)
    else:
        machine = {"linux64": 62, "aarch64-linux": 183}[target]  # EM_X86_64, EM_AARCH64
        assert struct.unpack_from("<H", library, 18) == (machine,)


def thin(processor, payload):
    """Make up a little-endian 64-bit Mach-O library."""
    return struct.pack("<IIIIIIII", 0xFEEDFACF, processor, 3, 6, 0, 0, 0, 0) + payload


def slices(universal):
    """Processor, subtype and contents of each part, read the way ``<mach-o/fat.h>`` says."""
    magic, count = struct.unpack_from(">II", universal)
    assert magic == 0xCAFEBABE
    found = []
    for i in range(count):
        processor, subtype, offset, size, alignment = struct.unpack_from(
            ">IIIII", universal, 8 + 20 * i
        )
        assert offset % (1 << alignment) == 0
        assert offset + size <= len(universal)
        found.append((processor, subtype, offset, universal[offset : offset + size]))
    starts = [offset for _, _, offset, _ in found]
    assert starts == sorted(starts)
    assert starts[0] >= 8 + 20 * count
    for (_, _, offset, part), following in zip(found, [*starts[1:], len(universal)], strict=True):
        assert offset + len(part) <= following
    return [(processor, subtype, part) for processor, subtype, _, part in found]


@pytest.mark.parametrize("sizes", [(0, 0), (10, 100_000), (16384 - 32, 1), (16384, 50_000)])
def test_universal_libraries_hold_their_parts(sizes):
    parts = [thin(0x01000007, b"x" * sizes[0]), thin(0x0100000C, b"y" * sizes[1])]
    assert slices(toolchain._universal(parts)) == [
        (0x01000007, 3, parts[0]),
        (0x0100000C, 3, parts[1]),
    ]


@pytest.mark.slow
@zig
def test_darwin_library_is_universal(source, tmp_path):
    library = compile_library([source], [], "darwin64")
    parts = slices(library)
    assert [processor for processor, _, _ in parts] == [0x01000007, 0x0100000C]
    for processor, subtype, part in parts:
        assert struct.unpack_from("<III", part) == (0xFEEDFACF, processor, subtype)
        assert struct.unpack_from("<I", part, 12) == (6,)  # MH_DYLIB
        assert b"_answer" in part
    path = tmp_path / "answer.dylib"
    path.write_bytes(library)
    if tool := shutil.which("file"):
        told = subprocess.run(
            [tool, "-b", str(path)], capture_output=True, text=True, check=True
        ).stdout
        assert "Mach-O universal binary with 2 architectures" in told
        assert "x86_64" in told
        assert "arm64" in told
    if tool := shutil.which("llvm-objdump"):
        told = subprocess.run(
            [tool, "--macho", "--universal-headers", str(path)],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        assert "nfat_arch 2" in told
        assert "x86_64" in told
        assert "arm64" in told


@pytest.mark.skipif(sys.platform == "win32", reason="the compiler is a shell script here")
def test_a_compiler_that_was_replaced_makes_other_libraries(tmp_path):
    told = []
    for number in (1, 2):
        compiler = tmp_path / str(number) / "cc"
        compiler.parent.mkdir()
        compiler.write_text(f"#!/bin/sh\necho compiler {number}.0\necho more\n", encoding="utf-8")
        compiler.chmod(0o755)
        told.append(toolchain.Compiler((str(compiler),)).version)
    assert told == [f"{tmp_path / str(n) / 'cc'}: compiler {n}.0" for n in (1, 2)]
    toolchain._printed_version.cache_clear()
    (tmp_path / "1" / "cc").write_text("#!/bin/sh\necho compiler 3.0\n", encoding="utf-8")
    assert toolchain.Compiler((str(tmp_path / "1" / "cc"),)).version.endswith("compiler 3.0")
    assert toolchain.Compiler(("/no/such/compiler",)).version == "/no/such/compiler"


def test_without_a_home_zig_has_its_cache_beside_ours(tmp_path, monkeypatch):
    monkeypatch.setenv("PPY_CACHE", str(tmp_path))
    monkeypatch.delenv("ZIG_GLOBAL_CACHE_DIR", raising=False)
    printing = (sys.executable, "-c", "import os; print(os.environ.get('ZIG_GLOBAL_CACHE_DIR'))")
    for home, place in ((tmp_path, None), (None, tmp_path / "zig")):
        monkeypatch.setattr(toolchain.cache, "users_folder", lambda home=home: home)
        assert toolchain.run_program(printing, 60.0).stdout.strip() == str(place)


def test_the_same_sources_are_compiled_once(tmp_path, monkeypatch):
    """Another text, another file to compile, another library to link with makes another library."""
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
    paths = [cached_library(*arguments) for arguments in asked]
    assert len(set(paths)) == len(compiled) == len(asked)
    assert [cached_library(*arguments) for arguments in asked] == paths
    assert len(compiled) == len(asked)
    assert [path.read_bytes() for path in paths] == [str(done).encode() for done in compiled]
    monkeypatch.setattr(
        toolchain, "find_compiler", lambda target: toolchain.Compiler(("/usr/bin/other",))
    )
    assert cached_library(*asked[0]) not in paths
