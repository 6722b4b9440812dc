"""Small models whose fits are known on paper, and records of them."""

import numpy as np

from fmus.kit import Component, Input, Output, Parameter, State, sin
from orchestration.identify.fitting import Assumptions, FitData
from orchestration.identify.grey_box import fit_records

SIGMA = 0.3


class Plane(Component):
    """Linear in its parameters: y = a u + b v + c."""

    name = "plane"
    a = Parameter(1.0, "1", min=-1e3, max=1e3)
    b = Parameter(1.0, "1", min=-1e3, max=1e3)
    c = Parameter(0.0, "1", min=-1e3, max=1e3)
    u = Input("1")
    v = Input("1")

    @Output("1")
    def y(self):
        return self.a * self.u + self.b * self.v + self.c


class Decay(Component):
    """A state that falls from its start value."""

    name = "decay"
    rate = Parameter(1.0, "1/s", min=0)
    x = State("1", rate="x_rate", start=1.0)

    def x_rate(self):
        return -self.rate * self.x

    @Output("1")
    def y(self):
        return self.x


class Rise(Component):
    """The response of a lag to a step, from zero."""

    name = "rise"
    gain = Parameter(1.0, "1", min=0)
    tau = Parameter(5.0, "s", min=0)
    x = State("1", rate="x_rate")

    def x_rate(self):
        return (self.gain - self.x) / self.tau

    @Output("1")
    def y(self):
        return self.x


class Wave(Component):
    """A frequency, over which the error has many minima."""

    name = "wave"
    w = Parameter(1.0, "rad/s", min=0)
    t = Input("s")

    @Output("1")
    def y(self):
        return sin(self.w * self.t)


def columns(samples=60, seed=0):
    """Return the matrix (n, 3) of u, v and one."""
    random = np.random.default_rng(seed)
    return np.column_stack([random.normal(size=(samples, 2)), np.ones(samples)])


def plane_data(x, y, label=""):
    return FitData(np.arange(len(y)) * 1.0, {"u": x[:, 0], "v": x[:, 1]}, {"y": y}, label)


def noisy(x, parameters, seed=1, sigma=SIGMA):
    return x @ np.array(parameters) + np.random.default_rng(seed).normal(0, sigma, len(x))


def fitted(records, names=("a", "b", "c"), cls=Plane, start=None, **given):
    return fit_records(cls, records, list(names), start or {}, Assumptions(**given))
