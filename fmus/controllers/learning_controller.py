"""Iterative learning for periodic references: the command of the last period, corrected by its
error.

The period of the reference is a fixed number of sample periods, the length of the registers. The
learnt command is added to that of a feedback controller.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..kit import Array, Component, Discrete, Input, Output, Parameter, clip, where
from .signals import largest_current, sampled_length

SAMPLES = 40  # of a period
_TAPS = 1  # of the filter, to either side
_LONGEST_LEAD = 8  # samples
_SOURCE = "Bristow, Tharayil, Alleyne, IEEE Control Systems Magazine 26(3), 2006"


def _register(unit: str, law: str, doc: str) -> Any:
    """Declare a shift register, whose newest value is the first; see `_shift_laws`."""

    def place(age: int) -> Any:
        return Discrete(unit, update=f"{law}_{age}", period="sample_period", doc=doc)

    return Array(SAMPLES + _TAPS, place)


def _shift_laws(name: str, law: str) -> dict[str, Any]:
    """Return the laws of a shift register: at a sample, each place takes the value before it.

    Parameters
    ----------
    name : str
    law : str
        Law of the value that enters.

    Returns
    -------
    dict of str to callable
        ``<law>_1`` is that of the newest place.
    """

    def shifted(age: int) -> Callable[[Any], Any]:
        return lambda self: getattr(self, f"{name}[{age}]")

    laws = {f"{law}_{age + 1}": shifted(age) for age in range(1, SAMPLES + _TAPS)}
    return {f"{law}_1": lambda self: getattr(self, law)()} | laws


class LearningController(Component):
    """Iterative learning of the current for a periodic displacement, with a zero-phase filter and a
    lead.
    """

    name = "learning_controller"
    experiment = (100.0, 0.25)

    sample_period = Parameter(
        0.25, "s", min=1e-4, max=1e4, doc="sample period (h), a fortieth of the reference's period"
    )
    learning_gain = Parameter(
        1160.0,
        "A/m",
        min=0,
        max=1e12,
        nominal=1e3,
        source="half of 1 / (alpha R2 C) of the nominal actuator",
        tunable=True,
        doc="current learnt per error of the displacement (G)",
    )
    learning_time = Parameter(
        7.4,
        "s",
        min=0,
        max=1e6,
        source="h a / (1 - a) with the circuit's decay a per sample",
        tunable=True,
        doc="current learnt per rate of the error, over that per error (T_l)",
    )
    lead = Parameter(
        1,
        "1",
        type="integer",
        min=0,
        max=_LONGEST_LEAD,
        doc="samples by which a command is earlier than the error that it is learnt from (m)",
    )
    smoothing = Parameter(
        0.05,
        "1",
        min=0,
        max=0.5,
        nominal=0.1,
        source=_SOURCE,
        tunable=True,
        doc="weight of each neighbour in the zero-phase filter of the learnt command (q)",
    )
    current_limit = largest_current("largest current in either direction, learnt and commanded")

    reference = Input("m", nominal=1e-4, display="mm", doc="wanted displacement, periodic")
    displacement = Input("m", nominal=1e-4, display="mm", doc="measured displacement")
    feedback_command = Input("A", doc="command of a feedback controller, which is added")
    learning = Input(
        "1", start=True, type="boolean", doc="whether errors are learnt from; if not, it repeats"
    )

    previous_error = sampled_length("error", "error at the latest sample")
    lesson = _register("A", "next_lesson", "change to be learnt, the newest first")
    learnt = _register("A", "next_learnt", "learnt part of the command, the newest first")
    vars().update(_shift_laws("lesson", "next_lesson") | _shift_laws("learnt", "next_learnt"))

    def error(self) -> Any:
        """Reference less measured displacement, e."""
        return self.reference - self.displacement

    def next_lesson(self) -> Any:
        """Correction by the error, G (e + T_l de/dt), by the backward difference."""
        change = (self.error() - self.previous_error) / self.sample_period
        lesson = self.learning_gain * (self.error() + self.learning_time * change)
        return where(self.learning, lesson, 0.0)

    def lesson_with_lead(self, age: int) -> Any:
        """Correction of the command of ``age`` samples ago, which is younger by the lead."""
        return sum(
            where(self.lead == ahead, getattr(self, f"lesson[{age - ahead}]"), 0.0)
            for ahead in range(_LONGEST_LEAD + 1)
        )

    def improved(self, age: int) -> Any:
        """Command of ``age`` samples ago plus its correction."""
        return getattr(self, f"learnt[{age}]") + self.lesson_with_lead(age)

    def next_learnt(self) -> Any:
        """Corrected command of a period ago, smoothed with its neighbours in time."""
        centre = (1.0 - 2.0 * self.smoothing) * self.improved(SAMPLES)
        neighbours = self.improved(SAMPLES - _TAPS) + self.improved(SAMPLES + _TAPS)
        smooth = centre + self.smoothing * neighbours
        return clip(smooth, -self.current_limit, self.current_limit)

    def issued_current(self) -> Any:
        """Command of the controller to the actuator: learnt command plus feedback, limited."""
        newest: Any = getattr(self, "learnt[1]")
        total = newest + self.feedback_command
        return clip(total, -self.current_limit, self.current_limit)

    @Output("A")
    def command(self) -> Any:
        """Current for the actuator: learnt part held between samples, feedback part continuous."""
        return self.issued_current()
