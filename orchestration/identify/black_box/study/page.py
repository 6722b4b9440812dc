"""The one-page report of a black-box study."""

from __future__ import annotations

from orchestration.identify.black_box.study.identification import BlackBox
from orchestration.identify.black_box.study.picture import (
    draw_correlations,
    draw_free_run,
    draw_identified,
    draw_residual,
    draw_roots,
)
from orchestration.reporting import make_page
from orchestration.reporting.html import Page

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


@make_page.register(BlackBox)
def black_box_page(result: BlackBox, command: str = "") -> Page:
    """Make the page of a black-box study.

    `command` is not used, as the page has no section on reproduction.
    """
    title = f"{result.columns.path.name}: black-box models of {result.model.output_name}"
    page = Page(title, result.sentence)
    _add_data(page, result)
    _add_structures(page, result)
    for draw_one, caption in (
        (draw_free_run, _FREE_RUN),
        (draw_identified, _IDENTIFIED),
        (draw_residual, _RESIDUAL),
        (draw_correlations, _CORRELATIONS),
        (draw_roots, _ROOTS),
    ):
        page.figure(draw_one(result), caption)
    _add_chosen_model(page, result)
    return page


def _add_data(page: Page, result: BlackBox) -> None:
    """Add the size of the record, the excitation and delays of its inputs, and its repairs."""
    page.items(
        [
            (
                f"{len(result.columns.data)} samples every {result.model.step:g} s; models are"
                f" identified from the first {len(result.estimation)} and judged by the rest."
            ),
            *(
                f"{name} excites persistently up to order {order}; its delay is {delay} samples."
                for (name, order), delay in zip(
                    result.excitation.items(), result.search.delays, strict=True
                )
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
    head = ["model", "fit [%], identified", "fit [%], unseen", "AIC", "BIC"]
    orders = [f"order from {name}" for name in inputs]
    page.table([*head, *orders, "noise order"], [row.cells for row in result.search.best])


def _add_chosen_model(page: Page, result: BlackBox) -> None:
    """Add the coefficients of the chosen model, its messages, and models that were left out."""
    chosen = result.chosen.identification
    page.heading(f"The {result.chosen.structure} model")
    if chosen.parameters:
        page.table(
            ["coefficient", "value", "standard error"],
            chosen.parameter_rows(),
        )
    page.items([*chosen.messages, *result.remarks])
