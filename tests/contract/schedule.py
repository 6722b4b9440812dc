"""Random steps and inputs, and every bit of what an instance makes of them."""

from __future__ import annotations

import struct

import numpy as np

from tests.contract.raw import Instance, Library

Moves = list[tuple[float, dict[str, float]]]
_ACTUATORS = ("an", "po", "do", "pl")
FOOT_LOADS = [*(f"{name}_tension" for name in _ACTUATORS), "toe_force_x", "toe_force_y"]
_LENGTHS = ["length_change", *(f"{name}_displacement" for name in _ACTUATORS)]


def schedule(library: Library, seed: int, count: int) -> Moves:
    """Random steps and inputs; steps from far below to far above the one that the FMU proposes."""
    rng = np.random.default_rng(seed)
    inputs = [n for n, causality in library.causality.items() if causality == "input"]
    sizes = {"speed": 30.0, "growth": 0.0}
    sizes |= dict.fromkeys(FOOT_LOADS, 0.02) | dict.fromkeys(_LENGTHS, 1e-3)
    # springs so stiff that a step of its experiment takes seconds in Python
    longest = 0.2 * library.step if "an_flow" in library.variables else library.step
    moves = []
    for _ in range(count):
        values = {n: float(sizes.get(n, 1.0) * rng.uniform(-1, 1)) for n in inputs}
        values |= {
            n: float(abs(values[n]) > 0.2) for n in inputs if library.variables[n][1] == "Boolean"
        }
        moves.append((float(longest * 10 ** rng.uniform(-2, 1.3)), values))
    return moves


def go(one: Instance, moves: Moves) -> bytes:
    """Make the steps; every bit of every variable at every point."""
    trail = []
    for size, values in moves:
        one.set(values)
        one.step(size)
        trail += one.everything()
    return struct.pack(f"{len(trail)}d", *trail)


def continuation(one: Instance, state, time: float, moves: Moves) -> bytes:
    """Restore a state of this time, then make the steps."""
    one.restore(state)
    one.time = time
    return go(one, moves)
