"""The one-page report of a black-box study."""

from __future__ import annotations

from pathlib import Path

from fmus.kit.storage import scratch
from orchestration.identify.black_box.order_search import Row
from orchestration.identify.black_box.study import pictures as drawn
from orchestration.identify.black_box.study.study import BlackBox
from orchestration.reporting import pictures
from orchestration.reporting.page import Page, path_of_report

_PICTURES = (
    (
        drawn.free_run,
        "What the model makes of the inputs alone, beside what was measured; no fit has seen this part.",
    ),
    (
        drawn.correlations,
        "Grey: limits of 99 %. What stands out at positive lags is dynamics that the model lacks.",
    ),
    (
        drawn.roots,
        "s = ln(z) / step: exact for poles, if inputs are held between samples; zeros are shown by the same rule.",
    ),
)


def write(found: BlackBox, path: Path) -> Path:
    """Write the page.

    Raises
    ------
    UserError
        If its name is none of a page, or it cannot be written.
    """
    target = path_of_report(path)
    page = Page(
        f"{found.columns.path.name}: black-box models of {found.model.output_name}", found.sentence
    )
    page.items(
        [
            f"{len(found.columns.data)} samples every {found.model.step:g} s; models are identified from the first "
            f"{len(found.estimation)} and judged by the rest.",
            *(
                f"{name} excites persistently up to order {order}."
                for name, order in found.excitation.items()
            ),
            *found.columns.notes,
        ]
    )
    page.heading("The best of every structure")
    page.text(
        f"By {found.search.criterion}, as in the thesis' table 3-2; orders are those of the paths' denominators."
    )
    inputs = found.estimation.input_names
    head = [
        "model",
        "fit, identified",
        "fit, unseen",
        "AIC",
        "BIC",
        *(f"order from {n}" for n in inputs),
        "noise order",
    ]
    page.table(head, [_cells(row, len(inputs)) for row in found.search.best])
    with scratch.folder("page") as folder:
        for draw, caption in _PICTURES:
            file = folder / f"{draw.__name__}.png"
            pictures.save(draw(found), file)
            page.picture(file, caption)
    chosen = found.chosen.identification
    page.heading(f"The {found.chosen.structure} model")
    if chosen.parameters:
        page.table(
            ["coefficient", "value", "standard error"],
            [[p.name, f"{p.value:.6g}", f"{p.standard_error:.2g}"] for p in chosen.parameters],
        )
    page.items([*chosen.messages, *(f"left out: {line}" for line in found.search.left_out)])
    page.write(target)
    return target


def _cells(row: Row, inputs: int) -> list[str]:
    paths = [str(order) for order in row.path_orders] + [""] * (inputs - len(row.path_orders))
    noise = "constant" if row.noise_order is None else str(row.noise_order)
    percents = f"{row.fit:.1f} %", f"{row.validation_fit:.1f} %"
    return [row.structure, *percents, f"{row.aic:.2f}", f"{row.bic:.2f}", *paths, noise]
