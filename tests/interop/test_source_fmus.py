"""Sources of the native build in another program: without a warning, with any headers of FMI 2.0,
two at once.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest

from fmus import MODELS, component
from fmus.kit.build.building import plan_build
from tests.support import hosts
from tests.support.pace import slow_but

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiled and linked as on Linux")

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
PAIRS = (("ppy_actuator", "foot"), ("galvanostat", "voice_coil_dma"))
STEPS = 200
STEP = 1.0 / 64.0  # a binary fraction: communication points are the same numbers for every host


@pytest.fixture
def sources(fmu, tmp_path) -> Callable[[str], Path]:
    """Folder of the sources of a component."""

    def unzipped(name: str) -> Path:
        folder = tmp_path / name
        with zipfile.ZipFile(fmu(name, "native")) as archive:
            archive.extractall(
                folder, [member for member in archive.namelist() if member.startswith("sources/")]
            )
        return folder / "sources"

    return unzipped


COMPILERS = ("gcc", "clang")


@pytest.fixture
def compiler(which: str) -> str:
    """One of the compilers; skips where there is none."""
    if shutil.which(which) is None:
        pytest.skip(f"{which} is not installed")
    return which


def compiled(compiler: str, folder: Path, *options: str, level: str = "-O2") -> Path:
    """Object file of the one unit that the model description lists."""
    command = [
        compiler,
        *STRICT,
        *options,
        level,
        "-ffp-contract=off",
        "-c",
        "all.c",
        "-o",
        "all.o",
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return folder / "all.o"


def defined(object_file: Path) -> set[str]:
    """Names that an object file offers to others."""
    if shutil.which("nm") is None:
        pytest.skip("nm is not installed")
    command = ["nm", "--defined-only", "--extern-only", "--format=posix", str(object_file)]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return {line.split()[0] for line in listed.splitlines()}


def of_the_standard(folder: Path) -> set[str]:
    """Functions of FMI 2.0 by the names of the standard header; a proxy has none of model
    exchange.
    """
    text = (folder / "fmi2Functions.h").read_text()
    common, _, rest = text[text.index("#define fmi2GetTypesPlatform") :].partition(
        "FMI2 for Model Exchange"
    )
    if not (folder / "laws.c").exists():
        rest = rest.partition("for Co-Simulation")[2]
    return set(re.findall(r"^#define (fmi2\w+)\s+fmi2FullName", common + rest, re.M))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("which", "name"),
    slow_but(
        [(which, name) for which in COMPILERS for name in MODELS],
        *((which, name) for which in COMPILERS for name in ("voice_coil_dma", "rig_proxy")),
        ("gcc", "foot_dynamic"),
    ),
)
def test_sources_compile_without_a_warning_and_offer_fmi_alone(sources, name, compiler):
    folder = sources(name)
    functions = of_the_standard(folder)
    assert {"fmi2Instantiate", "fmi2DoStep", "fmi2GetStringStatus"} <= functions
    assert ("fmi2NewDiscreteStates" in functions) == (folder / "laws.c").exists()
    assert defined(compiled(compiler, folder)) == functions
    prefixed = compiled(compiler, folder, f"-DFMI2_FUNCTION_PREFIX={name}_", level="-O0")
    assert defined(prefixed) == {f"{name}_{function}" for function in functions}


@pytest.mark.slow
@pytest.mark.parametrize("which", COMPILERS)
@pytest.mark.parametrize("name", slow_but(MODELS, "voice_coil_dma", "rig_proxy"))
def test_each_build_of_fmi_3_offers_all_functions(tmp_path, name, runtime, compiler):
    for file, text in plan_build(component(name), runtime, 3).sources.items():
        (tmp_path / file).write_bytes(text)
    header = (tmp_path / "fmi3Functions.h").read_text()
    functions = set(re.findall(r"^#define (fmi3\w+)\s+fmi3FullName", header, re.M))
    assert {"fmi3DoStep", "fmi3GetEventIndicators", "fmi3EnterStepMode"} <= functions
    assert defined(compiled(compiler, tmp_path)) == functions


def test_headers_are_those_of_the_standard(sources):
    """Apart from the changes that fmpy's comments name."""
    folder = sources("foot")
    for header in HEADERS[1:]:
        assert (folder / header).read_text().split() == (
            hosts.HEADERS / header
        ).read_text().split(), header
    ours, theirs = ((where / HEADERS[0]).read_text() for where in (folder, hosts.HEADERS))
    (changed,) = re.findall(r"/\*\s+Export FMI2 API.*?(?=/\*+\nCommon Functions)", theirs, re.S)
    assert "has been changed" in changed
    before, _, after = theirs.partition(changed)
    assert ours.split()[: len(before.split())] == before.split()
    assert ours.split()[-len(after.split()) :] == after.split()
    assert "has been changed" not in ours


@pytest.mark.parametrize("which", COMPILERS)
def test_headers_of_the_first_edition_do_as_well(sources, compiler):
    # FMI 2.0 of 2014 had constant fields in fmi2CallbackFunctions; nothing may be assigned to one
    folder = sources("foot")
    header = folder / "fmi2FunctionTypes.h"
    text = header.read_text()
    fields = re.compile(
        r"^(  "
        r" )(fmi2\w+\s+(?:logger|allocateMemory|freeMemory|stepFinished|componentEnvironment);)$",
        re.M,
    )
    assert len(fields.findall(text)) == 5
    header.write_text(fields.sub(r"\1const \2", text))
    compiled(compiler, folder, level="-O0")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("which", "pair"),
    slow_but(
        [(which, pair) for which in COMPILERS for pair in PAIRS],
        *zip(COMPILERS, PAIRS, strict=True),
    ),
    ids=lambda value: value if isinstance(value, str) else "+".join(value),
)
def test_two_fmus_in_one_program_give_the_numbers_of_their_shared_libraries(
    fmu, sources, tmp_path, compiler, pair
):
    arguments, expected = [], []
    objects = [
        str(compiled(compiler, sources(name), f"-DFMI2_FUNCTION_PREFIX={name}_")) for name in pair
    ]
    for name in pair:
        description = fmpy.read_model_description(str(fmu(name, "native")), validate=False)
        real = [v for v in description.modelVariables if v.type == "Real"]
        inputs, outputs = ([v for v in real if v.causality == kind] for kind in ("input", "output"))
        arguments.append(description.guid)
        arguments += [
            ",".join(str(v.valueReference) for v in variables) for variables in (inputs, outputs)
        ]
        held = 0.001 * (np.arange(STEPS + 1) % 7)
        names = [v.name for v in outputs]
        series = hosts.run_fmpy(
            fmu(name, "native"),
            STEP * np.arange(STEPS + 1),
            {v.name: held for v in inputs},
            names,
            feedthrough=False,
            stop_time_defined=False,
        )
        expected += [series[name][1:] for name in names]
    program = tmp_path / "linked"
    command = [
        compiler,
        "-std=c99",
        f"-DFIRST={pair[0]}_",
        f"-DSECOND={pair[1]}_",
        f"-I{tmp_path / pair[0] / 'sources'}",
    ]
    command += [str(hosts.TESTS / "c" / "linked_host.c"), *objects, "-o", str(program), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    done = subprocess.run(
        [program, str(STEPS), *arguments], check=True, capture_output=True, text=True
    )
    found = np.array([line.split() for line in done.stdout.splitlines()], dtype=float).T
    assert np.ptp(found, axis=1).max() > 0.0
    assert np.array_equal(found, np.array(expected))
