"""One FMU, step by step: by hosts, by the stepping kernel, isolated, and by version of FMI."""

from __future__ import annotations

import shutil
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import fmpy
import numpy as np

import orchestration as ppy
from fmus import component
from fmus.kit import build
from fmus.kit.arrays import Array
from fmus.kit.build import toolchain
from orchestration.fmu import Fmu, RepeatedRuns
from orchestration.fmu import stepping as python_loop
from orchestration.fmu.kernel import one_fmu
from orchestration.fmu.simulation import FmuSource
from orchestration.fmu.stepping import plan_course
from tests.support import fmi3_fmus, hosts
from tests.support.kernel import bare_loop

from .tables import Table
from .timing import Duration, Times, comparison, in_a_process, take_turns, timed

EMPTY = "empty C FMU (the floor)"
YARDSTICK = "one state, C by hand"
STOCK = "one state, stock pythonfmu"
NATIVE = "ppy_actuator, native"
PYTHON = "ppy_actuator, Python"
AGAINST = {EMPTY: YARDSTICK, NATIVE: YARDSTICK, PYTHON: STOCK}
SIGNALS = {
    EMPTY: ("u", "x"),
    YARDSTICK: ("u", "x"),
    STOCK: ("u", "x"),
    NATIVE: ("current", "voltage"),
    PYTHON: ("current", "voltage"),
}
BARE = "a bare loop in C"
KERNEL = "the kernel"
LOOP = "the loop in Python"
_STEP = 0.1  # s
_SHARE = 20  # the loop in Python makes one step for so many of the others


def empty_library(folder: str | Path) -> Path:
    """Compile the FMU that does nothing, the least that the compiler can be asked for."""
    # in a new place: zig would remember the old one
    source = shutil.copy(Path(__file__).parent / "c" / "empty.c", folder)
    target = toolchain.host_platform()
    path = Path(source).with_suffix(toolchain.EXTENSIONS[target])
    path.write_bytes(toolchain.compile_library([Path(source)], [toolchain.fmi_headers(2)], target))
    return path


def subjects(folder: str | Path) -> dict[str, Path]:
    """Build the FMUs that are stepped."""
    library = empty_library(folder)
    empty = Path(folder, "empty.fmu")
    with zipfile.ZipFile(empty, "w") as archive:
        description = hosts.ONE_STATE_DESCRIPTION.replace("one_state", "empty")
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{fmpy.platform}/{library.name}")
    return {
        EMPTY: empty,
        YARDSTICK: hosts.build_one_state_fmu(folder),
        NATIVE: build.build_cached(component("ppy_actuator"), "native"),
        PYTHON: build.build_cached(component("ppy_actuator"), "python"),
        STOCK: hosts.build_minimal_pythonfmu(folder),
    }


def step(quick: bool) -> Iterator[str | Table]:
    """Time a step through fmpy, and in a bare loop in C."""
    rounds, steps = (3, 50) if quick else (72, 1000)
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        (through_fmpy, in_c), _ = in_a_process(_time_hosts, subjects(folder), rounds, steps)
    yield "Through fmpy's `FMU2Slave`:"
    yield comparison(through_fmpy, AGAINST, targets={NATIVE: 1.0, PYTHON: 1.5})
    yield "The same calls in a bare loop in C:"
    yield comparison(in_c, AGAINST)


def _time_hosts(fmus: dict[str, Path], rounds: int, steps: int) -> list[Times]:
    with ExitStack() as opened:
        slaves = {
            name: _through_fmpy(opened.enter_context(hosts.extracted(path)), SIGNALS[name], steps)
            for name, path in fmus.items()
        }
        loops = {
            name: _in_a_loop(path, SIGNALS[name], BARE, 5 * steps) for name, path in fmus.items()
        }
        return [take_turns(slaves, rounds), take_turns(loops, rounds)]


def _through_fmpy(folder: Path, signals: tuple[str, str], steps: int) -> Duration:
    """Start an instance, and return the duration of steps that go on from where it is."""
    description = fmpy.read_model_description(str(folder), validate=False)
    references = {v.name: v.valueReference for v in description.modelVariables}
    into, out_of = ([references[signal]] for signal in signals)
    model = hosts.slave(folder)
    model.instantiate()
    model.setupExperiment(startTime=0.0)
    model.enterInitializationMode()
    model.exitInitializationMode()
    done = 0

    def go() -> None:
        nonlocal done
        for k, value in enumerate(_inputs(steps).tolist(), done):
            model.setReal(into, [value])
            model.doStep(k * _STEP, _STEP)
            model.getReal(out_of)
        done += steps

    return timed(go, steps)


def _inputs(count: int) -> Array:
    return 0.9 * np.sin(np.arange(1.0, count + 1))


def _in_a_loop(
    path: Path,
    signals: tuple[str, str],
    loop: str,
    steps: int,
    check: Callable[[Array], None] = lambda outputs: None,
) -> Duration:
    """Return the duration of a step in a loop, of a fresh instance; its outputs are checked."""
    name, output = signals
    points = _STEP * np.arange(steps + 1)
    values = _inputs(steps + 1)

    def go() -> float:
        with Fmu(path) as fmu:
            fmu.start()
            if loop == BARE:
                run = bare_loop(fmu, points, name, values, output)
            else:
                follow = one_fmu.follow_course if loop == KERNEL else python_loop.follow_course
                run = partial(_followed, follow, fmu, points, {name: values}, output)
            begin = time.perf_counter()
            outputs = run()
            seconds = (time.perf_counter() - begin) / steps
        check(outputs)
        return seconds

    return go


def _followed(
    follow: Callable[..., None], fmu: Fmu, points: Array, inputs: dict[str, Array], output: str
) -> Array:
    result = np.empty((len(points), 1))
    course = plan_course(fmu, points, inputs)
    follow(fmu, course, [output], result, lambda done: None, max(1, len(points) // 200))
    return result[:, 0]


def kernel(quick: bool) -> Iterator[str | Table]:
    """Time a step in the kernel, in a bare loop in C and in the loop in Python."""
    steps, rounds = (2000, 2) if quick else (1_000_000, 9)
    durations: dict[str, Duration] = {}
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        fmus = subjects(folder)
        for name in (EMPTY, YARDSTICK, NATIVE):
            check = _same(name, steps // _SHARE)
            for loop in (BARE, KERNEL, LOOP):
                count = steps // _SHARE if loop == LOOP else steps
                signals = SIGNALS[name]
                durations[f"{name}: {loop}"] = _in_a_loop(fmus[name], signals, loop, count, check)
        times = take_turns(durations, rounds)
    against = {name: f"{name.partition(': ')[0]}: {BARE}" for name in durations}
    yield comparison(times, against, targets={f"{NATIVE}: {KERNEL}": 2.0})


def _same(name: str, count: int) -> Callable[[Array], None]:
    """Return a check that all loops come to the same outputs, or their times mean nothing."""
    seen = set[bytes]()

    def check(outputs: Array) -> None:
        seen.add(outputs[:count].tobytes())
        if len(seen) > 1 and name != EMPTY:  # which answers nothing
            raise RuntimeError(f"{name}: the kernel and the loops differ")

    return check


def isolation(quick: bool) -> Iterator[str | Table]:
    """Time a run of one step, and a step of a long run, in this process and in one of their own."""
    durations: dict[str, Duration] = {}
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        fmus = {NATIVE: "ppy_actuator", YARDSTICK: str(hosts.build_one_state_fmu(folder))}
        for name, path in fmus.items():
            for steps, title in ((1, "one step"), (3000 if quick else 510_000, "a step of many")):
                clock = 1e-3 * np.arange(steps + 1)
                run = partial(ppy.simulate, path, {SIGNALS[name][0]: np.sin(clock)}, time=clock)
                durations[f"{name}, {title}"] = timed(partial(run, isolate=False), steps)
                isolated = timed(partial(run, isolate=True), steps)
                durations[f"{name}, {title}, isolated"] = isolated
        times = take_turns(durations, 1 if quick else 5)
    yield comparison(times, {name: name.removesuffix(", isolated") for name in durations})


COMPONENTS = {
    "pid": "reference",
    "ppy_actuator": "current",
    "voice_coil_dma": "force_reference",
    "foot_free": "an_tension",
}
_SIZES = (1_000, 10_000)  # elements of an array


def versions(quick: bool) -> Iterator[str | Table]:
    """Time steps and starts of the builds for both versions of FMI, and exchanges of arrays."""
    durations: dict[str, Duration] = {}
    with ExitStack() as opened:
        for version in (2, 3):
            for name, signal in COMPONENTS.items():
                path = build.build_cached(component(name), "native", version)
                runs = opened.enter_context(FmuSource(path).open())
                outputs = [output.name for output in component(name).layout.shown]
                step = _run(runs, signal, outputs, 200 if quick else 20_000)
                durations[f"{name}, a step, FMI {version}.0"] = step
            path = build.build_cached(component("ppy_actuator"), "native", version)
            durations[f"ppy_actuator, opened, FMI {version}.0"] = timed(partial(_start, path))
        for size in _SIZES:
            folder = Path(opened.enter_context(tempfile.TemporaryDirectory(prefix="benchmark_")))
            fmu = opened.enter_context(Fmu(fmi3_fmus.build_wide(size, folder)))
            fmu.start()
            durations[f"array of {size:,}, set and read"] = timed(_exchange(fmu, size))
        times = take_turns(durations, 3 if quick else 41)
    against = {name: name.replace("FMI 3.0", "FMI 2.0") for name in durations}
    targets = {name: 1.05 for name in durations if "a step, FMI 3.0" in name}
    yield comparison(times, against, targets=targets)


def _run(runs: RepeatedRuns, signal: str, outputs: list[str], steps: int) -> Duration:
    clock = 0.001 * np.arange(steps + 1)
    return timed(partial(runs.run, clock, {signal: 0.5 * np.sin(clock)}, {}, outputs), steps)


def _start(path: Path) -> None:
    with Fmu(path) as fmu:
        fmu.start()


def _exchange(fmu: Fmu, size: int) -> Callable[[], None]:
    write = fmu.writer(fmu.inputs)
    read = fmu.reader(fmu.outputs)
    values = np.ones(size)
    result = np.empty(size)

    def exchange() -> None:
        write(values)
        read(result)

    return exchange
