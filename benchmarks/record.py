"""A whole record in one call: the compiled model, the arithmetic by hand, and CasADi's VM."""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable

import casadi as ca
import numpy as np

from fmus import component
from fmus.kit.arrays import Array
from fmus.kit.record.compiled import CompiledModel, Trajectory
from fmus.kit.symbolic import Graph, trace
from orchestration.experiment import waveforms

from . import c_code
from .tables import Cell, Table, Topic
from .timing import Times, take_turns

PARAMETERS = ("R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2")
OUTPUTS = ("voltage", "electrochemical_displacement", "mechanical_displacement", "displacement")
STATES = ("charge", "kelvin_elongation", "maxwell_elongation")
BARE = "bare loop in C"
PLAIN = "compiled model"
SENSITIVE = "with 8 sensitivities"
MACHINE = "CasADi's VM"
_STEP = 0.1  # s
_DOUBLES = ctypes.POINTER(ctypes.c_double)


def measure(quick: bool = False) -> Topic:
    """Time all of them on one record, and the compiled model on records of growing length."""
    samples, rounds = (600, 2) if quick else (180_000, 15)
    lengths = (600, 1200, 2400) if quick else (6_000, 60_000, 600_000)
    model = CompiledModel(component("ppy_actuator"))
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        library = ctypes.CDLL(str(c_code.library("record.c", folder)))
        library.bare_record.restype = ctypes.c_long
        actions, tried = _actions(model, samples, library)
        times = take_turns(actions, rounds)
    growing = take_turns({str(n): _simulation(model, n) for n in lengths}, rounds)
    return Topic(
        f"Simulation of {samples:,} samples",
        [
            (
                "`ppy_actuator` over a record at 10 Hz: square waves of current, staircases of"
                " load. It is linear, and so long a record of it takes exact steps. The loop in C"
                " takes Runge-Kutta steps with step control, written by hand for this one model,"
                f" and is called in the same way from Python; it tries {tried / samples:.2f}"
                " internal steps per sample. CasADi's VM takes one such step per sample, without"
                " error estimate and with the parameters as constants. The signals of all agree to"
                f" {AGREEMENT:g} of the largest value. Eight sensitivities by differences would"
                " take nine runs."
            ),
            _against(times, samples),
            "Cost of longer records:",
            _growth(growing, lengths),
            f"Time grows as the number of samples to the power {exponent(growing, lengths):.3f}.",
        ],
    )


def exponent(times: Times, lengths: tuple[int, ...]) -> float:
    """Exponent of the power law through the shortest times, by least squares in logarithms."""
    return float(np.polyfit(np.log(lengths), np.log([times.best(str(n)) for n in lengths]), 1)[0])


def _against(times: Times, samples: int) -> Table:
    rows: list[list[Cell]] = [
        [
            name,
            times.best(name) * 1e3,
            times.best(name) / samples * 1e9,
            times.ratio_of_best(name, BARE),
            times.median_ratio(name, BARE),
            times.median_ratio(name, PLAIN),
        ]
        for name in times.seconds
    ]
    columns = [
        "",
        "best, ms",
        "per sample, ns",
        f"of the {BARE}, best",
        "the same, median",
        f"of the {PLAIN}, median",
    ]
    return Table(columns, rows)


def _growth(times: Times, lengths: tuple[int, ...]) -> Table:
    rows: list[list[Cell]] = [
        [n, times.best(str(n)) * 1e3, times.best(str(n)) / n * 1e9] for n in lengths
    ]
    return Table(["samples", "best, ms", "per sample, ns"], rows)


# --- what is timed
# --------------------------------------------------------------------------------------------------

# Largest difference from the compiled model, relative to the largest value of a signal: that of
# internal steps from exact ones.
AGREEMENT = 1e-9


def _record(n: int) -> tuple[Array, dict[str, Array]]:
    time: Array = _STEP * np.arange(n, dtype=float)
    current = waveforms.square_wave(time, 0.6, 0.01)
    return time, {"current": current, "force": waveforms.force_staircase(time, 200.0)}


def _simulation(model: CompiledModel, n: int) -> Callable[[], Trajectory]:
    time, inputs = _record(n)
    return lambda: model.run(time, inputs)


def _actions(
    model: CompiledModel, n: int, library: ctypes.CDLL
) -> tuple[dict[str, Callable[[], object]], int]:
    """Return what to time, its results checked, and the internal steps that the record takes."""
    sensitive = CompiledModel(component("ppy_actuator"), PARAMETERS)
    bare = _bare(library, n)
    machine = _machine(n)
    signals, tried = bare()
    expected = model.run(*_record(n)).signals
    for name, result in (
        (BARE, signals),
        (MACHINE, machine()),
        (SENSITIVE, sensitive.run(*_record(n)).signals),
    ):
        for signal in signals:
            values = expected[signal]
            error = np.max(np.abs(result[signal] - values)) / np.max(np.abs(values))
            if not error <= AGREEMENT:
                raise RuntimeError(f"{name}: {signal} differs by {error:g} of its largest value")
    actions = {
        BARE: bare,
        PLAIN: _simulation(model, n),
        SENSITIVE: _simulation(sensitive, n),
        MACHINE: machine,
    }
    return actions, tried


def _bare(library: ctypes.CDLL, n: int) -> Callable[[], tuple[dict[str, Array], int]]:
    """Call ``c/record.c`` as the compiled model is called: inputs gathered, results allocated."""
    time, inputs = _record(n)
    cls = component("ppy_actuator")
    start = {p.name: float(p.start) for p in cls.layout.parameters}

    def run() -> tuple[dict[str, Array], int]:
        table = np.ascontiguousarray(np.column_stack([inputs["current"], inputs["force"]]))
        outputs = np.empty((n, len(OUTPUTS)))
        states = np.empty((n, len(STATES)))
        values = np.array([start[name] for name in PARAMETERS])
        pointers = [a.ctypes.data_as(_DOUBLES) for a in (time, table, values, outputs, states)]
        tolerance = ctypes.c_double(cls.tolerance)
        tried = library.bare_record(ctypes.c_size_t(n), *pointers[:3], tolerance, *pointers[3:])
        signals = {name: outputs[:, i] for i, name in enumerate(OUTPUTS)}
        return signals | {name: states[:, i] for i, name in enumerate(STATES)}, tried

    return run


def _machine(n: int) -> Callable[[], dict[str, Array]]:
    """Map CasADi's interpreter over the record, a step of Runge-Kutta at a time."""
    graph = trace(component("ppy_actuator"))
    mapped = _runge_kutta(graph).mapaccum("record", n, 1)
    _, inputs = _record(n)
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
