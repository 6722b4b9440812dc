"""Punctuality of a run in real time, beside a loop that only sleeps until the next deadline."""

from __future__ import annotations

import time

import numpy as np

from fmus import component
from fmus.kit.arrays import Array
from orchestration import master
from orchestration.system.model import Member, Port, System

from .tables import Cell, Table, Topic

RATES = (30, 100, 1000)  # Hz
MASTER = "the master, one actuator"
BARE = "a bare loop of sleeps"
_SHARES = (50.0, 99.0)  # percentiles


def measure(quick: bool = False) -> Topic:
    """Let both keep pace in turns, and compare how late they were."""
    seconds, rounds = (0.2, 2) if quick else (1.0, 5)
    actuator = Member.of("actuator", component("ppy_actuator"))
    inputs = {name: (Port("actuator", name),) for name in ("current", "force")}
    system = System("actuator", (actuator,), (), inputs)
    rows: list[list[Cell]] = []
    for rate in RATES:
        late = {name: np.empty(0) for name in (MASTER, BARE)}
        for k in range(rounds):
            for name in (MASTER, BARE) if k % 2 else (BARE, MASTER):
                points = np.arange(max(3, round(seconds * rate)) + 1) / rate
                found = paced(system, points) if name == MASTER else bare(points)
                late[name] = np.concatenate([late[name], found])
        figures = {
            name: [*np.percentile(values, _SHARES), values.max()] for name, values in late.items()
        }
        for name, values in figures.items():
            ratios = [
                ours / other for ours, other in zip(values[:2], figures[BARE][:2], strict=True)
            ]
            rows.append(
                [f"{rate} Hz, {name}", *(1e6 * float(x) for x in values), *map(float, ratios)]
            )
    columns = [
        "rate, who",
        "median, µs",
        "99 %, µs",
        "worst, µs",
        "median over the bare loop's",
        "99 % over it",
    ]
    remark = (
        "How much later than its deadline each communication point was reached. Deadlines are"
        f" absolute in both; the bare loop computes nothing and sleeps. {rounds} rounds of"
        f" {seconds:g} s each, in turns. The master sleeps a little less than it must and turns"
        " round for the rest, so its median is below the loop's. What is worst is the machine's"
        " doing in both."
    )
    return Topic("Real time", [remark, Table(columns, rows)])


def paced(system: System, points: Array) -> Array:
    """Latenesses in s of a run of the master, shape (n - 2,)."""
    late: list[float] = []
    pace = master.RealTime(watch=lambda k, values, lag, missed: late.append(lag))
    inputs = {"current": np.full(points.size, 0.5), "force": np.full(points.size, 1.0)}
    master.run(system, points, inputs, real_time=pace)
    return np.array(
        late[2:]
    )  # the watch is told of the point before; there is none before the second


def bare(points: Array) -> Array:
    """Latenesses in s of a loop that sleeps until each point, shape (n - 1,)."""
    late = []
    start = time.perf_counter()
    for point in points[1:].tolist():
        while (left := start + point - time.perf_counter()) > 0.0:
            time.sleep(left)
        late.append(-left)
    return np.array(late)
