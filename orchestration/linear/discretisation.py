"""From blocks to one state-space model: continuous, or exact between the samples of all clocks.

Inputs are held over the period of the model. Within it, every clock samples when it is due, in the
order in which the engine of a component does; between two samples the continuous states follow
their matrix exponential. Outputs are those at the beginning of the period, before a sample that is
due there, which is what an FMU shows at a communication point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.linear.blocks import LinearBlocks

_SAME = 1e-9  # relative difference of periods that are in a ratio of whole numbers but for rounding
_LARGEST_RATIO = 10_000  # numerator or denominator of such a ratio
_MOST_SAMPLES = 100_000  # of all clocks in a hyper-period


@dataclass(frozen=True)
class Matrices:
    """A state-space model x' = A x + B u, y = C x + D u.

    Attributes
    ----------
    A, B, C, D : ndarray
    period : float
        Sample period, s; 0 of a continuous model, where x' is the derivative, not the next value.
    states : tuple of str
    """

    A: Array
    B: Array
    C: Array
    D: Array
    period: float
    states: tuple[str, ...]


def hyper_period(periods: Mapping[str, float]) -> float:
    """Return the least common multiple of the periods of clocks, s.

    Parameters
    ----------
    periods : Mapping of str to float
        Seconds, by the name of the clock.

    Raises
    ------
    UserError
        If their ratios are none of small whole numbers.
    """
    name, shortest = min(periods.items(), key=lambda one: one[1])
    ratios = []
    for other, period in periods.items():
        exact = period / shortest
        ratio = Fraction(exact).limit_denominator(_LARGEST_RATIO)
        if abs(float(ratio) - exact) > _SAME * exact:
            raise UserError(
                f"{other} = {period:g} s and {name} = {shortest:g} s have no common hyper-period:"
                f" their ratio is not one of whole numbers up to {_LARGEST_RATIO:,}"
            )
        ratios.append(ratio)
    common = lcm(*(ratio.denominator for ratio in ratios))
    span = Fraction(lcm(*(int(ratio * common) for ratio in ratios)), common)
    if sum(span / ratio for ratio in ratios) > _MOST_SAMPLES:
        clocks = ", ".join(f"{clock} = {period:g} s" for clock, period in periods.items())
        raise UserError(
            f"{clocks}: more than {_MOST_SAMPLES:,} samples in their common hyper-period"
        )
    return float(span) * shortest


def assemble(blocks: LinearBlocks, outputs: Sequence[str], step: float = 0.0) -> Matrices:
    """Make one model of blocks.

    Parameters
    ----------
    blocks : LinearBlocks
    outputs : sequence of str
    step : float
        Time over which inputs are held, s, where nothing is sampled; 0 of a continuous model.

    Returns
    -------
    Matrices
        Continuous where nothing is sampled or held; else discrete, its states the continuous ones
        and then the discrete ones before the sample.

    Raises
    ------
    UserError
        If the clocks have no common hyper-period.
    """
    width = len(blocks.columns)
    inputs = len(blocks.inputs)
    n = width - inputs
    read = np.array([blocks.signals[name] for name in outputs]).reshape(len(outputs), width)
    names = (*blocks.states, *blocks.discretes)
    C, D = read[:, :n], read[:, n:]
    clocks = {update.clock: update.period for update in blocks.updates}
    if step:
        clocks["the communication step"] = step
    if not clocks:
        return Matrices(blocks.rates[:, :n], blocks.rates[:, n:], C, D, 0.0, names)
    period = hyper_period(clocks)
    whole = _over_period(blocks, period)
    return Matrices(whole[:n, :n], whole[:n, n:], C, D, period, names)


def _over_period(blocks: LinearBlocks, period: float) -> Array:
    """Return the map of states, discrete states and inputs over a hyper-period."""
    from scipy.linalg import expm

    width = len(blocks.columns)
    n = len(blocks.states)
    generator = np.zeros((width, width))
    generator[:n] = blocks.rates
    instants = sorted(
        (shift + k * update.period, order)
        for order, update in enumerate(blocks.updates)
        for shift in [update.shift % update.period]
        for k in range(round(period / update.period))
    )
    flows: dict[float, Array] = {}

    def flow(duration: float) -> Array:
        # equal intervals differ by rounding
        key = round(duration / period, 12)
        if key not in flows:
            flows[key] = expm(generator * duration)
        return flows[key]

    whole = np.eye(width)
    now = 0.0
    for instant, order in instants:
        if instant - now > _SAME * period:
            whole = flow(instant - now) @ whole
            now = instant
        update = blocks.updates[order]
        sample = np.eye(width)
        sample[[n + row for row in update.rows]] = update.matrix
        whole = sample @ whole
    if period - now > _SAME * period:
        whole = flow(period - now) @ whole
    return whole
