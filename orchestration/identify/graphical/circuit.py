"""R1, R2 and C of the electrical circuit read off current and voltage, window by window (thesis, eqs. 3.9 to 3.13).

Least squares on ``v(t) = b0 i(t) + b1 i(t-1) - a v(t-1)``, as the thesis has it, is biased by noise on the voltage, for
v(t-1) is a regressor (``docs/errata.md``, row 9; Ljung: System Identification, section 7.3). An output-error model of
the same order is not (Ljung, section 7.4); both stand side by side. Intervals are those of b0, b1 and a, carried over
by the delta method: in the logarithm, because the three are positive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import approx_fprime
from scipy.stats import norm

from fmus.kit.errors import UserError
from orchestration.identify.black_box.data import InputOutputData, input_output_data
from orchestration.identify.black_box.result import Identification
from orchestration.identify.black_box.structures import arx, output_error
from orchestration.identify.graphical.quantity import Quantity
from orchestration.identify.graphical.signals import over_time
from orchestration.identify.impedance import Conversion, zero_order_hold
from orchestration.identify.metrics import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
UNITS = {"R1": "ohm", "R2": "ohm", "C": "F"}
_UNEVEN = 0.01  # of a sample period, by which a sample may be off it
_ROUNDING = 1e-6  # of a window: a sample that rounding puts just beyond its end is in it
_FEWEST = 12  # samples of a window, four for each parameter
_NAMES = (("b1_0", "b1_1", "a1"), ("b1_0", "b1_1", "f1_1"))  # of b0, b1 and a in the two models
_STEP = 1e-7  # relative, of the derivatives of a conversion; what is closer than that to no circuit is none


@dataclass(frozen=True)
class Circuit:
    """R1, R2 and C as one estimator has them, in ohm and F; NaN where its estimate is that of no circuit."""

    R1: Quantity
    R2: Quantity
    C: Quantity

    @property
    def values(self) -> dict[str, float]:
        """Values by name, SI."""
        return {name: getattr(self, name).value for name in UNITS}

    @property
    def exists(self) -> bool:
        """Whether there is a circuit that behaves as estimated."""
        return all(np.isfinite(value) for value in self.values.values())

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON; None where there is no circuit."""
        return {
            name: getattr(self, name).to_dict() | {"value": number(self.values[name])}
            for name in UNITS
        }


@dataclass(frozen=True)
class Window:
    """A part of a record.

    Attributes
    ----------
    start, end : float
        Seconds.
    least_squares, output_error : Circuit
        By the biased estimator and by the one that is not.
    """

    start: float
    end: float
    least_squares: Circuit
    output_error: Circuit

    @property
    def estimators(self) -> dict[str, Circuit]:
        """The two by name."""
        return {"output error": self.output_error, "least squares": self.least_squares}


@dataclass(frozen=True)
class CircuitReading:
    """What a record tells of the circuit.

    Attributes
    ----------
    windows : tuple of Window
    noise : float
        Standard deviation of what the output-error model of the last window leaves, V: what least squares is biased by.
    warnings : tuple of str
    """

    windows: tuple[Window, ...]
    noise: float
    warnings: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        """R1, R2 and C of the last window without bias, SI, as a fit starts from them and a parameter set has them."""
        return self.windows[-1].output_error.values

    def __str__(self) -> str:
        lines = []
        for window in self.windows:
            lines.append(f"{window.start:g} s to {window.end:g} s")
            for by, circuit in window.estimators.items():
                lines.append(f"  by {by}:" + ("" if circuit.exists else " no circuit behaves so"))
                lines += [
                    f"    {name} = {getattr(circuit, name)}" for name in UNITS if circuit.exists
                ]
        noted = f"least squares is biased by the noise of {1e3 * self.noise:.3g} mV on the voltage (errata, row 9)"
        return "\n".join([*lines, noted, *(f"warning: {text}" for text in self.warnings)])

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON."""
        return {
            "windows": [
                {
                    "start": w.start,
                    "end": w.end,
                    "least_squares": w.least_squares.to_dict(),
                    "output_error": w.output_error.to_dict(),
                }
                for w in self.windows
            ],
            "noise": {"value": self.noise, "unit": "V"},
            "warnings": [*self.warnings],
        }

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw R1, R2 and C over the windows, with their intervals.

        Parameters
        ----------
        path : str or Path, optional
            Picture (.png, .svg or .pdf) to write as well.

        Raises
        ------
        UserError
            If the file cannot be written.
        """
        from orchestration.reporting import pictures

        figure, axes = pictures.panels(len(UNITS), "circuit, with 95 % intervals")
        for axis, (name, unit) in zip(axes, UNITS.items(), strict=True):
            for by, colour, at in (
                ("output error", pictures.MODEL, 0.45),
                ("least squares", pictures.MEASURED, 0.55),
            ):
                found: list[Quantity] = [getattr(w.estimators[by], name) for w in self.windows]
                value, ends = (
                    np.array([q.value for q in found]),
                    np.array([q.interval for q in found]).T,
                )
                times = [w.start + at * (w.end - w.start) for w in self.windows]
                label = by if by == "output error" else f"{by}, biased by noise"
                axis.errorbar(
                    times,
                    value,
                    np.abs(ends - value),
                    fmt="o",
                    ms=4,
                    capsize=3,
                    color=colour,
                    label=label,
                )
            pictures.label(axis, name, unit)
        axes[0].legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.1
        )
        axes[-1].set_xlim(self.windows[0].start, self.windows[-1].end)
        if path is not None:
            pictures.save(figure, Path(path))
        return figure


def read_circuit(
    time: ArrayLike,
    current: ArrayLike,
    voltage: ArrayLike,
    window: float | None = None,
    conversion: Conversion = zero_order_hold,
) -> CircuitReading:
    """Read R1, R2 and C off a record, with 95 % intervals.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, equally spaced.
    current, voltage : array_like, shape (n,)
        A and V; the current is what drives.
    window : float, optional
        Seconds, for an estimate from each; the whole record unless given. A trailing part that is shorter is left out.
    conversion : callable
        `zero_order_hold`, exact for a current that is held between samples, or `tustin`, eqs. 3.11 to 3.13 as printed.

    Returns
    -------
    CircuitReading

    Raises
    ------
    UserError
        If the signals do not fit together, are not finite or not equally spaced, or a window is too short or does not
        excite the circuit.
    """
    t, i, v = over_time(time, current=current, voltage=voltage)
    step = float((t[-1] - t[0]) / (t.size - 1))
    off = np.abs(t - t[0] - step * np.arange(t.size)) / step
    if off.max() > _UNEVEN:
        raise UserError(
            f"time: sample {np.argmax(off)} is not where equal steps of {step:g} s have it"
        )
    span = t.size * step if window is None else float(window)
    if not 0.0 < span < np.inf:
        raise UserError(
            f"a window of {span:g} s: write a finite length above 0, {_FEWEST * step:g} s at least"
        )
    length = int(np.floor(span / step * (1.0 + _ROUNDING)))
    if length < _FEWEST:
        raise UserError(
            f"a window of {span:g} s has {length} samples of {step:g} s: it needs {_FEWEST} at least"
        )
    if length > t.size:
        raise UserError(f"record of {t.size * step:g} s: shorter than a window of {span:g} s")
    data = input_output_data(i, v, step, ("current",), "voltage")
    found, warnings = [], []
    for start in range(0, t.size - length + 1, length):
        part, ends = (
            data.part(start, start + length),
            (float(t[start]), float(t[start] + length * step)),
        )
        try:
            both = arx(part, 1, 2, 0), output_error(part, 2, 1, 0)
        except UserError as error:
            raise UserError(f"window from {ends[0]:g} s to {ends[1]:g} s: {error}") from None
        read = Window(
            *ends,
            *(_circuit(m, part, names, conversion) for m, names in zip(both, _NAMES, strict=True)),
        )
        lacking = [by for by, circuit in read.estimators.items() if not circuit.exists]
        warnings += [
            f"{ends[0]:g} s to {ends[1]:g} s: no circuit behaves as {by} has it" for by in lacking
        ]
        found.append(read)
    return CircuitReading(tuple(found), float(np.sqrt(both[1].loss)), tuple(warnings))


def _circuit(
    model: Identification, data: InputOutputData, names: tuple[str, ...], conversion: Conversion
) -> Circuit:
    """Convert b0, b1 and a, and their covariance."""
    places = [[p.name for p in model.parameters].index(name) for name in names]
    theta = np.array([model.parameters[k].value for k in places])
    spread = model.covariance[np.ix_(places, places)]
    with np.errstate(invalid="ignore"):
        values = conversion(theta, data.step)
    if _degenerate(*theta) or not (np.isfinite(values).all() and (values > 0.0).all()):
        return Circuit(*(Quantity(np.nan, (np.nan, np.nan), unit) for unit in UNITS.values()))
    slopes = approx_fprime(theta, _logarithm(conversion, data.step), _STEP * np.abs(theta))
    half = float(norm.ppf(0.975)) * np.sqrt(np.diag(slopes @ spread @ slopes.T))
    ends = zip(values * np.exp(-half), values * np.exp(half), strict=True)
    parts = zip(values, ends, UNITS.values(), strict=True)
    return Circuit(*(Quantity(float(x), (float(a), float(b)), unit) for x, (a, b), unit in parts))


def _degenerate(b0: float, b1: float, a: float) -> bool:
    """Whether a circuit is but rounding: no pole, one that does not decay, or one that a zero cancels."""
    return (
        abs(a) < _STEP
        or abs(1.0 - abs(a)) < _STEP
        or abs(b1 - a * b0) < _STEP * max(abs(b0), abs(b1))
    )


def _logarithm(conversion: Conversion, period: float) -> Callable[[Array], Array]:
    return lambda theta: np.asarray(np.log(conversion(theta, period)))
