"""Fits and comparisons as text and tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fmus.kit.units import format_difference, format_value
from orchestration.reporting import plain_table

if TYPE_CHECKING:
    from orchestration.identify.comparison import Comparison, GoodnessOfFit
    from orchestration.identify.grey_box import Fit


def overview(*comparisons: Comparison) -> Group:
    """Return the text of ``ppy compare``, without warnings.

    It has every output of every run of each record, then fitted parameters.

    Parameters
    ----------
    *comparisons : Comparison
        Of one fit.

    Returns
    -------
    Group
    """
    parts: list[RenderableType] = []
    for one in comparisons:
        parts += [goodness(one), Text()]
    fit = comparisons[0].fit
    return Group(*parts[:-1]) if fit is None else Group(*parts, parameters(fit), *coupled(fit))


def goodness(comparison: Comparison) -> Group:
    """Return fit, error and whiteness of every output and run of a record, and remarks."""
    model = comparison.model
    record = comparison.record
    table = plain_table(
        None, "output", "run", "fit", "RMS error", "residual", right=("fit", "RMS error")
    )
    for output in comparison.before:
        for label, run in runs(comparison).items():
            judged = run[output]
            error = format_difference(judged.rms, model.outputs[output])
            residual = judged.whiteness.summary() if judged.whiteness else "too short to judge"
            table.add_row(output, label, _percent(judged), error, residual)
    title = f"{record.source.name} against {model.title}: {record.time.size} samples"
    return Group(Text(title), table, *(Text(f"warning: {line}") for line in comparison.remarks))


def _percent(goodness: GoodnessOfFit) -> str:
    """Write the fit; it is undefined where the measured output was constant."""
    return f"{goodness.fit_percent:.2f} %" if math.isfinite(goodness.fit_percent) else "undefined"


def runs(comparison: Comparison) -> dict[str, dict[str, GoodnessOfFit]]:
    """Return the assessed simulations by label."""
    if comparison.after is None:
        return {"simulated": comparison.before}
    return {"before": comparison.before, "fitted": comparison.after}


def parameters(fit: Fit) -> Table:
    """Return a table of fitted parameters with intervals, in their display units.

    Parameters
    ----------
    fit : Fit

    Returns
    -------
    Table
    """
    profiled = ["95 % by profile"] if fit.profiles else []
    columns = ("fitted", "95 % interval", *profiled, "started from")
    table = plain_table(None, "parameter", *columns, right=columns)
    for name, estimate in (fit.estimates | fit.tied).items():
        declared = fit.declared[name]
        low, high = (format_value(end, declared) for end in estimate.interval)
        cells = [format_value(estimate.value, declared), f"{low} … {high}"]
        if fit.profiles:
            cells.append(fit.profiles[name].written if name in fit.profiles else "")
        table.add_row(name, *cells, format_value(estimate.nominal, declared))
    return table


def correlations(fit: Fit) -> Table:
    """Return the table of correlations of the estimates, below its diagonal."""
    names = [*fit.estimates]
    return plain_table(None, "correlation", *names, right=names, rows=correlation_rows(fit))


def correlation_rows(fit: Fit) -> list[list[str]]:
    """Return a row for each estimate: its name, and correlations with those before it."""
    names = [*fit.estimates]
    rows = []
    for i, (name, row) in enumerate(zip(names, fit.correlation_matrix, strict=True)):
        cells = [f"{r:+.2f}" for r in row[: i + 1]]
        rows.append([name, *cells, *[""] * (len(names) - 1 - i)])
    return rows


def statistics(fit: Fit) -> str:
    """Return the size of the fit, and its criteria of Akaike and of Bayes."""
    count = len(fit.estimates)
    aic = fit.deviance + 2 * count
    bic = fit.deviance + count * math.log(max(fit.samples, 1))
    return (
        f"{fit.samples} measured values, {count} parameters, {fit.evaluations} simulations in"
        f" {fit.searches} {'search' if fit.searches == 1 else 'searches'}\n"
        f"deviance {fit.deviance:.6g}, AIC {aic:.6g}, BIC {bic:.6g}"
    )


def coupled(fit: Fit) -> list[Text]:
    """Return a line on strongly correlated parameters, if there are any."""
    pairs = [f"{a} and {b} ({r:+.2f})" for (a, b), r in fit.coupled.items()]
    if not pairs:
        return []
    return [Text(f"known together better than each, by their correlation: {', '.join(pairs)}")]
