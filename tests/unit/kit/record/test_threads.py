"""Claims: models are made in several threads at once, but only one makes expressions at a time.

CasADi ends the process if they do: four threads that made models of the voice coil came to a
segmentation fault within a minute.
"""

from __future__ import annotations

import math
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Lock

import numpy as np
import pytest

from fmus.kit import Component, Output, Parameter, State
from fmus.kit.record import compiled as kit_compiled
from fmus.kit.record.compiled import CompiledModel

TIME = np.linspace(0.0, 0.5, 500)


class Decay(Component):
    """A decay."""

    name = "decay"
    a = Parameter(2.0, "1/s", min=1e-6)
    x = State("1", rate="x_rate", start=1.0)

    def x_rate(self):
        return -self.a * self.x

    @Output("1")
    def y(self):
        """Return the state."""
        return self.x


@pytest.mark.parametrize("step", ["trace", "with_sensitivities", "hoist"])
def test_expressions_are_made_by_one_thread_at_a_time(monkeypatch, step):
    lock, at_once, most = Lock(), 0, 0
    original = getattr(kit_compiled, step)

    def watched(*arguments):
        nonlocal at_once, most
        with lock:
            at_once += 1
            most = max(most, at_once)
        time.sleep(0.02)
        try:
            return original(*arguments)
        finally:
            with lock:
                at_once -= 1

    monkeypatch.setattr(kit_compiled, step, watched)
    with ThreadPoolExecutor(4) as pool:
        ran = list(
            pool.map(
                lambda _: CompiledModel(Decay, ["a"]).run(np.array([0.0, 0.5]), {}).signals["y"][1],
                range(4),
            )
        )
    assert ran == pytest.approx([math.exp(-1.0)] * 4, rel=1e-7)
    assert most == 1


def test_one_model_serves_several_threads():
    model, rates = CompiledModel(Decay, ["a"]), np.linspace(1.0, 3.0, 8)
    with ThreadPoolExecutor(4) as pool:
        ran = list(
            pool.map(lambda a: model.run(TIME, {}, {"a": a}).sensitivities["y"][-1, 0], rates)
        )
    assert ran == pytest.approx(-0.5 * np.exp(-0.5 * rates), rel=1e-6)
