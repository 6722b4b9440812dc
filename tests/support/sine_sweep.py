"""Frequency response of a system by co-simulation with sines of rising frequency.

The linear model is not used. Each frequency is run twice, with a sine and with its negative, about
the constant inputs of the operating point: half the difference is free of the response to these
inputs, and of even powers of the amplitude.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, pi

import numpy as np

from fmus.kit.arrays import Array
from orchestration.master import run
from orchestration.system import System

_CYCLES = 12  # cycles that are evaluated, and least number of cycles before them
_TREND = 3  # degree of the polynomial in time that removes a slow transient
_ROUNDING = 1e-9  # of a quotient that is a whole number but for the rounding of decimals


@dataclass(frozen=True)
class SineSweep:
    """Settings of a sine sweep.

    Attributes
    ----------
    frequencies : ndarray, shape (n,)
        Frequencies, Hz.
    amplitude : float
        Amplitude of the sine, in the unit of the input.
    period : float
        Sample period of the sine and of the outputs, s.
    step : float
        Largest communication step, s; it is reduced so that the period is a multiple of it.
    at : float
        Time of the operating point, s, at which the sine starts.
    settling : float
        Least duration of the sine before its evaluation, s; in any case at least twelve cycles.
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
        Constant inputs of the operating point.
    method : {"gauss-seidel", "jacobi"}
        Method of the master.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Complex frequency responses by output, of samples at the beginning of each period.
    """

    def simulate(time: Array, wave: Array) -> dict[str, Array]:
        """Return the outputs at communication points for a wave that is added to the input."""
        inputs = {name: np.full(time.size, value) for name, value in (constant or {}).items()}
        inputs[input] = inputs.get(input, np.zeros(time.size)) + wave
        result = run(system, time, inputs, record=list(outputs), method=method)
        assert result.complete, result.message
        return result.signals

    responses: dict[str, list[complex]] = {name: [] for name in outputs}
    for frequency in sweep.frequencies.tolist():
        instants, time, sine = _sine(sweep, frequency)
        positive = simulate(time, sweep.amplitude * sine)
        negative = simulate(time, -sweep.amplitude * sine)
        steps_per_period = (time.size - 1) // (instants.size - 1)
        evaluated = slice(-ceil(_CYCLES / frequency / sweep.period), None)
        for name, values in responses.items():
            # without the operating point and the even part of a nonlinearity
            odd = (positive[name] - negative[name]) / (2.0 * sweep.amplitude)
            samples = odd[::steps_per_period][evaluated]
            values.append(_complex_amplitude(samples, instants[evaluated], frequency))
    return {name: np.array(values) for name, values in responses.items()}


def _sine(sweep: SineSweep, frequency: float) -> tuple[Array, Array, Array]:
    """Return the instants of new values, the communication points, and the sine at the latter.

    Instants, s, are counted from the operating point, before which the sine is zero; communication
    points, s, from the start of the simulation.
    """
    evaluation_time = _CYCLES / frequency
    # numbers of periods
    before = ceil(sweep.at / sweep.period - _ROUNDING)
    settling = ceil(max(evaluation_time, sweep.settling) / sweep.period)
    count = before + settling + ceil(evaluation_time / sweep.period)
    instants = (np.arange(count + 1) - before) * sweep.period
    samples = np.where(instants >= 0.0, np.sin(2.0 * pi * frequency * instants), 0.0)
    steps_per_period = ceil(sweep.period / sweep.step - _ROUNDING)
    time = np.linspace(0.0, count * sweep.period, count * steps_per_period + 1)
    sine = np.append(np.repeat(samples[:-1], steps_per_period), samples[-1])
    return np.asarray(instants), np.asarray(time), sine


def _complex_amplitude(values: Array, time: Array, frequency: float) -> complex:
    """Return the complex amplitude of a sine in values with a slow trend, by least squares.

    The real part is in phase with the sine; `time` is in s, `frequency` in Hz.
    """
    angle = 2.0 * pi * frequency * time
    trend = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, time.size), _TREND)
    regressors = np.column_stack([np.sin(angle), np.cos(angle), trend])
    scale = np.abs(values).max() or 1.0
    in_phase, quadrature = np.linalg.lstsq(regressors, values / scale, rcond=None)[0][:2]
    return complex(in_phase, quadrature) * float(scale)
