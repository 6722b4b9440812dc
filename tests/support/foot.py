"""The foot as points in the plane: table 5-1 typed in again, complex numbers for points, x + 1j y,
the ankle at 0.
"""

import math
from functools import cache

import numpy as np

from fmus.foot.model import Foot
from fmus.kit.symbolic.tracing import trace

ACTUATORS, JOINTS = ("an", "po", "do", "pl"), ("ankle", "tm", "mtp")
RANGES = {"ankle": (-0.7, 0.7), "tm": (-0.26, 0.26), "mtp": (-0.15, 1.05)}
traced = cache(trace)


def turned(degrees: float) -> complex:
    return complex(math.cos(math.radians(degrees)), math.sin(math.radians(degrees)))


def toe_at(ankle: float, tm: float, mtp: float) -> complex:
    turn, point = 1 + 0j, 0j
    for link, beta, angle in ((50.8e-3, 49.0, ankle), (62.5e-3, 30.9, tm), (23.6e-3, 10.1, mtp)):
        turn *= turned(beta) * complex(math.cos(angle), math.sin(angle))
        point += link * turn
    return point


def lengths_at(ankle: float, mtp: float) -> list[float]:
    heel, instep = 41.7e-3 * turned(-57.7), 18.0e-3 * turned(50.7)
    calf, shin = heel - 93.2e-3 * turned(-12.9), instep - 97.5e-3 * turned(6.1)
    toe = 23.1e-3 + 0j
    dorsal = toe - 113.3e-3 * turned(-15.1)

    def spin(angle):
        return complex(math.cos(angle), math.sin(angle))

    return [
        abs(spin(ankle) * instep - shin),
        abs(spin(ankle) * heel - calf),
        abs(spin(mtp) * toe - dorsal),
        139.2e-3 + 16.3e-3 * mtp,
    ]


def postures(count: int, seed: int = 0) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    return {f"{joint}_angle": random.uniform(*RANGES[joint], count) for joint in JOINTS}


def one_by_one(count: int):
    drawn = postures(count, 7)
    return [{name: float(values[i]) for name, values in drawn.items()} for i in range(count)]


def outputs(component) -> dict[str, float]:
    return dict(zip([o.name for o in component.layout.outputs], component.outputs(), strict=True))


def jacobian(values: dict[str, float]):
    """Derivative of an output by an input, by CasADi: ``of(output, input)``."""
    graph = traced(Foot)
    d = graph.linearise(**values)[3]
    rows, columns = (
        {v.name: i for i, v in enumerate(g)} for g in (graph.layout.outputs, graph.layout.inputs)
    )
    return lambda output, given: d[rows[output], columns[given]]
