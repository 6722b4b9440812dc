"""Pictures of a black-box study: free runs, residual, correlations, poles and zeros."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from orchestration.identify.black_box.data import InputOutputData
from orchestration.identify.black_box.study.identification import BlackBox
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@draw.register(BlackBox)
def draw_free_run(result: BlackBox) -> Figure:
    """Draw the free run of the chosen model over the data that it has not seen (fig. 3-14)."""
    chosen = result.chosen
    title = f"{chosen.structure} over data that it has not seen"
    begin = len(result.estimation)
    return _draw_over(result, result.validation, begin, chosen.validation_fit, title)


def draw_identified(result: BlackBox) -> Figure:
    """Draw the same over the data from which the model was identified (fig. 3-13)."""
    chosen = result.chosen
    title = f"{chosen.structure} over the data that it was identified from"
    return _draw_over(result, result.estimation, 0, chosen.fit, title)


def _draw_over(
    result: BlackBox, data: InputOutputData, begin: int, fit: float, title: str
) -> Figure:
    """Draw data that begin at a sample of the record, and the free run over them."""
    model = result.model
    unit = result.columns.units[data.output_name]
    time = model.step * (begin + np.arange(len(data)))
    simulated = model.simulate(data.inputs, data.output)
    figure, (over, below) = pictures.panels(2, title)
    over.plot(time, data.output, color=pictures.MEASURED, lw=2.0, label="measured")
    over.plot(time, simulated, color=pictures.FITTED, label=f"free run: {fit:.1f} % fit")
    pictures.legend_above(over, 2)
    below.plot(time, data.output - simulated, color=pictures.MODEL)
    pictures.label(over, data.output_name, unit)
    pictures.label(below, "measured less free run", unit)
    return figure


def draw_residual(result: BlackBox) -> Figure:
    """Draw the residual of predictions by one sample over the identification data (fig. 3-15)."""
    data = result.estimation
    residual = result.chosen.identification.residual
    time = result.model.step * np.arange(len(data) - len(residual), len(data))
    figure, (axis,) = pictures.panels(1, f"residual of {result.chosen.structure}, one step ahead")
    axis.plot(time, residual, color=pictures.MODEL)
    pictures.label(axis, "measured less predicted", result.columns.units[data.output_name])
    return figure


def draw_correlations(result: BlackBox) -> Figure:
    """Draw the residual's correlations with itself and with every input (Ljung, section 16.6).

    The limits are those of 99 %.
    """
    tests = result.residual_tests
    figure, axes = pictures.panels(
        1 + len(tests.inputs), "residual of the chosen model, one step ahead"
    )
    lags = np.arange(len(tests.autocorrelation))
    _draw_stems(axes[0], lags[1:], tests.autocorrelation[1:], tests.limit, "with itself")
    names = result.estimation.input_names
    for axis, name, cross in zip(axes[1:], names, tests.inputs, strict=True):
        _draw_stems(axis, cross.lags, cross.values, cross.limit, f"with {name}")
    axes[-1].set_xlabel("lag [samples]")
    return figure


def _draw_stems(axis: Axes, lags: np.ndarray, values: np.ndarray, limit: float, name: str) -> None:
    """Draw correlations over lags, with the band of insignificant values."""
    axis.axhspan(-limit, limit, color=pictures.MEASURED, alpha=0.3, lw=0)
    axis.vlines(lags, 0.0, values, color=pictures.MODEL)
    axis.plot(lags, values, "o", ms=3, color=pictures.MODEL)
    axis.set_title(name)
    pictures.label(axis, "correlation", "1")


def draw_roots(result: BlackBox) -> Figure:
    """Draw poles and zeros of every path in the s-plane (thesis, fig. 3-16)."""
    names = result.estimation.input_names
    figure, axes = pictures.panels(len(names), "poles (crosses) and zeros (circles) in the s-plane")
    for axis, name in zip(axes, names, strict=True):
        poles = result.model.s_plane_poles(name)
        zeros = result.model.s_plane_zeros(name)
        axis.plot(poles.real, poles.imag, "x", color=pictures.FITTED, ms=7)
        axis.plot(zeros.real, zeros.imag, "o", color=pictures.MODEL, ms=7, mfc="none")
        axis.axvline(0.0, color="#9aa5af", lw=1.0)
        axis.set_title(f"from {name}")
        pictures.label(axis, "imaginary", "rad/s")
        axis.margins(0.1, 0.3)
    axes[-1].set_xlabel("real [rad/s]")
    return figure
