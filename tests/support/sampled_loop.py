"""A plant of first order under a sampled PI controller, and its exact recursion by SciPy."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.signal import cont2discrete

from fmus.kit import Component, Discrete, Effect, Input, Output, Parameter, State, Term
from fmus.kit.arrays import Array
from orchestration.diagnosis import LawModel, Record

GAIN, LAG, KP, KI, PERIOD, SHIFT = 2.0, 0.4, 0.3, 1.1, 0.1, 0.03
START = np.array([0.2, 0.1, -0.05])  # x, command, total
VALUES = {"gain": GAIN, "lag": LAG, "kp": KP, "ki": KI, "period": PERIOD, "shift": SHIFT}


class SampledLoop(Component):
    """A plant of first order whose drive is that of the latest sample."""

    name = "sampled_loop"
    gain = Parameter(GAIN, "1", min=0.01, max=100.0)
    lag = Parameter(LAG, "s", min=0.01, max=100.0)
    kp = Parameter(KP, "1", min=0.0, max=100.0)
    ki = Parameter(KI, "1/s", min=0.0, max=100.0)
    period = Parameter(PERIOD, "s", min=0.001, max=10.0)
    shift = Parameter(SHIFT, "s", min=0.0, max=10.0)
    reference = Input("1")
    load = Input("1")
    x = State("1", rate="rate")
    command = Discrete("1", update="next_command", period="period", shift=("shift",))
    total = Discrete("1", update="next_total", period="period", shift=("shift",))

    def error(self):
        """Reference less what is measured."""
        return self.reference - self.x

    def next_total(self):
        """Integral part."""
        return self.total + self.ki * self.period * self.error()

    def next_command(self):
        """PI law."""
        return self.kp * self.error() + self.next_total()

    def drive(self):
        """Input of the plant."""
        return self.gain * self.command

    def rate(self):
        """First order."""
        return (self.drive() + self.load - self.x) / self.lag

    @Output("1")
    def shown(self):
        """As seen."""
        return self.x

    @Output("1")
    def issued(self):
        """Command between samples."""
        return self.command


class Bend(Effect):
    """A controller whose gain depends on its error; bend = 0 is without."""

    id = "bend"
    title = "A bent controller"
    neutral = "bend"
    term = Term("error", "x", "b e^3", "error over x")
    bend = Parameter(0.0, "1", min=-10.0, max=10.0, nominal=0.1, doc="bend")

    def error(self):
        """Error, and its cube."""
        plain = super().error()
        return plain + self.bend * plain**3


@cache
def sampled_loop() -> LawModel:
    """Return the compiled loop, with a catalogue."""
    return LawModel(SampledLoop, {"bend": Bend})


def driven(count: int, step: float, smooth: bool = False) -> Record:
    """Return a record of a varied reference and load, without measured outputs."""
    time = step * np.arange(count)
    reference = np.sign(np.sin(1.7 * time)) + 0.3 * np.cos(3.1 * time)
    load = 0.4 * np.sin(2.3 * time + 0.4)
    inputs = np.column_stack([reference, load])
    return Record(time, inputs, np.zeros((count, 2)), (smooth, smooth))


def exact(
    record: Record,
    start: Array = START,
    error: Callable[[float], float] = lambda e: e,
    begin: float = 0.0,
    **changes: float,
) -> Array:
    """Return x, command and total at the samples, from one event to the next.

    Parameters
    ----------
    record : Record
        Inputs are held.
    start : ndarray, shape (3,)
    error : callable
        Of the controller, of the true error.
    begin : float
        Instant from which the clock counts.
    **changes : float
        Of `VALUES`.
    """
    v = VALUES | changes
    matrices = np.array([[-1.0 / v["lag"]]]), np.array([[v["gain"] / v["lag"], 1.0 / v["lag"]]])
    x, command, total = np.asarray(start, dtype=float)
    count = 0
    while begin + v["shift"] + count * v["period"] < record.time[0] - 1e-9:
        count += 1
    rows = []
    for k, now in enumerate(record.time.tolist()):
        rows.append([x, command, total])
        if k + 1 == len(record.time):
            break
        reference, load = record.inputs[k]
        end = float(record.time[k + 1])
        while now < end:
            tick = begin + v["shift"] + count * v["period"]
            if tick <= now + 1e-9:
                e = error(reference - x)
                total += v["ki"] * v["period"] * e
                command = v["kp"] * e + total
                count += 1
                continue
            until = tick if tick < end - 1e-9 else end
            a, b, *_ = cont2discrete((*matrices, np.eye(1), np.zeros((1, 2))), until - now)
            x = float(a[0, 0] * x + b[0] @ [command, load])
            now = until
    return np.array(rows)
