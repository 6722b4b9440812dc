"""A loop that holds the tension of an actuator by its current, around an emulated rig.

The actuator is held at a fixed length. It lengthens with its charge, so that its tension falls: a
PID controller commands the current, by a negative gain. Between the samples of a slow loop
there is nothing to exchange, so that it runs at 30 Hz, as the rig does, and not at the kilohertz
that the coil of ``hil_bench`` needs::

    python examples/tension_loop.py measure record.csv
    python examples/tension_loop.py compare better.fmu
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

import ppy_rig as ppy
from fmus import component
from fmus.kit import Component
from orchestration import master
from orchestration.linear import ControllerDesign, LoopMargins
from orchestration.records import write_record
from orchestration.system import Member, Port, System, connect

NOMINAL = "ppy_actuator_length_driven"
CROSSOVER = 0.05  # Hz
PHASE_MARGIN = 60.0  # degrees
PERIOD = 1.0 / 30.0  # s, of rig and controller
LENGTH = 2.5e-4  # m, at which the actuator is held: 1.6 N without charge
STEP_TIME = 20.0  # s, when the wanted tension changes
LEVELS = 1.5, 1.1  # N, wanted before and after
DURATION = 60.0  # s
_SETTLED = 0.05  # share of the step
_AFTER = 1e-3  # s from a command to what is measured after it


@contextmanager
def emulated_rig(hidden: str = "strain_lag") -> Iterator[str]:
    """Serve an emulated rig in lockstep with an effect hidden in it; yield its endpoint."""
    options = ("--option", "signals=length-driven", "--option", f"hidden={hidden}")
    command = [sys.executable, "-m", "orchestration.cli", "rig", "serve", "--lockstep", *options]
    with (
        TemporaryDirectory() as state,
        subprocess.Popen(
            [*command, "--port", "0", "--state", state], stdout=subprocess.PIPE, text=True
        ) as server,
    ):
        assert server.stdout is not None
        try:
            ready = next((line for line in server.stdout if "ready: " in line), None)
            if ready is None:
                raise ppy.UserError("the emulated rig ended before it was ready")
            yield re.findall(r"tcp://[\w.]+:\d+", ready)[0]
        finally:
            server.terminate()  # the rig goes to its safe state


def measure(endpoint: str, path: Path, duration: float = 45.0, seed: int = 1) -> None:
    """Record a rig in lockstep under random levels of current and length.

    What is measured belongs to the command of its row: the rig is read shortly after each, as
    ``ppy rig record`` does with one in real time.
    """
    random = np.random.default_rng(seed)
    count = round(duration / PERIOD)
    time = PERIOD * np.arange(count)
    commands = {
        "current": _levels(random, [-0.9, -0.45, 0.0, 0.45, 0.9], (0.5, 4.0), count),
        "length_change": _levels(random, [2.0e-4, 2.5e-4, 3.0e-4], (1.0, 5.0), count),
    }
    points = np.column_stack([time, time + _AFTER]).ravel()
    run = ppy.simulate(
        "rig_proxy_length_driven",
        {name: np.repeat(values, 2) for name, values in commands.items()},
        time=points,
        settings={"endpoint": endpoint},
    )
    measured = {name: np.asarray(run[name])[1::2] for name in ("voltage", "tension")}
    units = {"current": "A", "length_change": "m", "voltage": "V", "tension": "N"}
    write_record(path, time, commands | measured, units)


def _levels(
    random: np.random.Generator, values: list[float], dwell: tuple[float, float], count: int
) -> np.ndarray:
    """Return random levels (count,), each kept for a random time between two of `dwell`, s."""
    levels: list[float] = []
    while len(levels) < count:
        levels += [random.choice(values)] * round(random.uniform(*dwell) / PERIOD)
    return np.array(levels[:count])


def controller_for(model: str | Path) -> ControllerDesign:
    """Return the controller for a model, by one rule for all: crossover and phase margin."""
    return ppy.design(
        model,
        command="current",
        measured="tension",
        settings={"length_change": LENGTH},
        sample_period=PERIOD,
        crossover=CROSSOVER,
        phase_margin=PHASE_MARGIN,
        limits=(-1.3, 1.3),
    )


def tension_loop(films: Member, controller: type[Component]) -> System:
    """Return the loop of a controller around a length-driven actuator or its proxy.

    Parameters
    ----------
    films : Member
        By the name ``films``, with the signals of ``ppy_actuator_length_driven``.
    controller : type[Component]
        From ``measured`` tension to ``command`` of the current.
    """
    slack = {"previous_measured_start": 0.0}  # N, before the films have their length
    return System(
        name="tension_loop",
        members=(Member.of("pid", controller, slack), films),
        connections=connect("films.tension -> pid.measured", "pid.command -> films.current"),
        inputs={
            "reference": (Port("pid", "reference"),),
            "length_change": (Port("films", "length_change"),),
        },
        outputs={"tension": Port("films", "tension"), "command": Port("pid", "command")},
        doc="Actuator at a fixed length whose tension is held by its current",
        step=PERIOD,
        stop=DURATION,
    )


def step_response(loop: System) -> np.ndarray:
    """Return the tension (n,) in N after a step of the reference, from `STEP_TIME` on."""
    time = PERIOD * np.arange(round(DURATION / PERIOD) + 1)
    inputs = {
        "reference": np.where(time < STEP_TIME, *LEVELS),
        "length_change": np.full(time.size, LENGTH),
    }
    tension = master.run(loop, time, inputs).signals["films.tension"]
    return np.asarray(tension)[time >= STEP_TIME - 0.5 * PERIOD]


class StepFigures(NamedTuple):
    """Overshoot, %, time to stay within 5 % of the step, s, and root mean square error, N."""

    overshoot: float
    settling_time: float
    error: float

    @classmethod
    def of(cls, tension: np.ndarray) -> StepFigures:
        """Return the figures of a response (n,), N, that begins at the step."""
        before, after = LEVELS
        response = (tension - before) / (after - before)
        unsettled = np.flatnonzero(np.abs(response - 1.0) > _SETTLED)
        return cls(
            100.0 * (float(response.max()) - 1.0),
            PERIOD * float(unsettled[-1] + 1),
            float(np.sqrt(np.mean((tension - after) ** 2))),
        )


@dataclass(frozen=True)
class Tuned:
    """A loop tuned for a model.

    Attributes
    ----------
    gains : dict of str to float
        Parameters of the controller.
    margins : LoopMargins
        With the extended model in the loop.
    rig, nominal, extended : ndarray, shape (n,)
        Tension in N after the step: measured, and as either model has it.
    """

    gains: dict[str, float]
    margins: LoopMargins
    rig: np.ndarray
    nominal: np.ndarray
    extended: np.ndarray

    def error_of(self, predicted: np.ndarray) -> float:
        """Return the root mean square error of a prediction of the rig, N."""
        return float(np.sqrt(np.mean((predicted - self.rig) ** 2)))


def tune(model: str | Path, extended: Path) -> Tuned:
    """Tune the loop for a model, and close it over a rig at rest and over both models."""
    found = controller_for(model)
    better = tension_loop(Member("films", extended), found.controller)
    loop = ppy.linearise(better, {"length_change": LENGTH}, cut="films.tension")
    with emulated_rig() as rig:  # a fresh one, as films remember charge and load
        proxy = Member.of("films", component("rig_proxy_length_driven"), {"endpoint": rig})
        measured = step_response(tension_loop(proxy, found.controller))
    return Tuned(
        found.parameters,
        loop.margins(),
        measured,
        step_response(tension_loop(Member.of("films", component(NOMINAL)), found.controller)),
        step_response(better),
    )


def compare(extended: Path) -> tuple[Tuned, Tuned]:
    """Return the loop tuned for the nominal model, and for the extended one."""
    return tune(NOMINAL, extended), tune(extended, extended)


def figures(loop: Tuned) -> dict[str, float]:
    """Return the figures of a loop, by what they are and their unit."""
    measured = StepFigures.of(loop.rig)
    return {
        "K, A/N": loop.gains["proportional_gain"],
        "T_i, s": loop.gains["integral_time"],
        "T_d, s": loop.gains["derivative_time"],
        "phase margin by the extended model, degrees": loop.margins.phase,
        "overshoot on the rig, %": measured.overshoot,
        "settling time on the rig, s": measured.settling_time,
        "rms error on the rig, mN": 1e3 * measured.error,
        "rms error of the nominal model's prediction, mN": 1e3 * loop.error_of(loop.nominal),
        "rms error of the extended model's prediction, mN": 1e3 * loop.error_of(loop.extended),
    }


def table(before: Tuned, after: Tuned) -> str:
    """Return figures of two loops beside each other."""
    second = figures(after)
    head = f"{'loop tuned for the model':50}{'nominal':>10}{'extended':>10}"
    lines = [f"{name:50}{x:10.3g}{second[name]:10.3g}" for name, x in figures(before).items()]
    return "\n".join([head, *lines])


def main() -> None:
    """Measure a record, or compare the loops tuned for both models."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("task", choices=["measure", "compare"])
    parser.add_argument("file", type=Path, help="record to write, or FMU of the extended model")
    chosen = parser.parse_args()
    try:
        if chosen.task == "measure":
            with emulated_rig() as rig:
                measure(rig, chosen.file)
        else:
            print(table(*compare(chosen.file)))
    except ppy.UserError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
