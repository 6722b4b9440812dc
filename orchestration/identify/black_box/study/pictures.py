"""Pictures of a black-box study: the free run, what is left of it, and where poles and zeros are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from orchestration.identify.black_box.study.study import BlackBox
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def free_run(found: BlackBox) -> Figure:
    """Unseen data and the free run over them, above what is between them."""
    data, model = found.validation, found.model
    unit = found.columns.units[data.output_name]
    time = model.step * (len(found.estimation) + np.arange(len(data)))
    simulated = model.simulate(data.inputs, data.output)
    figure, (over, below) = pictures.panels(
        2, f"{found.chosen.structure} over data that it has not seen"
    )
    over.plot(time, data.output, color=pictures.MEASURED, lw=2.0, label="measured")
    over.plot(
        time,
        simulated,
        color=pictures.FITTED,
        label=f"free run: {found.chosen.validation_fit:.1f} % fit",
    )
    over.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.1
    )
    below.plot(time, data.output - simulated, color=pictures.MODEL)
    pictures.label(over, data.output_name, unit)
    pictures.label(below, "measured less free run", unit)
    return figure


def correlations(found: BlackBox) -> Figure:
    """The residual against its own past, and that of every input, with limits of 99 % (Ljung, section 16.6)."""
    tests = found.residual_tests
    figure, axes = pictures.panels(
        1 + len(tests.inputs), "residual of the chosen model, one step ahead"
    )
    lags = np.arange(len(tests.autocorrelation))
    _stems(axes[0], lags[1:], tests.autocorrelation[1:], tests.limit, "with itself")
    for axis, name, cross in zip(axes[1:], found.estimation.input_names, tests.inputs, strict=True):
        _stems(axis, cross.lags, cross.values, cross.limit, f"with {name}")
    axes[-1].set_xlabel("lag [samples]")
    return figure


def _stems(axis: Axes, lags: np.ndarray, values: np.ndarray, limit: float, name: str) -> None:
    axis.axhspan(-limit, limit, color=pictures.MEASURED, alpha=0.3, lw=0)
    axis.vlines(lags, 0.0, values, color=pictures.MODEL)
    axis.plot(lags, values, "o", ms=3, color=pictures.MODEL)
    axis.set_title(name)
    pictures.label(axis, "correlation", "1")


def roots(found: BlackBox) -> Figure:
    """Poles and zeros of every path in the s-plane (thesis, fig. 3-16)."""
    names = found.estimation.input_names
    figure, axes = pictures.panels(len(names), "poles (crosses) and zeros (circles) in the s-plane")
    for axis, name in zip(axes, names, strict=True):
        poles, zeros = found.model.s_plane_poles(name), found.model.s_plane_zeros(name)
        axis.plot(poles.real, poles.imag, "x", color=pictures.FITTED, ms=7)
        axis.plot(zeros.real, zeros.imag, "o", color=pictures.MODEL, ms=7, mfc="none")
        axis.axvline(0.0, color="#9aa5af", lw=1.0)
        axis.set_title(f"from {name}")
        pictures.label(axis, "imaginary", "rad/s")
        axis.margins(0.1, 0.3)
    axes[-1].set_xlabel("real [rad/s]")
    return figure
