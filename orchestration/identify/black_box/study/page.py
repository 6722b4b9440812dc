"""The one-page report of a black-box study, with its pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit.storage import scratch
from orchestration.identify.black_box.data import InputOutputData
from orchestration.identify.black_box.order_search import Row
from orchestration.identify.black_box.study.identification import BlackBox
from orchestration.reporting import Page, path_of_report, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FREE_RUN = (
    "What the model makes of the inputs alone, beside what was measured; no fit has seen this part."
)
_IDENTIFIED = (
    "The same over the part from which the model was identified, as in the thesis' fig. 3-13."
)
_RESIDUAL = (
    "What predictions by one sample leave there, as in fig. 3-15: where it stands out, the model"
    " lacks something or the record has an outlier."
)
_CORRELATIONS = (
    "Grey: limits of 99 %. What stands out at positive lags is dynamics that the model lacks."
)
_ROOTS = (
    "s = ln(z) / step: exact for poles, if inputs are held between samples; zeros are shown by the"
    " same rule."
)


def write(result: BlackBox, path: Path) -> Path:
    """Write the page.

    Raises
    ------
    UserError
        If its name is none of a page, or it cannot be written.
    """
    target = path_of_report(path)
    title = f"{result.columns.path.name}: black-box models of {result.model.output_name}"
    page = Page(title, result.sentence)
    _add_data(page, result)
    _add_structures(page, result)
    with scratch.folder("page") as folder:
        for draw, caption in (
            (draw_free_run, _FREE_RUN),
            (draw_identified, _IDENTIFIED),
            (draw_residual, _RESIDUAL),
            (draw_correlations, _CORRELATIONS),
            (draw_roots, _ROOTS),
        ):
            file = folder / f"{draw.__name__}.png"
            pictures.save(draw(result), file)
            page.picture(file, caption)
    _add_chosen_model(page, result)
    page.write(target)
    return target


def _add_data(page: Page, result: BlackBox) -> None:
    """Add the size of the record, the excitation of its inputs, and what was repaired."""
    page.items(
        [
            (
                f"{len(result.columns.data)} samples every {result.model.step:g} s; models are"
                f" identified from the first {len(result.estimation)} and judged by the rest."
            ),
            *(
                f"{name} excites persistently up to order {order}."
                for name, order in result.excitation.items()
            ),
            *result.columns.notes,
        ]
    )


def _add_structures(page: Page, result: BlackBox) -> None:
    """Add the table with the best model of every structure."""
    page.heading("The best of every structure")
    page.text(
        f"By {result.search.criterion}, as in the thesis' table 3-2; orders are those of the paths'"
        " denominators."
    )
    inputs = result.estimation.input_names
    head = ["model", "fit, identified", "fit, unseen", "AIC", "BIC"]
    head += [f"order from {name}" for name in inputs]
    head += ["noise order"]
    page.table(head, [_cells(row, len(inputs)) for row in result.search.best])


def _cells(row: Row, inputs: int) -> list[str]:
    """Return the cells of one model in the table of structures."""
    percents = [f"{row.fit:.1f} %", f"{row.validation_fit:.1f} %"]
    criteria = [f"{row.aic:.2f}", f"{row.bic:.2f}"]
    return [row.structure, *percents, *criteria, *row.order_cells(inputs)]


def _add_chosen_model(page: Page, result: BlackBox) -> None:
    """Add the coefficients of the chosen model, and what one should know of it."""
    chosen = result.chosen.identification
    page.heading(f"The {result.chosen.structure} model")
    if chosen.parameters:
        page.table(
            ["coefficient", "value", "standard error"],
            [[p.name, f"{p.value:.6g}", f"{p.standard_error:.2g}"] for p in chosen.parameters],
        )
    page.items([*chosen.messages, *(f"left out: {line}" for line in result.search.left_out)])


def draw_free_run(result: BlackBox) -> Figure:
    """Draw the validation data and the free run over them, above their difference (fig. 3-14)."""
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
    over.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.1
    )
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
    """Draw correlations over lags, with a band of what is insignificant."""
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
