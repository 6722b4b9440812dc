"""The compiled model over a whole record, and the size and start of the product."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from unittest.mock import patch

import casadi as ca
import numpy as np

from fmus import component
from fmus.kit import Component, build
from fmus.kit.arrays import Array
from fmus.kit.build import toolchain
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.record.linearisation import Linearisation
from fmus.kit.symbolic import Graph, trace
from orchestration.experiment import waveforms

from .stepping import empty_library
from .tables import Cell, Table
from .timing import Duration, comparison, exponent, take_turns, timed

PLAIN = "compiled model"
SENSITIVE = "with 8 sensitivities"
MACHINE = "CasADi's VM"
PARAMETERS = ("R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2")
# Largest difference from the compiled model, relative to the largest value of a signal: that of
# steps of the Runge-Kutta method from exact ones.
AGREEMENT = 1e-9
_STEP = 0.1  # s


def record(quick: bool) -> Iterator[str | Table]:
    """Time a simulation of one record, and of records of growing length."""
    samples, rounds = (600, 2) if quick else (180_000, 15)
    lengths = (600, 1200, 2400) if quick else (6_000, 60_000, 600_000)
    model = CompiledModel(component("ppy_actuator"))
    sensitive = CompiledModel(component("ppy_actuator"), PARAMETERS)
    machine = _machine(samples)
    actions: dict[str, Callable[[], dict[str, Array]]] = {
        PLAIN: lambda: model.run(*_record(samples)).signals,
        SENSITIVE: lambda: sensitive.run(*_record(samples)).signals,
        MACHINE: machine,
    }
    check_agreement({name: action() for name, action in actions.items()})
    times = take_turns({name: timed(action, samples) for name, action in actions.items()}, rounds)
    yield comparison(times, dict.fromkeys((SENSITIVE, MACHINE), PLAIN), "ns")
    sizes = {f"{count:,} samples": count for count in lengths}
    growing = take_turns(
        {name: timed(partial(model.run, *_record(count))) for name, count in sizes.items()}, rounds
    )
    yield comparison(growing, dict.fromkeys(list(sizes)[1:], next(iter(sizes))), "ms")
    yield f"Time grows as the number of samples to the power {exponent(growing, sizes):.3f}."


def check_agreement(found: dict[str, dict[str, Array]]) -> None:
    """Raise RuntimeError if signals differ, by name of what computed them."""
    for name, signals in found.items():
        for signal, values in found[MACHINE].items():
            error = np.max(np.abs(signals[signal] - values)) / np.max(np.abs(values))
            if not error <= AGREEMENT:
                raise RuntimeError(f"{name}: {signal} differs by {error:g} of its largest value")


def _record(count: int) -> tuple[Array, dict[str, Array]]:
    time: Array = _STEP * np.arange(count, dtype=float)
    current = waveforms.square_wave(time, 0.6, 0.01)
    return time, {"current": current, "force": waveforms.force_staircase(time, 200.0)}


def _machine(count: int) -> Callable[[], dict[str, Array]]:
    """Map CasADi's interpreter over the record, a step of Runge-Kutta at a time."""
    graph = trace(component("ppy_actuator"))
    mapped = _runge_kutta(graph).mapaccum("record", count, 1)
    _, inputs = _record(count)
    table = ca.DM(np.vstack([inputs[v.name] for v in graph.layout.inputs]))
    start = ca.DM(graph.point()[2])
    names = [v.name for v in (*graph.layout.outputs, *graph.layout.states)]

    def run() -> dict[str, Array]:
        _, outputs, states = mapped(start, table)
        return dict(zip(names, [*outputs.full(), *states.full()], strict=True))

    return run


def _runge_kutta(graph: Graph) -> ca.Function:
    """One step of the classical method, with outputs and states at its begin."""
    parameters = ca.DM(graph.point()[0])
    x = graph.states
    u = graph.inputs
    rates = ca.Function("rates", [x, u], [ca.substitute(graph.rates, graph.parameters, parameters)])
    k1 = rates(x, u)
    k2 = rates(x + _STEP / 2 * k1, u)
    k3 = rates(x + _STEP / 2 * k2, u)
    k4 = rates(x + _STEP * k3, u)
    after = x + _STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    outputs = ca.substitute(graph.outputs, graph.parameters, parameters)
    return ca.Function("step", [x, u], ca.cse([after, outputs, x]))


STIFF: dict[str, dict[str, list[float]]] = {
    "ppy_actuator": {"current": [-0.9, 0.0, 0.9], "force": [0.5, 1.0, 2.75]},
    "galvanostat": {"current_command": [-0.9, 0.0, 0.9]},
    "voice_coil_dma": {"force_reference": [0.5, 1.0, 2.0], "tension": [0.5, 1.5]},
}
_SETTINGS = {"galvanostat": {"response_time": 1e-4}}


def stiff(quick: bool) -> Iterator[str | Table]:
    """Simulate components with sensitivities, by the chosen integrator and by Runge-Kutta."""
    samples, rounds = (300, 2) if quick else (60_000, 5)
    time = 0.01 * np.arange(samples)
    durations: dict[str, Duration] = {}
    for name, levels in STIFF.items():
        inputs = {
            signal: waveforms.multilevel(time, values, (0.1, 0.5), seed)
            for seed, (signal, values) in enumerate(levels.items(), 1)
        }
        model = CompiledModel(component(name), _fitted_parameters(component(name)))
        run = partial(model.run, time, inputs, _SETTINGS.get(name))
        durations[f"{name}, Runge-Kutta"] = timed(partial(_explicitly, run))
        durations[f"{name}, as chosen"] = timed(run)
    against = {f"{name}, as chosen": f"{name}, Runge-Kutta" for name in STIFF}
    yield comparison(take_turns(durations, rounds), against, "ms")


def _fitted_parameters(cls: type[Component]) -> list[str]:
    """Return the parameters of a component that a diagnosis fits: clocks keep their periods."""
    clocks = cls.layout.clock_parameters
    return [p.name for p in cls.layout.parameters if p.type == "real" and p.name not in clocks]


def _explicitly(run: Callable[[], object]) -> None:
    with patch.object(Linearisation, "ladder", return_value=None):
        run()


NOTHING = "python -c pass"
COMMANDS = {
    NOTHING: ("-c", "pass"),
    "ppy --help": ("-m", "orchestration.cli", "--help"),
    "ppy list": ("-m", "orchestration.cli", "list"),
}


def start(quick: bool) -> Iterator[str | Table]:
    """Time commands in fresh processes."""
    durations = {
        name: timed(partial(_process, [sys.executable, *arguments]))
        for name, arguments in COMMANDS.items()
    }
    against = dict.fromkeys(list(COMMANDS)[1:], NOTHING)
    yield comparison(take_turns(durations, 2 if quick else 20), against, "ms")


def _process(command: list[str]) -> None:
    subprocess.run(command, check=True, capture_output=True, stdin=subprocess.DEVNULL)


def size(quick: bool) -> Iterator[str | Table]:
    """Count the syntax-tree nodes and lines of the product by room."""
    root = Path(__file__).resolve().parent.parent
    nodes = Counter[str]()
    lines = Counter[str]()
    for package in ("orchestration", "fmus"):
        for path in (root / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            room = "/".join(path.relative_to(root).parts[:2])
            nodes[room] += sum(1 for _ in ast.walk(ast.parse(text)))
            lines[room] += text.count("\n")
    rows: list[list[Cell]] = [[room, count, lines[room]] for room, count in nodes.most_common()]
    rows.append(["all", nodes.total(), lines.total()])
    yield Table(["room", "syntax-tree nodes", "lines"], rows)


COMPILED_ONLY = "an empty C FMU, compiled only"


def builds(quick: bool) -> Iterator[str | Table]:
    """Time both builds of an FMU for this machine."""
    cls = component("ppy_actuator")
    durations = {COMPILED_ONLY: timed(_compile_nothing)}
    for runtime in build.RUNTIMES:
        planned = partial(build.plan_build, cls, runtime)
        durations[f"{runtime}, all but the compiler"] = timed(planned)
        durations[f"{runtime}, all"] = timed(partial(_build, cls, runtime))
    times = take_turns(durations, 1 if quick else 5)
    yield comparison(times, dict.fromkeys(durations, COMPILED_ONLY), "ms")


def _compile_nothing() -> None:
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        empty_library(folder)


def _build(cls: type[Component], runtime: str) -> None:
    """Build with an empty cache."""
    with (
        tempfile.TemporaryDirectory(prefix="benchmark_") as folder,
        patch.dict(os.environ, PPY_CACHE=folder),
    ):
        build.build(cls, runtime, [toolchain.host_platform()])
