"""Claims: no order of calls and no argument makes a packed system go beyond an array, overflow, or
lose memory, and every refusal has a message.

Its sources, as they are in the FMU, and the program that calls it are compiled with the sanitizers.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import zipfile

import fmpy
import pytest

from fmus.kit.build import toolchain
from fmus.kit.build.toolchain import host_platform
from orchestration import master
from tests.support.fmi3_fmus import FRAME, SANITIZED
from tests.support.packed import chain, circle, mixed


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc brings the sanitizers")
@pytest.mark.parametrize(
    "system", [lambda folder: chain(), lambda folder: circle(), mixed], ids=["laws", "loop", "fmus"]
)
def test_random_calls_do_no_harm(tmp_path, system):
    path = tmp_path / "packed.fmu"
    path.write_bytes(master.pack(system(tmp_path), [host_platform()]))
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    library, program = tmp_path / "packed.so", tmp_path / "random_calls"
    headers = f"-I{toolchain.fmi_headers(2)}"
    unit = tmp_path / "sources" / "all.c"
    shared = [
        "-fPIC",
        "-shared",
        "-fvisibility=hidden",
        str(unit),
        "-lm",
        "-ldl",
        "-o",
        str(library),
    ]
    subprocess.run(["gcc", *SANITIZED, headers, *shared], check=True)
    driver = [str(FRAME / "random_calls.c"), "-ldl", "-o", str(program)]
    subprocess.run(["gcc", *SANITIZED, headers, *driver], check=True)
    description = fmpy.read_model_description(str(path))
    count = len(description.modelVariables)
    resources = (tmp_path / "resources").as_uri()
    numbers = [str(count), "60000", "20261129"]
    run = subprocess.run(
        [str(program), str(library), description.guid, *numbers, resources],
        capture_output=True,
        text=True,
        timeout=300,
        env=os.environ | {"ASAN_OPTIONS": "detect_leaks=1"},
    )
    assert run.returncode == 0, run.stdout + run.stderr[-3000:]
    told = re.fullmatch(r"(\d+) refused, (\d+) complaints\n", run.stdout)
    assert told
    refused, complaints = map(int, told.groups())
    assert 1000 < refused <= complaints
