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

    Raises
    ------
    UserError
        If frequencies, amplitude, period or step are not above zero, or there is no frequency.
    """

    frequencies: Array
    amplitude: float
    period: float
    step: float
    at: float = 0.0
    settling: float = 0.0

    def __post_init__(self) -> None:
        for name in ("frequencies", "amplitude", "period", "step"):
            values = np.asarray(getattr(self, name), dtype=float)
            if not values.size or not np.all((values > 0.0) & np.isfinite(values)):
                raise UserError(f"{name} = {getattr(self, name)}: finite, and above 0")


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
            f"{highest:g} Hz: a sine that is held for {sweep.period:g} s has {_FEWEST:g} values in"
            f" a cycle up to {1.0 / (_FEWEST * sweep.period):g} Hz"
        )

    def signals(frequency: float, amplitude: float) -> tuple[Array, list[Array]]:
        """Return the instants at which outputs are read, and these for a sine."""
        instants, time, wave = _sine(sweep, frequency)
        inputs = {name: np.full(time.size, value) for name, value in (constant or {}).items()}
        inputs[input] = inputs.get(input, np.zeros(time.size)) + amplitude * wave
        result = run(system, time, inputs, record=list(outputs), method=method)
        if not result.complete:
            raise UserError(result.message)
        held = (time.size - 1) // (instants.size - 1)
        return instants, [result.signals[name][::held] for name in outputs]

    responses: dict[str, list[complex]] = {name: [] for name in outputs}
    for frequency in sweep.frequencies.tolist():
        instants, up = signals(frequency, sweep.amplitude)
        _, down = signals(frequency, -sweep.amplitude)
        last = slice(-ceil(_CYCLES / frequency / sweep.period), None)
        for name, plus, minus in zip(outputs, up, down, strict=True):
            half = (plus - minus)[last] / (2.0 * sweep.amplitude)
            responses[name].append(_fitted(half, instants[last], frequency))
    return {name: np.array(values) for name, values in responses.items()}


def _sine(sweep: SineSweep, frequency: float) -> tuple[Array, Array, Array]:
    """Return instants of the held values, communication points, and the sine at these.

    Instants count from the operating point; the sine is zero before.
    """
    held = ceil(sweep.period / sweep.step - 1e-9)
    before = ceil(sweep.at / sweep.period - 1e-9)
    cycles = _CYCLES / frequency
    driven = ceil(cycles / sweep.period) + ceil(max(cycles, sweep.settling) / sweep.period)
    instants = (np.arange(before + driven + 1) - before) * sweep.period
    time = np.linspace(0.0, (before + driven) * sweep.period, (before + driven) * held + 1)
    sine = np.where(instants >= 0.0, np.sin(2.0 * pi * frequency * instants), 0.0)
    return np.asarray(instants), np.asarray(time), np.append(np.repeat(sine[:-1], held), sine[-1])


def _fitted(values: Array, time: Array, frequency: float) -> complex:
    """Return the complex amplitude of a sine in values that have a slow trend besides."""
    angle = 2.0 * pi * frequency * time
    trend = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, time.size), _TREND)
    regressors = np.column_stack([np.sin(angle), np.cos(angle), trend])
    scale = np.abs(values).max() or 1.0
    in_phase, quadrature = np.linalg.lstsq(regressors, values / scale, rcond=None)[0][:2]
    return complex(in_phase, quadrature) * float(scale)
