"""Section 4.3, fig. 4-8: batch and recursive least squares at 15 Hz, square-wave voltage."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from math import exp, log, pi
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from demonstrations.graphical import least_squares_windows, magnitude, tustin
from demonstrations.thesis.actuator import CURRENT_LIMIT
from demonstrations.thesis.circuit import CIRCUIT
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration
from demonstrations.thesis.forgetting import recursive
from demonstrations.thesis.identification import MEANS
from fmus.kit.arrays import Array
from orchestration.experiment.waveforms import square_wave
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RATE = 15.0  # Hz
FREQUENCY = 0.1  # Hz
AMPLITUDE = 0.6  # V: 1.2 V peak to peak
FORGETTING = 0.985
_FINE = 1000.0  # Hz, of the samples for the time with limited current
RESET = 75  # samples of "approximately 5 seconds"
# the axes of the plot in appendix A3
DURATION = 160.0  # s
BEGIN = 20.0  # s
# V, of the voltage control (table 2-2), used as the standard deviation of white noise
TOLERANCE = 3e-3
FIVE_LAYERS = (1.32, 2.72, 0.46)  # ohm, ohm, F, section 3.3.1
AXES = ((1.0, 4.5), (0.5, 2.0), (0.0, 1.0))  # ohm, ohm, F, appendix A3
_NAMES = ("R1", "R2", "C")
_UNITS = ("ohm", "ohm", "F")
_TEST = "demonstrations/thesis/analyses/test_potentiostat"
_BLUE = pictures.MODEL
_RED = pictures.FITTED
_GREY = pictures.MEASURED


def entries() -> Iterator[Entry]:
    """Yield claims and errata about fig. 4-8, whose data are not printed."""
    for part in (_limited, _without_noise, _with_noise, _axes):
        yield from part()


# --- the record
# --------------------------------------------------------------------------------------------------


def controlled(target: Array, limit: float, period: float = 1.0 / RATE) -> tuple[Array, Array]:
    """Return current and voltage of the circuit of table 3-1 at a current-limited potentiostat.

    The circuit is at rest at first. Where the target needs more than the limit, the current is at
    the limit until the voltage reaches the target.

    Parameters
    ----------
    target : ndarray, shape (n,)
        Voltage in V, constant from sample to sample.
    limit : float
        Limit of the current, A; may be infinite.
    period : float
        Seconds.

    Returns
    -------
    current, voltage : ndarray, shape (n,)
        A and V at the samples.
    """
    r1, r2, c = CIRCUIT
    conductance = 1.0 / r1 + 1.0 / r2
    slow = (r1 + r2) * c
    inner = 0.0  # V, of the capacitance
    current = np.empty_like(target)
    voltage = np.empty_like(target)
    for k, wanted in enumerate(target.tolist()):
        current[k] = conductance * wanted - inner / r1
        voltage[k] = wanted
        left = period
        if abs(current[k]) > limit:
            current[k] = np.copysign(limit, current[k])
            voltage[k] = (current[k] + inner / r1) / conductance
            reached = r1 * (conductance * wanted - current[k])
            final = r2 * current[k]
            share = (final - reached) / (final - inner)
            limited = min(left, -slow * log(share)) if share > 0.0 else left
            inner = final + (inner - final) * exp(-limited / slow)
            left -= limited
        inner = wanted + (inner - wanted) * exp(-left / (r1 * c))
    return current, voltage


class Estimates(NamedTuple):
    """Circuits (m, 3) in ohm and F and impedances (m,) in ohm, at times (m,) in s."""

    time: Array
    circuit: Array
    impedance: Array


@cache
def record(limit: float = CURRENT_LIMIT, noise: float = TOLERANCE) -> tuple[Array, Array, Array]:
    """Return time (s), current (A) and voltage (V) of fig. 4-8 for the circuit of table 3-1."""
    time = np.asarray(np.arange(round(DURATION * RATE) + 1) / RATE, dtype=np.float64)
    current, voltage = controlled(square_wave(time, AMPLITUDE, FREQUENCY), limit)
    return time, current, voltage + noise * np.random.default_rng(0).standard_normal(time.size)


@cache
def batch(limit: float = CURRENT_LIMIT, noise: float = TOLERANCE) -> Estimates:
    """Return estimates by least squares in every period, by eqs. 4.3 to 4.5, from 20 s."""
    _, current, voltage = record(limit, noise)
    windows = least_squares_windows(
        current,
        voltage,
        1.0 / RATE,
        round(RATE / FREQUENCY),
        angular_frequency=2.0 * pi * FREQUENCY,
    )
    shown = windows.end > BEGIN
    return Estimates(windows.end[shown], windows.circuit[shown], windows.impedance[shown])


@cache
def online(limit: float = CURRENT_LIMIT, noise: float = TOLERANCE) -> Estimates:
    """Return estimates by recursive least squares with forgetting and resets (A3), from 20 s."""
    time, current, voltage = record(limit, noise)
    shown = time[1:] >= BEGIN
    circuit = tustin(
        recursive(current, voltage, FORGETTING, FORGETTING, 1.0, RESET)[shown], 1.0 / RATE
    )
    return Estimates(time[1:][shown], circuit, magnitude(circuit, 2.0 * pi * FREQUENCY))


def limited_share(limit: float = CURRENT_LIMIT) -> float:
    """Return the share of the time in which the current of fig. 4-8 is at its limit.

    After each step of the voltage the current is at its limit until the capacitance is charged far
    enough. The time is counted on a fine grid that has the steps among its points.
    """
    half = round(_FINE * 0.5 / FREQUENCY)
    time = np.arange(round(DURATION * FREQUENCY / 0.5) * half) / _FINE
    current, _ = controlled(square_wave(time, AMPLITUDE, FREQUENCY), limit, 1.0 / _FINE)
    return float(np.mean(np.abs(current) >= limit))


# --- claims
# --------------------------------------------------------------------------------------------------


def _limited() -> Iterator[Entry]:
    _, current, _ = record(np.inf, 0.0)
    most = float(np.abs(current).max())
    half = 0.5 / FREQUENCY
    share = 100.0 * limited_share()
    yield Claim(
        "fig. 4-8 against table 2-2",
        f"current that ±{AMPLITUDE:g} V take",
        f"≤{CURRENT_LIMIT:g}",
        most,
        "A",
        "circuit of table 3-1, of 12 layers too; the actuator of fig. 4-8 is not printed",
        erratum=42,
        inferred=True,
    )
    yield Erratum(
        42,
        "section 4.3, fig. 4-8, against table 2-2",
        "a square wave of 1.2 V peak to peak at 0.1 Hz",
        f"the circuit of table 3-1 takes {most:.1f} A when the voltage turns, for its capacitance"
        f" has charged for {half:g} s; the potentiostat gives {CURRENT_LIMIT:g} A. With that limit"
        f" the voltage is no square wave: the current stands at its limit for {share:.1f} % of"
        " the time. The actuator of fig. 4-8 is not printed",
        _TEST,
    )


def _without_noise() -> Iterator[Entry]:
    for name, unit, printed, value in zip(
        _NAMES, _UNITS, MEANS[3:], batch(np.inf, 0.0).circuit[-1], strict=True
    ):
        yield Claim(
            "fig. 4-8, eqs. 4.3 to 4.5",
            f"{name} of table 3-1 from held voltage at {RATE:g} Hz",
            printed,
            float(value),
            unit,
            "Tustin's rule; no noise, no limit of the current",
            inferred=True,
        )


def _with_noise() -> Iterator[Entry]:
    omega = 2.0 * pi * FREQUENCY
    printed = f"{float(magnitude(CIRCUIT, omega)):.2f}"
    about = f"table 3-1, current limited, {1e3 * TOLERANCE:g} mV of noise, Tustin's rule"
    for how, found in (("LS", batch()), ("RLS", online())):
        low, high = np.percentile(found.impedance, [5.0, 95.0])
        yield Claim(
            "section 4.3",
            f"impedance at {FREQUENCY:g} Hz by {how} at {RATE:g} Hz, median",
            printed,
            float(np.median(found.impedance)),
            "ohm",
            f"{about}; 90 % are in {low:.3f} to {high:.3f} ohm",
            inferred=True,
        )
        for part, (name, unit) in enumerate(zip(_NAMES, _UNITS, strict=True)):
            low, high = np.percentile(found.circuit[:, part], [5.0, 95.0])
            yield Claim(
                "fig. 4-8",
                f"{name} by {how} at {RATE:g} Hz, median",
                MEANS[3 + part],
                float(np.median(found.circuit[:, part])),
                unit,
                f"{about}; 90 % are in {low:.3f} to {high:.3f} {unit}",
                inferred=True,
            )


def _axes() -> Iterator[Entry]:
    inside = {
        layers: sum(low <= value <= high for value, (low, high) in zip(circuit, AXES, strict=True))
        for layers, circuit in ((12, CIRCUIT), (5, FIVE_LAYERS))
    }
    yield Claim(
        "appendix A3, RLS",
        "parameters of 12 layers on the axes of its plot",
        "3",
        float(inside[12]),
        "",
        "its record is named after actuator 106, which has 12 layers in fig. 3-6",
        erratum=43,
        inferred=True,
    )
    shown = ", ".join(
        f"{n} {a:g} to {b:g} {u}"
        for n, u, (a, b) in zip(_NAMES, ("Ω", "Ω", "F"), AXES, strict=True)
    )
    yield Erratum(
        43,
        "appendix A3, recursive least squares",
        f"the record is of actuator 106; axes {shown}",
        f"of a circuit of 12 layers, as actuator 106 has in fig. 3-6, {inside[12]} of 3 parameters"
        " of table 3-1 are on these axes; of the 5-layer actuator of section 3.3.1"
        f" ({FIVE_LAYERS[0]:g} Ω, {FIVE_LAYERS[1]:g} Ω, {FIVE_LAYERS[2]:g} F, under 150 g as the"
        f" name of the record has it) {inside[5]} of 3",
        _TEST,
    )


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return fig. 4-8."""
    return (
        Illustration(
            "Fig. 4-8: least squares beside recursive least squares",
            f"±{AMPLITUDE:g} V at {FREQUENCY:g} Hz on the circuit of table 3-1 (dashed), sampled at"
            f" {RATE:g} Hz, current at most {CURRENT_LIMIT:g} A, {1e3 * TOLERANCE:g} mV of noise."
            f" Steps: least squares over a period. Lines: recursive, factor {FORGETTING:g},"
            f" covariance reset every {RESET / RATE:g} s. A reset throws the estimates off, R2 the"
            " farthest; the impedance, which the derating watches, is back soonest.",
            _draw_both,
        ),
    )


def _draw_both() -> Figure:
    slow = batch()
    fast = online()
    truth = float(magnitude(CIRCUIT, 2.0 * pi * FREQUENCY))
    figure, axes = pictures.panels(
        4, f"±{AMPLITUDE:g} V at {FREQUENCY:g} Hz, sampled at {RATE:g} Hz"
    )
    columns = [
        *zip(_NAMES, _UNITS, CIRCUIT, slow.circuit.T, fast.circuit.T, strict=True),
        ("impedance at 0.1 Hz", "ohm", truth, slow.impedance, fast.impedance),
    ]
    for axis, (name, unit, true, windows, recursion) in zip(axes, columns, strict=True):
        axis.plot(fast.time, recursion, color=_BLUE, lw=0.8, label="RLS")
        # the time of an estimate is the end of its window, which has a period
        axis.step(
            np.append(slow.time - 1.0 / FREQUENCY, slow.time[-1]),
            np.append(windows, windows[-1]),
            where="post",
            color=_RED,
            label="LS",
        )
        axis.axhline(true, color=_GREY, ls="--", label="table 3-1")
        pictures.label(axis, name, unit)
    pictures.legend_above(axes[0], 3)
    return figure
