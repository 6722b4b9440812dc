"""State-space models from blocks: continuous, or exactly discretised between the samples of clocks.

Inputs are constant over the period of the model. Within it the clocks sample in the order of the
engine of a component, and between two samples the continuous states follow the matrix exponential.
Outputs are those at the beginning of the period, before a sample at that instant, as an FMU shows
them at a communication point.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.linear.blocks import LinearBlocks, SampledUpdate

_SAME = 1e-9  # largest relative difference due to rounding
_LARGEST_RATIO = 10_000  # numerator or denominator of the ratio of two periods
_MOST_SAMPLES = 100_000  # of all clocks in a hyper-period


@dataclass(frozen=True)
class Matrices:
    """A state-space model x' = A x + B u, y = C x + D u.

    Attributes
    ----------
    A, B, C, D : ndarray
    period : float
        Sample period, s, where x' is the next state; 0 of a continuous model, where it is the
        derivative of the state.
    states : tuple of str
        Names of the states.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    period: float
    states: tuple[str, ...]

    @property
    def by_name(self) -> dict[str, Array]:
        """A, B, C and D by their names."""
        return {"A": self.A, "B": self.B, "C": self.C, "D": self.D}


def hyper_period(periods: Mapping[str, float]) -> float:
    """Return the least common multiple of the periods of clocks.

    Parameters
    ----------
    periods : Mapping of str to float
        Period by clock, s.

    Returns
    -------
    float
        Seconds.

    Raises
    ------
    UserError
        If a ratio of periods is not one of small whole numbers, or the result is too long.
    """
    fastest = min(periods, key=lambda clock: periods[clock])
    shortest = periods[fastest]
    ratios = [_ratio(periods, clock, fastest) for clock in periods]
    # least common multiple of fractions in their lowest terms, in shortest periods
    span = Fraction(lcm(*(r.numerator for r in ratios)), gcd(*(r.denominator for r in ratios)))
    if sum(span / ratio for ratio in ratios) > _MOST_SAMPLES:
        clocks = ", ".join(f"{clock} = {period:g} s" for clock, period in periods.items())
        raise UserError(
            f"{clocks}: more than {_MOST_SAMPLES:,} samples in their common hyper-period"
        )
    return float(span) * shortest


def _ratio(periods: Mapping[str, float], clock: str, fastest: str) -> Fraction:
    """Return the ratio of two periods; UserError if it is not one of small whole numbers."""
    exact = periods[clock] / periods[fastest]
    ratio = Fraction(exact).limit_denominator(_LARGEST_RATIO)
    if abs(float(ratio) - exact) > _SAME * exact:
        raise UserError(
            f"{clock} = {periods[clock]:g} s and {fastest} = {periods[fastest]:g} s have no common"
            f" hyper-period: their ratio is not one of whole numbers up to {_LARGEST_RATIO:,}"
        )
    return ratio


def assemble(blocks: LinearBlocks, outputs: Sequence[str], step: float = 0.0) -> Matrices:
    """Return a state-space model of blocks.

    Parameters
    ----------
    blocks : LinearBlocks
    outputs : sequence of str
    step : float
        Time over which inputs are constant, s; 0 if they are continuous.

    Returns
    -------
    Matrices
        Continuous if there is neither a clock nor a step. Else discrete, with the continuous states
        and then the discrete states before the sample.

    Raises
    ------
    UserError
        If the clocks have no common hyper-period.
    """
    width = len(blocks.columns)
    n = width - len(blocks.inputs)
    rows = np.array([blocks.signals[name] for name in outputs]).reshape(len(outputs), width)
    names = (*blocks.states, *blocks.discretes)
    C = rows[:, :n]
    D = rows[:, n:]
    clocks = {update.clock: update.period for update in blocks.updates}
    if step:
        clocks["the communication step"] = step
    if not clocks:
        return Matrices(blocks.rates[:, :n], blocks.rates[:, n:], C, D, 0.0, names)
    period = hyper_period(clocks)
    transition = _transition(blocks, period)
    return Matrices(transition[:n, :n], transition[:n, n:], C, D, period, names)


def _transition(blocks: LinearBlocks, period: float) -> Array:
    """Return the transition matrix of states, discrete states and inputs over a hyper-period.

    It is the product of flows of the continuous states between samples, and of jumps of the
    discrete states at samples.

    Returns
    -------
    ndarray, shape (n, n)
        With the n columns of the blocks.
    """
    from scipy.linalg import expm

    width = len(blocks.columns)
    n = len(blocks.states)
    generator = np.zeros((width, width))
    generator[:n] = blocks.rates
    flows: dict[float, Array] = {}

    def flow(duration: float) -> Array:
        """Return the transition matrix between samples; equal durations differ by rounding."""
        key = round(duration / period, 12)
        if key not in flows:
            flows[key] = expm(generator * duration)
        return flows[key]

    result = np.eye(width)
    now = 0.0
    for instant, update in _samples(blocks.updates, period):
        if instant - now > _SAME * period:
            result = flow(instant - now) @ result
            now = instant
        jump = np.eye(width)
        jump[[n + row for row in update.rows]] = update.matrix
        result = jump @ result
    if period - now > _SAME * period:
        result = flow(period - now) @ result
    return result


def _samples(
    updates: Sequence[SampledUpdate], period: float
) -> Iterator[tuple[float, SampledUpdate]]:
    """Yield the instant in s and the update of every sample in a hyper-period.

    Instants that differ by rounding, such as 3 * 0.1 and 0.3, are one, with samples in the order of
    the updates.
    """
    exact: list[tuple[float, int]] = []
    for index, update in enumerate(updates):
        shift = update.shift % update.period
        if update.period - shift <= _SAME * update.period:
            shift = 0.0  # a whole number of periods, such as 0.3 % 0.1 = 0.09999999999999998
        count = round(period / update.period)
        exact += [(shift + k * update.period, index) for k in range(count)]
    common = 0.0  # instant of the first of the samples that are one but for rounding
    rounded: list[tuple[float, int]] = []
    for instant, index in sorted(exact):
        if instant - common > _SAME * period:
            common = instant
        rounded.append((common, index))
    for instant, index in sorted(rounded):
        yield instant, updates[index]
