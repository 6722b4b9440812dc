"""A system of a good member and one that fails as it is told to."""

from __future__ import annotations

import numpy as np

from tests.support.master.samples import ring

H = 0.1
TIME = H * np.arange(51)


OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)


def chain(fmu, **bad):
    return ring(fmu, {"good": {}, "bad": bad}, "good.x -> bad.u", u="good.u")


def ones(points=TIME.size):
    return {"u": np.ones(points)}
