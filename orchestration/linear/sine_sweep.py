"""Frequency response measured: a system co-simulated under sines of rising frequency.

Nothing of the linear model is used. Each frequency is run twice, with a sine and with its negative,
about the constant inputs of the operating point: half the difference is free of whatever the system
does by itself, and of even powers of the amplitude.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, pi

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.master import run
from orchestration.system import System

_CYCLES = 12  # that are evaluated, after as many or more
_TREND = 3  # power of time to which a slow transient is taken out
_FEWEST = 4.0  # samples in a cycle


@dataclass(frozen=True)
class SineSweep:
    """How a frequency response is measured.

    Attributes
    ----------
    frequencies : ndarray, shape (n,)
        In Hz.
    amplitude : float
        Of the sine, in the unit of the input.
    period : float
        Time for which each value of the sine is held, and after which outputs are read, s.
    step : float
        Communication step, s, at most; it is shortened so that the period is a multiple of it.
    at : float
        Time of the operating point, s, from which on there is a sine.
    settling : float
        Time of the sine before it is evaluated, s, at least; it covers twelve cycles, too.
    """

    frequencies: Array
    amplitude: float
    period: float
    step: float
    at: float = 0.0
    settling: float = 0.0


def sine_sweep(
    system: System,
    input: str,
    outputs: Sequence[str],
    sweep: SineSweep,
    constant: Mapping[str, float] | None = None,
    *,
    method: str = "gauss-seidel",
) -> dict[str, Array]:
    """Measure frequency responses of a system by co-simulation.

    Parameters
    ----------
    system : System
    input : str
        Input of the system, or an input ``member.variable`` to which nothing is connected.
    outputs : sequence of str
        Variables ``member.variable``.
    sweep : SineSweep
    constant : Mapping of str to float, optional
        Inputs of the operating point.
    method : {"gauss-seidel", "jacobi"}
        Of the master.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Complex responses by output, as samples at the beginning of each period have them.

    Raises
    ------
    UserError
        If a frequency is too high for the period, or a run fails.
    """
    highest = float(np.max(sweep.frequencies))
    if highest * sweep.period * _FEWEST > 1.0:
        raise UserError(
            f"{highest:g} Hz: a sine that is held for {sweep.period:g} s has {_FEWEST:g} values in a"
            f" cycle up to {1.0 / (_FEWEST * sweep.period):g} Hz"
        )
    constants = dict(constant or {})
    rows = [
        _at_frequency(system, input, outputs, sweep, constants, float(f), method)
        for f in sweep.frequencies
    ]
    return {name: np.array([row[k] for row in rows]) for k, name in enumerate(outputs)}


def _at_frequency(
    system: System,
    input: str,
    outputs: Sequence[str],
    sweep: SineSweep,
    constants: Mapping[str, float],
    frequency: float,
    method: str,
) -> Array:
    held = ceil(sweep.period / sweep.step - 1e-9)
    before = ceil(sweep.at / sweep.period - 1e-9)
    cycles = _CYCLES / frequency
    evaluated = ceil(cycles / sweep.period)
    driven = evaluated + ceil(max(cycles, sweep.settling) / sweep.period)
    instants = (np.arange(before + driven + 1) - before) * sweep.period
    angle = 2.0 * pi * frequency * instants
    sine = np.where(instants >= 0.0, np.sin(angle), 0.0)
    time = np.linspace(0.0, (before + driven) * sweep.period, (before + driven) * held + 1)
    courses = {name: np.full(time.size, value) for name, value in constants.items()}
    level = courses.pop(input, np.zeros(time.size))
    wave = np.append(np.repeat(sine[:-1], held), sine[-1])

    def signals(amplitude: float) -> list[Array]:
        inputs = courses | {input: level + amplitude * wave}
        result = run(system, time, inputs, record=list(outputs), method=method)
        if not result.complete:
            raise UserError(result.message)
        return [result.signals[name][::held] for name in outputs]

    differences = zip(signals(sweep.amplitude), signals(-sweep.amplitude), strict=True)
    last = slice(-evaluated, None)
    return np.array(
        [
            _fitted((plus - minus)[last] / (2.0 * sweep.amplitude), instants[last], frequency)
            for plus, minus in differences
        ]
    )


def _fitted(values: Array, time: Array, frequency: float) -> complex:
    """Return the complex amplitude of a sine in values that have a slow trend besides."""
    angle = 2.0 * pi * frequency * time
    trend = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, time.size), _TREND)
    regressors = np.column_stack([np.sin(angle), np.cos(angle), trend])
    scale = np.abs(values).max() or 1.0
    in_phase, quadrature = np.linalg.lstsq(regressors, values / scale, rcond=None)[0][:2] * scale
    return complex(in_phase, quadrature)
