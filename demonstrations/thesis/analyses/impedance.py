"""Sections 3.1.4 and 4.3: the circuit in windows, by the thesis's least squares and without bias.

The records are lost. The estimators are applied to the circuit of table 3-1 with noise on its
voltage, as in errata row 9, so that the true values are known.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from demonstrations.graphical import CircuitReading, GraphicalEstimate, read_circuit
from demonstrations.thesis.circuit import CIRCUIT, PERIOD, response
from demonstrations.thesis.claim import Claim, Entry, Illustration
from orchestration.experiment.waveforms import square_wave
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WINDOW = 100.0  # s, as in section 4.3
WINDOWS = 10
# as in row 9
AMPLITUDE = 0.9  # A
FREQUENCY = 0.2  # Hz
NOISE = 20e-3  # V
_TRUE = dict(zip(("R1", "R2", "C"), CIRCUIT, strict=True))


@cache
def reading(windows: int = 1, seed: int = 0) -> CircuitReading:
    """Return the estimates from the whole record, or from a number of windows."""
    time = PERIOD * np.arange(round(WINDOWS * WINDOW / PERIOD))
    current = square_wave(time, AMPLITUDE, FREQUENCY)
    noise = NOISE * np.random.default_rng(seed).standard_normal(time.size)
    return read_circuit(time, current, response(current) + noise, WINDOWS * WINDOW / windows)


def entries() -> Iterator[Entry]:
    """Yield a claim for each estimator and parameter: its 95 % interval contains the true value."""
    (whole,) = reading().windows
    for by, circuit in whole.estimators.items():
        biased = by == "least squares"
        for name, true in _TRUE.items():
            found: GraphicalEstimate = getattr(circuit, name)
            low, high = found.interval
            yield Claim(
                "section 3.1.4",
                f"{name} of table 3-1 within the 95 % interval by {by}, 20 mV of noise",
                "yes",
                "yes" if low <= true <= high else "no",
                reason=f"{found}; {WINDOWS * WINDOW:g} s of {AMPLITUDE:g} A at {FREQUENCY:g} Hz",
                erratum=9 if biased else None,
                inferred=True,
            )


def illustrations() -> tuple[Illustration, ...]:
    """Return the figure of the estimates with intervals in each window."""
    return (
        Illustration(
            "Section 4.3: the circuit from every 1000 points, with intervals",
            f"{AMPLITUDE:g} A at {FREQUENCY:g} Hz on the circuit of table 3-1 (dashed),"
            f" {1e3 * NOISE:g} mV of noise on the voltage. Least squares is off by more than its"
            " intervals say, because the noise is in its regressor; an output-error model of the"
            " same three parameters is not.",
            _over_windows,
        ),
    )


def _over_windows() -> Figure:
    figure = reading(WINDOWS).plot()
    for axis, true in zip(figure.axes, CIRCUIT, strict=True):
        axis.axhline(true, color=pictures.FITTED, ls="--", lw=1.0)
    return figure
