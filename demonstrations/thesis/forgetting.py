"""Chapter 4, estimation: recursive least squares with forgetting, eqs. 4.7 to 4.11."""

from __future__ import annotations

from collections.abc import Iterator
from math import log, log10
from typing import TYPE_CHECKING

import numpy as np

from demonstrations.thesis.circuit import CIRCUIT, PERIOD, response
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration
from fmus.kit.arrays import Array
from orchestration.experiment.waveforms import square_wave
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BLUE = pictures.MODEL
_RED = pictures.FITTED
_GREY = pictures.MEASURED


def entries() -> Iterator[Entry]:
    """Yield claims and errata about eqs. 4.7 to 4.11."""
    yield from _recursion()
    yield from _forgetting()


def recursive(
    current: Array,
    voltage: Array,
    forgetting: float,
    denominator: float,
    covariance: float,
    reset: int = 0,
) -> Array:
    """Return estimates by eqs. 4.7 and 4.9, with the missing phi in the gain.

    Parameters
    ----------
    current, voltage : ndarray, shape (n,)
        A and V.
    forgetting : float
        Forgetting factor of eq. 4.9.
    denominator : float
        Term that is added to phi^T P phi: 1 as printed, or the forgetting factor.
    covariance : float
        Factor of the unit matrix as covariance at the start.
    reset : int
        Samples after which the covariance is reset to that, as in appendix A3; 0 for never.

    Returns
    -------
    ndarray, shape (n - 1, 3)
        b0, b1 and a after each sample.
    """
    theta = np.zeros(3)
    p = covariance * np.eye(3)
    estimates = []
    for t in range(1, len(current)):
        phi = np.array([current[t], current[t - 1], -voltage[t - 1]])
        gain = p @ phi / (denominator + phi @ p @ phi)
        theta = theta + gain * (voltage[t] - phi @ theta)
        p = (p - np.outer(gain, phi @ p)) / forgetting
        if reset and (t + 1) % reset == 0:
            p = covariance * np.eye(3)
        estimates.append(theta)
    return np.array(estimates)


def _recursion() -> Iterator[Entry]:
    forgetting = 0.985
    time = PERIOD * np.arange(301)
    current = square_wave(time, 1.3, 0.1)
    voltage = response(current, np.where(time < 15.0, 1.0, 1.2) * CIRCUIT[0])
    printed = recursive(current, voltage, forgetting, 1.0, 1.0)
    right = recursive(current, voltage, forgetting, forgetting, forgetting)
    same = bool(np.allclose(printed, right, rtol=1e-9, atol=1e-9))
    phi = np.array([[current[1]], [current[0]], [-voltage[0]]])
    sizes = [
        " x ".join(map(str, np.shape(g / (1.0 + phi.T @ phi)))) for g in (phi, np.eye(3))
    ]  # with P = 1
    yield Claim(
        "eqs. 4.7 to 4.9",
        "size of the gain",
        sizes[0],
        sizes[1],
        reason="as printed it is a matrix times a number: phi is missing",
        erratum=6,
        inferred=True,
    )
    yield Erratum(
        6,
        "eqs. 4.7–4.9",
        "gain P/(1 + φᵀPφ); with forgetting, 1/α before eq. 4.8",
        "the gain lacks φ: Pφ/(1 + φᵀPφ). With forgetting the usual denominator is α + φᵀPφ, as the"
        " program has it; "
        + (
            "the printed one gives the same estimates with a covariance 1/α times as large, so that"
            " it is the start that differs"
            if same
            else "the printed one gives other estimates"
        ),
    )


def forgetting_factor(weight: float, sample: float, time: float) -> float:
    """Return the forgetting factor with a given weight, in percent, after a time (eq. 4.11).

    Parameters
    ----------
    weight : float
        In percent.
    sample, time : float
        Sampling period and time, in the same unit.
    """
    return float(10.0 ** ((log10(weight) - 2.0) * sample / time))


def _forgetting() -> Iterator[Entry]:
    factor = 0.91
    asked = 10.0
    memory = -PERIOD / log(factor)
    remaining = 100.0 * factor ** (asked / PERIOD)
    slow = 0.985
    rate = 15.0
    five = 5.0
    remaining_slow = 100.0 * slow ** (five * rate)
    known = Claim(
        "appendix A3",
        "time that a factor of 0.91 remembers, at 10 Hz",
        f"{asked:g}",
        memory,
        "s",
        f"time constant of the weights; after {asked:g} s a weight of {remaining:.3f} % is left",
        erratum=11,
    )
    yield known
    yield Erratum(
        11,
        "section 4.1.2, appendix A3",
        f"α = {factor:g} corresponds to approximately {known.published} seconds",
        f"by eq. 4.11 at {1 / PERIOD:g} Hz that is a weight of {remaining:.3f} % after {asked:g} s,"
        f" a memory of {memory:.1f} s; {slow:g} at {rate:g} Hz leaves {remaining_slow:.0f} % after"
        f" {five:g} s",
        "components/degradation_estimator/test_regression",
    )
    weight = 10.0  # percent
    plotted = 1.0  # s, on the axis of the program's plot
    drawn = forgetting_factor(weight, PERIOD, plotted + 1.0)
    right = forgetting_factor(weight, PERIOD, plotted)
    yield Claim(
        "appendix A3",
        "forgetting time of what is plotted at 1 s",
        f"{plotted:g}",
        PERIOD * log10(0.1) / log10(drawn),
        "s",
        "the program evaluates eq. 4.11 at j + 1 and plots at j",
        erratum=28,
        inferred=True,
    )
    yield Erratum(
        28,
        "appendix A3",
        "plot of the forgetting factor over the desired time",
        f"every value stands one second too early: at {plotted:g} s, with {weight:g} % left and"
        f" {1 / PERIOD:g} Hz, the plot shows {drawn:.4f}, which is the factor for {plotted + 1:g}"
        f" s; eq. 4.11 gives {right:.4f}",
        "demonstrations/thesis/test_degradation",
    )


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return the figure of eq. 4.11."""
    return (
        Illustration(
            "Eq. 4.11: how long a factor remembers",
            "Forgetting factor that leaves 1 %, 10 % or 50 % of a sample's weight after a time, at"
            " 10 Hz. The two factors of the thesis are marked at the times it gives for them; the"
            " red one is far below its curve.",
            _forgetting_figure,
        ),
    )


def _forgetting_figure() -> Figure:
    times = np.logspace(0, 2, 200)
    figure, (axis,) = pictures.panels(1, "Forgetting factor")
    for weight, style in ((1.0, ":"), (10.0, "-"), (50.0, "--")):
        factors = [forgetting_factor(weight, PERIOD, t) for t in times]
        axis.semilogx(times, factors, style, color=_BLUE, label=f"{weight:g} % left, 10 Hz")
    axis.plot(10.0, 0.91, "o", color=_RED, label="0.91, said to be 10 s")
    axis.plot(5.0, 0.985 ** (15.0 * PERIOD), "o", color=_GREY, label="0.985 at 15 Hz, as at 10 Hz")
    axis.set_xlabel("time after which that is left [s]")
    axis.legend(fontsize=8)
    pictures.label(axis, "forgetting factor", "1")
    return figure
