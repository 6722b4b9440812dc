"""Two vessels as a component: laws that act alike and others, and a gain of an output."""

from __future__ import annotations

import numpy as np

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.arrays import Array
from orchestration.diagnosis import LawModel, Record
from orchestration.diagnosis.responses import Drives
from orchestration.diagnosis.runs import Course, Setting


class Vessels(Component):
    """Two vessels with a leak, an inlet and a flow between them."""

    name = "vessels"
    opening = Parameter(0.5, "1/s", min=0.0)
    gain = Parameter(2.0, "1", min=0.0)
    inlet = Input("m^3/s", nominal=1.0)
    a = State("m^3", rate="filling", nominal=1.0)
    b = State("m^3", rate="following", nominal=1.0)

    def leak(self):
        """Lost."""
        return 0.1 * self.opening * self.a

    def flow(self):
        """From one to the other."""
        return self.opening * (self.a - self.b)

    def filling(self):
        """Balance."""
        return self.inlet - self.leak() - self.flow()

    def following(self):
        """Balance."""
        return self.flow() - 0.2 * self.b

    @Output("m^3", nominal=1.0)
    def first(self):
        """As seen."""
        return self.a

    @Output("m^3", nominal=1.0)
    def second(self):
        """As seen."""
        return self.gain * self.b


def vessels() -> tuple[LawModel, Record, Setting, Course]:
    """Return the model with a record, and its course."""
    model = LawModel(Vessels)
    time = np.linspace(0.0, 5.0, 201)
    record = Record(time, np.sin(time)[:, None].copy(), np.zeros((201, 2)), (True,))
    parameters = np.array([float(p.start) for p in model.parameters])
    setting = Setting(parameters, np.array([0, 1]))
    course = model.run(record, setting, np.array([1.0, 0.5]), sensitive=True)
    assert course is not None
    return model, record, setting, course


def drives_of(drive: Array, laws: Array) -> Drives:
    """Return columns (n, c) of additions to laws, each of which is a course of its own."""
    columns = np.arange(len(laws))
    return Drives(drive.T, np.ones((1, len(drive))), np.array([laws, columns, 0 * columns]))
