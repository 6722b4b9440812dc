"""With the stepping kernel and without it; and a bare loop in C, which both are held against."""

from __future__ import annotations

import ctypes
import functools
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from fmus.kit import UserError
from fmus.kit.build import toolchain
from orchestration.fmu.instance import Fmu
from orchestration.fmu.kernel import library
from orchestration.fmu.simulation import simulate_instance
from tests.support.hosts import (
    HEADERS,
    TESTS,
    compiler,
)


@contextmanager
def without_compiler() -> Iterator[None]:
    """On a machine on which nothing can be compiled."""

    def absent(target: str) -> toolchain.Compiler:
        raise UserError(f"no C compiler for {target} on this machine")

    forget_kernel()
    try:
        with patch.object(toolchain, "find_compiler", absent):
            yield
    finally:
        forget_kernel()


def forget_kernel() -> None:
    """Have the kernel compiled, or looked for, anew."""
    for kept in (library._kernel, library.load_stepper):
        kept.cache_clear()


@functools.cache
def _bare_loop() -> Any:
    with tempfile.TemporaryDirectory(prefix="bare_loop_") as folder:
        path = Path(folder, "bare_loop.so")
        command = [
            compiler(),
            "-std=c99",
            "-O2",
            "-ffp-contract=off",
            "-fPIC",
            "-shared",
            f"-I{HEADERS}",
        ]
        subprocess.run([*command, str(TESTS / "c" / "bare_loop.c"), "-o", str(path)], check=True)
        return ctypes.CDLL(str(path)).bare_loop


def bare_loop(
    fmu: Fmu, time: np.ndarray, name: str, values: np.ndarray, output: str
) -> Callable[[], np.ndarray]:
    """Prepare a bare loop with a started instance, one input fed and one output read at every
    point.
    """
    calls = [fmu.bound(f"fmi2{function}") for function in ("SetReal", "DoStep", "GetReal")]
    references = [ctypes.c_uint(fmu.variable(n).valueReference) for n in (name, output)]
    result = np.full(time.size, np.nan)
    arrays = [a.ctypes.data_as(ctypes.c_void_p) for a in (time, values, result)]
    functions = [ctypes.cast(call.func, ctypes.c_void_p) for call in calls]
    loop = _bare_loop()

    def go() -> np.ndarray:
        assert (
            loop(*functions, *calls[0].args, *references, ctypes.c_size_t(time.size), *arrays) == 0
        )
        return result

    return go


def in_a_bare_loop(
    path: Path, time: np.ndarray, name: str, values: np.ndarray, output: str
) -> np.ndarray:
    """Values of an output, with one input fed."""
    with Fmu(path) as fmu:
        fmu.start(float(time[0]))
        return bare_loop(fmu, time, name, values, output)()


def one_foreign_fmu(path: str) -> list[dict[str, list[float]]]:
    """An FMU of other people's making, with the kernel and without; for a process of its own."""
    from orchestration.fmu.simulation import simulate_instance

    time = 0.1 * np.arange(41)

    def go() -> dict[str, list[float]]:
        with Fmu(Path(path)) as fmu:
            fmu.start()
            found = simulate_instance(fmu, time, {"u": np.sin(time)}, ["x"])
        return {name: values.tolist() for name, values in found.items()}

    assert library.load_stepper() is not None
    found = [go()]
    with without_compiler():
        return [*found, go()]


TIME = np.concatenate([[0.0], np.cumsum(np.random.default_rng(1).uniform(1e-3, 0.2, 300))])
CURRENT, FORCE = 0.9 * np.sin(TIME), np.where(TIME % 3.0 < 1.0, 2.0, 0.0)


def simulated(path, time, inputs, outputs=None, parameters=None):
    """Results, or in what words it failed; how many warnings; progress."""
    told: list[int] = []
    with Fmu(path, parameters) as instance:
        instance.start(float(time[0]))
        try:
            found = simulate_instance(instance, time, inputs, outputs, told.append)
        except UserError as error:
            return str(error), instance.warnings, instance.corrupted, told
        return (
            {k: v.tobytes() for k, v in found.items()},
            instance.warnings,
            instance.corrupted,
            told,
        )


def both_ways(*arguments, parameters=None):
    """The same with the kernel and without."""
    assert library.load_stepper() is not None, "no kernel was compiled"
    found = simulated(*arguments, parameters=parameters)
    with without_compiler():
        assert library.load_stepper() is None
        return found, simulated(*arguments, parameters=parameters)
