"""Iterative learning for periodic references: the command of the last period, corrected by its
error.

The period of the reference is a fixed number of sample periods, the length of the registers. The
learnt command is added to that of a feedback controller.
"""

from __future__ import annotations

from typing import Any

from ..kit import Array, Discrete, Input, Output, Parameter, clip, where
from ..kit.errors import UserError
from .signals import CurrentController, largest_current, sampled_length

_TAPS = 1  # of the filter, to either side
_LONGEST_LEAD = 8  # samples
_SOURCE = "Bristow, Tharayil, Alleyne, IEEE Control Systems Magazine 26(3), 2006"


def _places(cls: Any) -> int:
    """Return the number of places of the registers of a class."""
    least = _LONGEST_LEAD + _TAPS + 1
    if cls.samples < least:
        raise UserError(f"{cls.name}: samples = {cls.samples}; a period has at least {least}")
    return int(cls.samples) + _TAPS


def _register(unit: str, law: str, doc: str) -> Any:
    """Declare a shift register, whose newest value is the first."""
    return Array(Discrete(unit, update=law, period="sample_period", doc=doc), _places)


class LearningController(CurrentController):
    """Iterative learning of the current for a periodic displacement, with a zero-phase filter and a
    lead.
    """

    name = "learning_controller"
    experiment = (100.0, 0.25)
    samples = 40  # of a period; a subclass may have another number

    sample_period = Parameter(
        0.25,
        "s",
        min=1e-4,
        max=1e4,
        doc="sample period (h), a whole fraction of the reference's period",
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
    # a lead of two samples and this smoothing converge for films that lag by up to 2 s
    lead = Parameter(
        2,
        "1",
        type="integer",
        min=0,
        max=_LONGEST_LEAD,
        doc="samples by which a command is earlier than the error that it is learnt from (m)",
    )
    smoothing = Parameter(
        0.25,
        "1",
        min=0,
        max=0.5,
        nominal=0.1,
        source=_SOURCE,
        tunable=True,
        doc="weight of each neighbour in the zero-phase filter of the learnt command (q)",
    )
    recentring = Parameter(
        0.0,
        "1",
        min=0,
        max=1.0,
        nominal=0.1,
        doc="share of the mean of a period that is taken off the learnt command: at 1, films that"
        " creep are moved about their rest length, at 0 the length is held (r)",
    )
    current_limit = largest_current("largest current in either direction, learnt and commanded")

    reference = Input("m", nominal=1e-4, display="mm", doc="wanted displacement, periodic")
    feedback_command = Input("A", doc="command of a feedback controller, which is added")
    learning = Input(
        "1", start=True, type="boolean", doc="whether errors are learnt from; if not, it repeats"
    )

    previous_error = sampled_length("error", "error at the latest sample")
    lesson = _register("A", "next_lesson", "change to be learnt, the newest first")
    learnt = _register("A", "next_learnt", "learnt part of the command, the newest first")

    def error(self) -> Any:
        """Reference less measured displacement, e."""
        return self.reference - self.displacement

    def next_lesson(self, age: int) -> Any:
        """Lesson of ``age`` samples ago, at the next sample."""
        return self.new_lesson() if age == 1 else self.lesson[age - 1]

    def new_lesson(self) -> Any:
        """Correction by the error, G (e + T_l de/dt), by the backward difference."""
        change = (self.error() - self.previous_error) / self.sample_period
        lesson = self.learning_gain * (self.error() + self.learning_time * change)
        return where(self.learning, lesson, 0.0)

    def lesson_with_lead(self, age: int) -> Any:
        """Correction of the command of ``age`` samples ago, which is younger by the lead."""
        return sum(
            where(self.lead == ahead, self.lesson[age - ahead], 0.0)
            for ahead in range(_LONGEST_LEAD + 1)
        )

    def improved(self, age: int) -> Any:
        """Command of ``age`` samples ago plus its correction."""
        return self.learnt[age] + self.lesson_with_lead(age)

    def next_learnt(self, age: int) -> Any:
        """Learnt command of ``age`` samples ago, at the next sample."""
        return self.new_learnt() if age == 1 else self.learnt[age - 1]

    def new_learnt(self) -> Any:
        """Corrected command of a period ago, smoothed with its neighbours in time."""
        centre = (1.0 - 2.0 * self.smoothing) * self.improved(self.samples)
        younger, older = self.samples - _TAPS, self.samples + _TAPS
        neighbours = self.improved(younger) + self.improved(older)
        smooth = centre + self.smoothing * neighbours
        centred = smooth - self.recentring * self.latest_mean()
        return clip(centred, -self.current_limit, self.current_limit)

    def latest_mean(self) -> Any:
        """Mean over the latest period of the learnt command with its lessons."""
        ages = range(1, self.samples + 1)
        return sum(self.learnt[age] + self.lesson[age] for age in ages) / self.samples

    def issued_current(self) -> Any:
        """Command of the controller to the actuator: learnt command plus feedback, limited."""
        total = self.learnt[1] + self.feedback_command
        return clip(total, -self.current_limit, self.current_limit)

    @Output("A")
    def command(self) -> Any:
        """Current for the actuator: learnt part held between samples, feedback part continuous."""
        return self.issued_current()
