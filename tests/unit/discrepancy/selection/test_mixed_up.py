"""Claims: columns that are mixed up are told, and not what is wrong with a model.

Oracle: a first-order lag, sampled exactly by hand.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import coulomb_friction
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.law_corrections import leaves_something
from orchestration.discrepancy.note import MIXED_UP, NoteCode
from orchestration.discrepancy.report import wording

STEP, COUNT, LAG = 0.1, 1500, 0.8


class Motor(Component):
    """A motor of first order, which a heater beside it hardly brakes."""

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


def wired(drive_sign=1.0, shown_sign=1.0, exchanged=False, noise=0.02):
    """Return a record of a motor of twice the gain, with its columns as they were wired."""
    rng = np.random.default_rng(3)
    drive = np.repeat(rng.uniform(-1.0, 1.0, COUNT // 15), 15)
    decay = np.exp(-STEP / LAG)
    speed = np.zeros(COUNT)
    for k in range(COUNT - 1):
        speed[k + 1] = decay * speed[k] + (1.0 - decay) * 3.0 * drive[k]
    shown = shown_sign * (speed + noise * rng.normal(size=COUNT))
    columns = [drive_sign * drive, shown]
    fed, measured = columns[::-1] if exchanged else columns
    return Dataset(STEP * np.arange(COUNT), {"drive": fed}, {"shown": measured})


@pytest.mark.parametrize(
    ("how", "code"),
    [
        ({"exchanged": True}, NoteCode.EXCHANGED),
        ({"drive_sign": -1.0}, NoteCode.OTHER_SIGN),
        ({"shown_sign": -1.0}, NoteCode.OTHER_SIGN),
    ],
)
def test_columns_that_are_mixed_up_are_told_and_nothing_is_named(how, code):
    diagnosis = diagnose(Motor, wired(**how), [FRICTION])
    (note,) = [note for note in diagnosis.notes if note.code in MIXED_UP]
    assert note.code is code
    # exchanged, what is fed is held where the course of the other column was smooth
    assert note.facts["instead"] < 0.1 < 0.3 < note.facts["share"]
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert diagnosis.causes == []
    assert not leaves_something(diagnosis)
    assert wording.message(note) in wording.sentence(diagnosis)


@pytest.mark.parametrize("noise", [0.02, 0.6])
def test_of_what_is_as_it_should_be_nothing_is_said(noise):
    diagnosis = diagnose(Motor, wired(noise=noise), [FRICTION])
    assert not [note for note in diagnosis.notes if note.code in MIXED_UP]
    assert diagnosis.verdict in (Verdict.CONSISTENT, Verdict.RECALIBRATE)
