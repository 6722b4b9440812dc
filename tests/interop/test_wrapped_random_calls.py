"""Claims: no order of calls and no argument makes the wrapper of FMUs of FMI 3.0 go beyond an
array, overflow, or lose memory, and every refusal has a message.

The wrapper, the FMU and the program that calls them are compiled with the sanitizers.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import fmpy
import pytest

from fmus.kit.build import toolchain
from orchestration.fmu import Archive, unpack
from orchestration.fmu.wrapping import wrapping
from tests.support.fmi3_fmus import FRAME, SANITIZED, compile_model, foreign
from tests.support.pace import slow_but

MODELS = ("types", "arrays", "sawtooth", "lag", "clocked")
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc brings the sanitizers")


@pytest.fixture(scope="module")
def program(tmp_path_factory) -> Path:
    target: Path = tmp_path_factory.mktemp("driver") / "random_calls"
    headers = toolchain.fmi_headers(2)
    source = FRAME / "random_calls.c"
    command = ["gcc", *SANITIZED, f"-I{headers}", str(source), "-ldl", "-o", str(target)]
    subprocess.run(command, check=True)
    return target


def sanitized(name: str) -> Path:
    """An unpacked model whose library and wrapper are compiled with the sanitizers."""
    folder = Path(unpack(foreign(name)))
    library = f"{name}{fmpy.sharedLibraryExtension}"
    compile_model(name, folder / "binaries" / fmpy.platform_tuple / library, *SANITIZED)
    wrapper = folder / "binaries" / fmpy.platform / library
    command = ["gcc", *SANITIZED, "-fPIC", "-shared", "-fvisibility=hidden"]
    command += [f"-I{toolchain.fmi_headers(version)}" for version in (2, 3)]
    unit = Path(wrapping.__file__).parent / "all.c"
    subprocess.run([*command, str(unit), "-ldl", "-o", str(wrapper)], check=True)
    return wrapper


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(MODELS, "types", "arrays"))
def test_random_calls_do_no_harm(program, name):
    wrapper = sanitized(name)
    try:
        with Archive(foreign(name)) as archive:
            count = len(archive.as_fmi2.findall("ModelVariables/ScalarVariable"))
        command = [program, wrapper, name, count, 60_000, 20261126]
        run = subprocess.run(
            [str(part) for part in command],
            capture_output=True,
            text=True,
            timeout=300,
            env=os.environ | {"ASAN_OPTIONS": "detect_leaks=1"},
        )
    finally:
        shutil.rmtree(wrapper.parents[2])
    assert run.returncode == 0, run.stdout + run.stderr[-3000:]
    told = re.fullmatch(r"(\d+) refused, (\d+) complaints\n", run.stdout)
    assert told
    refused, complaints = map(int, told.groups())
    assert 1000 < refused <= complaints
