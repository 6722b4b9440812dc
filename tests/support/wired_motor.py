"""A motor of first order, and its record with the columns as they were wired.

It is sampled exactly, by hand.
"""

from __future__ import annotations

import numpy as np

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import coulomb_friction
from orchestration.discrepancy.data.dataset import Dataset

STEP, COUNT, LAG = 0.1, 1500, 0.8
SUBSTEPS = 50  # of Euler's, in a step


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


def with_dry_friction(force, width=0.02, drive=1.0, noise=0.02, wave=0.0):
    """Return the record of a motor that dry friction, force tanh(speed / width), brakes too.

    By Euler's steps. The drive is so many times that of `wired`; what is shown has noise, and a
    wave that has no cause.
    """
    record = wired()
    fed = drive * record.inputs["drive"]
    speed = np.zeros(COUNT)
    for k in range(COUNT - 1):
        v = speed[k]
        for _ in range(SUBSTEPS):
            v += STEP / SUBSTEPS * ((3.0 * fed[k] - v) / LAG - force * np.tanh(v / width))
        speed[k + 1] = v
    error = noise * np.random.default_rng(6).standard_normal(COUNT)
    shown = speed + error + wave * np.sin(0.9 * record.time)
    return Dataset(record.time, {"drive": fed}, {"shown": shown})
