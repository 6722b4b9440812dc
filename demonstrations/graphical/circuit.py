"""Estimation of R1, R2 and C of the electrical circuit from windows of current and voltage.

Source: thesis, eqs. 3.9 to 3.13. The thesis uses least squares on
``v(t) = b0 i(t) + b1 i(t-1) - a v(t-1)``, which is biased by noise on the voltage, as v(t-1) is a
regressor (``docs/errata.md``, row 9; Ljung: System Identification, section 7.3). An output-error
model of the same order is not biased (Ljung, section 7.4). Both are estimated here. Intervals of
b0, b1 and a are converted by the delta method, in logarithms, because R1, R2 and C are positive.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import approx_fprime
from scipy.special import ndtri

from demonstrations.graphical.impedance import Conversion, zero_order_hold
from demonstrations.graphical.quantity import GraphicalEstimate
from demonstrations.graphical.signals import over_time
from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.identify.black_box import (
    Identification,
    InputOutputData,
    arx,
    input_output_data,
    output_error,
)
from orchestration.reporting import Displayable, one_line, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from rich.console import RenderableType

UNITS = {"R1": "ohm", "R2": "ohm", "C": "F"}
_UNEVEN = 0.01  # of a sample period: largest deviation of a sample
_ROUNDING = 1e-6  # of a window: a sample so shortly after its end is in it
_FEWEST = 12  # samples of a window, four for each parameter
# names of b0, b1 and a in the two models
_ARX_NAMES = ("b1_0", "b1_1", "a1")
_OUTPUT_ERROR_NAMES = ("b1_0", "b1_1", "f1_1")
# relative step of the derivatives of a conversion, and distance from estimates without a circuit
_STEP = 1e-7


@dataclass(frozen=True)
class Circuit:
    """R1, R2 and C by one estimator, in ohm and F; NaN if no circuit has the estimate."""

    R1: GraphicalEstimate
    R2: GraphicalEstimate
    C: GraphicalEstimate

    @property
    def values(self) -> dict[str, float]:
        """Values by name, SI."""
        return {name: getattr(self, name).value for name in UNITS}

    @property
    def exists(self) -> bool:
        """True if a circuit with the estimate exists."""
        return all(np.isfinite(value) for value in self.values.values())


@dataclass(frozen=True)
class Window:
    """Estimates of the circuit from a window of a record.

    Attributes
    ----------
    start, end : float
        Seconds.
    least_squares, output_error : Circuit
        Circuits by the biased and by the unbiased estimator.
    """

    start: float
    end: float
    least_squares: Circuit
    output_error: Circuit

    @property
    def estimators(self) -> dict[str, Circuit]:
        """Both circuits by the name of the estimator."""
        return {"output error": self.output_error, "least squares": self.least_squares}


@dataclass(frozen=True)
class CircuitReading(Displayable):
    """Estimates of the circuit from every window of a record.

    Attributes
    ----------
    windows : tuple of Window
    noise : float
        Standard deviation of the residual of the output-error model in the last window, V, an
        estimate of the noise that biases least squares.
    warnings : tuple of str
    """

    windows: tuple[Window, ...]
    noise: float
    warnings: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        """R1, R2 and C of the last window by the unbiased estimator, SI."""
        return self.windows[-1].output_error.values

    def overview(self) -> Iterator[RenderableType]:
        """Yield lines with the estimates of every window by both estimators, and with warnings."""
        for window in self.windows:
            yield f"{window.start:g} s to {window.end:g} s"
            for estimator, circuit in window.estimators.items():
                if circuit.exists:
                    yield f"  by {estimator}:"
                    yield from (f"    {name} = {getattr(circuit, name)}" for name in UNITS)
                else:
                    yield f"  by {estimator}: no circuit behaves so"
        yield (
            f"least squares is biased by the noise of {1e3 * self.noise:.3g} mV on the voltage"
            " (errata, row 9)"
        )
        yield from (f"warning: {text}" for text in self.warnings)

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {self.values[name]:.3g} {UNITS[name]}" for name in UNITS)
        return one_line(f"CircuitReading until {self.windows[-1].end:g} s: {values}")

    def draw(self) -> Figure:
        """Draw R1, R2 and C over the windows, with their intervals."""
        figure, axes = pictures.panels(len(UNITS), "circuit, with 95 % intervals")
        for axis, (name, unit) in zip(axes, UNITS.items(), strict=True):
            self._draw_element(
                axis, name, "output error", "output error", pictures.MODEL, share=0.45
            )
            label = "least squares, biased by noise"
            self._draw_element(axis, name, "least squares", label, pictures.MEASURED, share=0.55)
            pictures.label(axis, name, unit)
        axes[0].legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.1
        )
        axes[-1].set_xlim(self.windows[0].start, self.windows[-1].end)
        return figure

    def _draw_element(
        self, axis: Axes, name: str, estimator: str, label: str, colour: str, *, share: float
    ) -> None:
        """Draw an element by one estimator, in each window at a share of its length."""
        estimates = [getattr(window.estimators[estimator], name) for window in self.windows]
        values = np.array([estimate.value for estimate in estimates])
        ends = np.array([estimate.interval for estimate in estimates]).T
        axis.errorbar(
            [window.start + share * (window.end - window.start) for window in self.windows],
            values,
            np.abs(ends - values),
            fmt="o",
            ms=4,
            capsize=3,
            color=colour,
            label=label,
        )


def read_circuit(
    time: ArrayLike,
    current: ArrayLike,
    voltage: ArrayLike,
    window: float | None = None,
    conversion: Conversion = zero_order_hold,
) -> CircuitReading:
    """Estimate R1, R2 and C from windows of a record, with 95 % intervals.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, equally spaced.
    current, voltage : array_like, shape (n,)
        A and V; the current is the input.
    window : float, optional
        Length of a window in seconds; by default the whole record. A shorter rest is omitted.
    conversion : callable
        `zero_order_hold`, exact for a current that is constant between samples, or `tustin`, eqs.
        3.11 to 3.13 as printed.

    Returns
    -------
    CircuitReading

    Raises
    ------
    UserError
        If the signals do not fit together, are not finite or not equally spaced, or a window is too
        short or does not excite the circuit.
    """
    t, i, v = over_time(time, current=current, voltage=voltage)
    step = _sample_period(t)
    length = _samples_of_window(window, t.size, step)
    data = input_output_data(i, v, step, ("current",), "voltage")
    read = [
        _read_window(data.part(first, first + length), float(t[first]), conversion)
        for first in range(0, t.size - length + 1, length)
    ]
    windows = tuple(window for window, _ in read)
    _, noise = read[-1]
    warnings = tuple(
        f"{window.start:g} s to {window.end:g} s: no circuit behaves as {estimator} has it"
        for window in windows
        for estimator, circuit in window.estimators.items()
        if not circuit.exists
    )
    return CircuitReading(windows, noise, warnings)


def _read_window(
    data: InputOutputData, begin: float, conversion: Conversion
) -> tuple[Window, float]:
    """Return the estimates of a window from `begin` on, and the noise of its voltage in V."""
    end = begin + len(data) * data.step
    try:
        least_squares = arx(data, 1, 2, 0)
        unbiased = output_error(data, 2, 1, 0)
    except UserError as error:
        raise UserError(f"window from {begin:g} s to {end:g} s: {error}") from None
    window = Window(
        begin,
        end,
        _circuit(least_squares, data, _ARX_NAMES, conversion),
        _circuit(unbiased, data, _OUTPUT_ERROR_NAMES, conversion),
    )
    return window, float(np.sqrt(unbiased.loss))


def _sample_period(t: Array) -> float:
    """Return the sample period in seconds; UserError if samples are not equally spaced."""
    step = float((t[-1] - t[0]) / (t.size - 1))
    off = np.abs(t - t[0] - step * np.arange(t.size)) / step
    if off.max() > _UNEVEN:
        raise UserError(
            f"time: sample {np.argmax(off)} is not where equal steps of {step:g} s have it"
        )
    return step


def _samples_of_window(window: float | None, samples: int, step: float) -> int:
    """Return the number of samples of a window; UserError if it is too short or too long."""
    span = samples * step if window is None else float(window)
    if not 0.0 < span < np.inf:
        raise UserError(
            f"a window of {span:g} s: write a finite length above 0, {_FEWEST * step:g} s at least"
        )
    length = int(np.floor(span / step * (1.0 + _ROUNDING)))
    if length < _FEWEST:
        raise UserError(
            f"a window of {span:g} s has {length} samples of {step:g} s: it needs {_FEWEST} at"
            " least"
        )
    if length > samples:
        raise UserError(f"record of {samples * step:g} s: shorter than a window of {span:g} s")
    return length


def _circuit(
    model: Identification, data: InputOutputData, names: tuple[str, ...], conversion: Conversion
) -> Circuit:
    """Convert b0, b1 and a with their covariance to the circuit, by the delta method."""
    all_names = [p.name for p in model.parameters]
    places = [all_names.index(name) for name in names]
    theta = np.array([model.parameters[k].value for k in places])
    spread = model.covariance[np.ix_(places, places)]
    with np.errstate(invalid="ignore"):
        values = conversion(theta, data.step)
    if _degenerate(*theta) or not (np.isfinite(values).all() and (values > 0.0).all()):
        return Circuit(
            *(GraphicalEstimate(np.nan, (np.nan, np.nan), unit) for unit in UNITS.values())
        )

    def logarithm(at: Array) -> Array:
        return np.asarray(np.log(conversion(at, data.step)))

    slopes = approx_fprime(theta, logarithm, _STEP * np.abs(theta))
    half = float(ndtri(0.975)) * np.sqrt(np.diag(slopes @ spread @ slopes.T))
    lows = values * np.exp(-half)
    highs = values * np.exp(half)
    return Circuit(
        *(
            GraphicalEstimate(float(value), (float(low), float(high)), unit)
            for value, low, high, unit in zip(values, lows, highs, UNITS.values(), strict=True)
        )
    )


def _degenerate(b0: float, b1: float, a: float) -> bool:
    """Return whether an estimate has, but for rounding, no circuit.

    It then has no pole, a pole that does not decay, or a pole that a zero cancels.
    """
    return (
        abs(a) < _STEP
        or abs(1.0 - abs(a)) < _STEP
        or abs(b1 - a * b0) < _STEP * max(abs(b0), abs(b1))
    )
