"""A motor of first order, and its record with the columns as they were wired.

It is sampled exactly, by hand.
"""

from __future__ import annotations

import numpy as np

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import coulomb_friction
from orchestration.discrepancy.data.dataset import Dataset

STEP, COUNT, LAG = 0.1, 1500, 0.8


class Motor(Component):
    """A motor of first order."""

    name = "motor"
    gain = Parameter(2.0, "1/s", min=1e-6, max=1e3)
    drag = Parameter(1.0, "1/s", min=1e-6, max=1e3)
    drive = Input("m/s")
    speed = State("m/s", rate="acceleration")

    def friction(self):
        """Proportional."""
        return self.drag * self.speed

    def acceleration(self):
        """Balance."""
        return self.gain * self.drive - self.friction()

    @Output("m/s")
    def shown(self):
        """As measured."""
        return self.speed


FRICTION = coulomb_friction(Motor, "friction", "speed", "m/s^2")


def wired(drive_sign=1.0, shown_sign=1.0, exchanged=False, noise=0.02, clock=1.0):
    """Return a record of a motor of 1.9 times the gain, with its columns as they were wired.

    Signs may be factors of any size; the clock counts so many times too fast.
    """
    rng = np.random.default_rng(3)
    drive = np.repeat(rng.uniform(-1.0, 1.0, COUNT // 15), 15)
    decay = np.exp(-STEP / LAG)
    speed = np.zeros(COUNT)
    for k in range(COUNT - 1):
        speed[k + 1] = decay * speed[k] + (1.0 - decay) * 3.0 * drive[k]
    shown = shown_sign * (speed + noise * rng.normal(size=COUNT))
    columns = [drive_sign * drive, shown]
    fed, measured = columns[::-1] if exchanged else columns
    return Dataset(clock * STEP * np.arange(COUNT), {"drive": fed}, {"shown": measured})


def with_dry_friction(force, noise=0.02, substeps=50):
    """Return the record of a motor that dry friction of a force brakes too, by Euler's steps."""
    record = wired()
    drive = record.inputs["drive"]
    step = STEP / substeps
    speed = np.zeros(COUNT)
    for k in range(COUNT - 1):
        v = speed[k]
        for _ in range(substeps):
            v += step * (3.0 * drive[k] / LAG - v / LAG - force * np.tanh(v / 0.02))
        speed[k + 1] = v
    shown = speed + noise * np.random.default_rng(6).standard_normal(COUNT)
    return Dataset(record.time, record.inputs, {"shown": shown})
