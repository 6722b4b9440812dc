"""Claims: no order of calls and no argument makes an FMU of FMI 3.0 crash, go beyond an array, leak
or refuse without a message; many instances live side by side.

By a program in C that the FMU is linked with, both under the sanitizers of addresses and of
undefined behaviour.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

import fmus
from fmus.kit.build.building import plan_build
from tests.support import hosts
from tests.support.kit_samples import Wall
from tests.support.pace import slow_but

DRIVER = Path(__file__).parents[1] / "support" / "c" / "random_calls_fmi3.c"
SANITIZED = (
    "-g",
    "-O1",
    "-std=c11",
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
)
# one with samples and integers, one with continuous states, one with arrays
FAST = ("galvanostat", "ppy_actuator", "degradation_estimator")
CLASSES = {"wall": Wall} | {name: fmus.component(name) for name in fmus.COMPONENTS}

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc brings the sanitizers")


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """Compile the driver with a component; return the program, the token and the resources."""

    @cache
    def compiled(name, runtime, *flags):
        folder = tmp_path_factory.mktemp(name)
        planned = plan_build(CLASSES[name], runtime, 3)
        for file, text in (planned.sources | planned.files).items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_bytes(text)
        target = folder / "driver"
        command = ["gcc", *flags, f"-I{folder}", str(DRIVER), str(folder / "all.c")]
        subprocess.run([*command, "-lm", "-ldl", "-o", str(target)], check=True)
        return target, planned.guid, folder / "resources"

    return compiled


def output_of(runtime, *command):
    environment = os.environ | {"ASAN_OPTIONS": "detect_leaks=1"}
    if runtime == "python":  # which keeps memory until the end of the process
        environment |= {
            "ASAN_OPTIONS": "detect_leaks=0",
            "PPY_LIBPYTHON": hosts.python_library(),
        }
    run = subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        timeout=600,
        env=environment,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-3000:]
    return run.stdout


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", slow_but(CLASSES, *FAST))
def test_no_order_of_calls_and_no_argument_does_harm(program, name, runtime, seed):
    driver, token, resources = program(name, runtime, *SANITIZED)
    assert "errors" in output_of(runtime, driver, "calls", token, seed, 10_000, resources)


@pytest.mark.slow
@pytest.mark.parametrize("name", CLASSES)
def test_180000_calls(program, name):
    driver, token, _ = program(name, "native", *SANITIZED)
    assert "errors" in output_of("native", driver, "calls", token, 36, 180_000)


@pytest.mark.parametrize(("runtime", "count"), [("native", 10_000), ("python", 300)])
@pytest.mark.parametrize("name", slow_but(CLASSES, *FAST))
def test_many_instances_live_side_by_side(program, name, runtime, count):
    driver, token, resources = program(name, runtime, "-O1", "-std=c11")
    told = output_of(runtime, driver, "instances", token, count, resources)
    assert told.startswith(f"{count} instances")
