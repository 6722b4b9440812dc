"""Coupling error of the systems that ship: its order in the communication step, and its energy."""

from __future__ import annotations

from collections.abc import Callable
from math import isnan
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from orchestration.master.reference.coupling_error import CouplingError, coupling_error
from orchestration.system import library

from .tables import Cell, Table, Topic

_PERIOD = 1.0 / 30.0  # s, of the bench's controller

# Steps, duration, inputs and what to look at: taut and away from limits throughout, and the
# controller samples at communication points, so that nothing kinks between them.
SMOOTH: dict[str, tuple[list[float], float, dict[str, Callable[[Array], Array]], str]] = {
    "dma_bench": (
        [_PERIOD / 128, _PERIOD / 256, _PERIOD / 512],
        2 * _PERIOD,
        {"force_reference": lambda t: np.full(t.size, 1.0)},
        "bench.position",
    ),
    "foot_gait": (
        [4e-4, 2e-4, 1e-4],
        0.1,
        {"an_current": lambda t: np.sin(20.0 * t), "pl_current": lambda t: -0.5 * np.sin(30.0 * t)},
        "foot.ankle_angle",
    ),
}
WAYS: dict[str, dict[str, Any]] = {
    f"{title}, {inputs}{where}": {
        "method": method,
        "extrapolation": extrapolation,
        "feedthrough": feedthrough,
    }
    for feedthrough, where in ((True, ""), (False, ", strict"))
    for extrapolation, inputs in ((0, "held"), (1, "linear"))
    for method, title in (("jacobi", "Jacobi"), ("gauss-seidel", "Gauss-Seidel"))
}


def measured(name: str, quick: bool = False, **options: Any) -> CouplingError:
    """Coupling error of a system that ships."""
    steps, stop, inputs, _ = SMOOTH[name]
    return coupling_error(
        library.system(name), steps[: 2 if quick else None], stop, inputs, **options
    )


def measure(quick: bool = False) -> Topic:
    """Run every system in every way at every step."""
    parts: list[str | Table] = [
        "Largest difference from the fused system, over the largest value, and the slope of its"
        " logarithm over that of the step. Inputs of members are held over a step, or extrapolated"
        " linearly. Outputs are read after all inputs of a point are set; *strict*, as libcosim and"
        " Ecos read them, they are taken as they stand after a step. *Energy* is what the"
        " mechanical couplings make out of nothing, over the work they exchange, at worst and in"
        " the shortest step; below 1e-7 it is the integration's and has no order."
    ]
    for name in list(SMOOTH)[: 1 if quick else None]:
        steps, stop, _, signal = SMOOTH[name]
        rows = [
            _row(way, measured(name, quick, **options), signal) for way, options in WAYS.items()
        ]
        columns = [
            "",
            *(f"{1e3 * step:.3g} ms" for step in steps[: len(rows[0]) - 4]),
            "order",
            "energy",
            "its order",
        ]
        parts += [f"`{name}` for {1e3 * stop:.3g} ms, `{signal}`:", Table(columns, rows)]
    return Topic("Coupling error", parts)


def _row(way: str, found: CouplingError, signal: str) -> list[Cell]:
    row: list[Cell] = [way, *map(float, found.errors[signal]), round(found.order(signal), 2)]
    if not found.imbalances:
        return [*row, "", ""]
    worst = max(found.imbalances, key=lambda name: found.imbalances[name][-1])
    order = found.order(worst)
    return [*row, f"{found.imbalances[worst][-1]:.3g}", "" if isnan(order) else f"{order:.2f}"]
