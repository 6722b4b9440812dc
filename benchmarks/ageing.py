"""The five-hour life of a film: three native FMUs under a master, against real time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from demonstrations.thesis import ageing
from fmus import component
from fmus.kit.build.building import build_cached
from orchestration.fmu.instance import Fmu
from orchestration.system.library import ageing_actuator

from .tables import Cell, Table, Topic
from .timing import take_turns

LIFE = "the life"
STEPS = "its steps alone, nothing exchanged"
TARGET = 2000  # times real time
STEP = 0.1  # s


def measure(quick: bool = False) -> Topic:
    """Time the life, and the same steps without setting and getting anything, in turns."""
    duration, rounds = (20.0, 2) if quick else (ageing.LIFE, 5)
    with ExitStack() as opened:
        bare = _steps(opened, round(duration / STEP))
        times = take_turns({LIFE: lambda: ageing.run(duration), STEPS: bare}, rounds)
    rows: list[list[Cell]] = []
    for name in (LIFE, STEPS):
        best = times.best(name)
        rows.append(
            [
                name,
                best,
                duration / best,
                best / (duration / STEP) * 1e6,
                times.median_ratio(name, LIFE),
            ]
        )
    speed = duration / times.best(LIFE)
    text = (
        f"{duration:g} s of cycling at {STEP} s: galvanostat, ageing actuator and degradation"
        " estimator, as native FMUs in one process under our master (Jacobi); 18 values are set or"
        f" read at each step, and 12 are recorded. Opening the FMUs counts too. Target {TARGET:,}"
        f" times real time, {'met' if speed >= TARGET else 'missed'}."
    )
    columns = [
        "what",
        "best, s",
        "times real time",
        "best, µs for a step of all three",
        "median ratio to the life",
    ]
    return Topic("The life of five hours", [text, Table(columns, rows)])


def _steps(opened: ExitStack, count: int) -> Callable[[], None]:
    """Return a function that steps the three FMUs from where they are."""
    classes = (component("galvanostat"), ageing_actuator(), component("degradation_estimator"))
    fmus = [opened.enter_context(Fmu(build_cached(cls, "native"))) for cls in classes]
    for fmu in fmus:
        fmu.start()
    done = 0

    def go() -> None:
        nonlocal done
        for k in range(done, done + count):
            for fmu in fmus:
                fmu.step(k * STEP, STEP)
        done += count

    return go
