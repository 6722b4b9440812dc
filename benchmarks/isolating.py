"""Cost of running an FMU in a process of its own, beside this process and a call a function."""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

import orchestration as ppy
from orchestration.fmu.model import Model
from tests.support import hosts

from .stepping import NATIVE, YARDSTICK
from .tables import Cell, Table, Topic
from .timing import take_turns

HERE = "in this process"
BESIDE = "in a process of its own"
TARGET = 10.0  # us a step
CALLS = 3  # of an FMU at a step: set, step, get
_STEP = 1e-3  # s
_SIGNALS = {NATIVE: "current", YARDSTICK: "u"}


def measure(quick: bool = False) -> Topic:
    """Time simulations of two lengths either way: what the longer one takes more is its steps."""
    few, many, rounds = (1000, 3000, 1) if quick else (10_000, 510_000, 5)
    rows: list[list[Cell]] = []
    told = []
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        models = {
            NATIVE: ppy.find_model("ppy_actuator"),
            YARDSTICK: ppy.find_model(str(hosts.build_one_state_fmu(Path(folder)))),
        }
        for name, model in models.items():
            each, starts = _costs(model, _SIGNALS[name], few, many, rounds)
            extra = each[BESIDE] - each[HERE]
            rows.append([name, each[HERE], each[BESIDE], extra, starts[BESIDE] - starts[HERE]])
            told.append(
                f"{name}: {extra:.3g} µs more a step (target {TARGET:g},"
                f" {'met' if extra <= TARGET else 'missed'})"
            )
    remote = CALLS * _round_trip(100 if quick else 20_000)
    return Topic(
        "Isolation",
        [
            (
                "Time of a step of `ppy.simulate` with one input set at every point: by how much"
                f" longer {many:,} steps take than {few:,}; and by how much longer the shorter run"
                " takes in a process of its own."
            ),
            "; ".join(told) + ".",
            Table(
                ["FMU", f"{HERE}, µs", f"{BESIDE}, µs", "more a step, µs", "more at the start, s"],
                rows,
            ),
            (
                f"Beside: {CALLS} calls to another process over a pipe, one for each function of a"
                f" step, as where every function is called remotely: {remote:.3g} µs a step,"
                " without an FMU."
            ),
        ],
    )


def _costs(
    model: Model, name: str, few: int, many: int, rounds: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Microseconds for a step, and seconds for the shorter run, by where it is made."""
    actions = {}
    for where in (HERE, BESIDE):
        for steps in (few, many):
            clock = _STEP * np.arange(steps + 1)
            driven = {name: np.sin(clock)}
            isolate = where == BESIDE
            actions[f"{where} {steps}"] = partial(
                ppy.simulate, model, driven, time=clock, isolate=isolate
            )
    times = take_turns(actions, rounds)
    each = {
        where: (
            1e6 * (times.median(f"{where} {many}") - times.median(f"{where} {few}")) / (many - few)
        )
        for where in (HERE, BESIDE)
    }
    return each, {where: times.median(f"{where} {few}") for where in (HERE, BESIDE)}


def _round_trip(count: int) -> float:
    """Microseconds to send a number to another process and have one back, the shortest of a few."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_answer, args=(there,), daemon=True)
    process.start()
    here.send_bytes(bytes(8))
    here.recv_bytes()
    spent = []
    for _ in range(5):
        begin = time.perf_counter()
        for _ in range(count):
            here.send_bytes(bytes(8))
            here.recv_bytes()
        spent.append((time.perf_counter() - begin) / count)
    here.send_bytes(b"")
    process.join()
    return 1e6 * min(spent)


def _answer(there: Connection) -> None:
    while there.recv_bytes():
        there.send_bytes(bytes(8))
