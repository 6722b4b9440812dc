"""The page of an identification: fitted values, goodness of fit, uncertainty and next steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from fmus.kit import quoting, units
from fmus.kit.titles import capitalised, in_words, law_title, variable_title
from fmus.kit.units import format_prefixed, unit_of_differences, write_prefixed
from orchestration.identify import presentation
from orchestration.identify.comparison import Comparison, GoodnessOfFit, JointComparison
from orchestration.identify.effect_sizes import interval_cells
from orchestration.identify.grey_box import Fit
from orchestration.reporting import flag, make_page, pictures
from orchestration.reporting.html import (
    Bar,
    Markup,
    Page,
    Panel,
    Trace,
    elements,
    escaped,
    stacked,
)

_HOLDOUT = "Hold them against a record that was not fitted to: ppy compare."
_NAMED = 3  # parameters in the first sentence
_HEIGHT, _RESIDUAL_HEIGHT = 190, 110  # pixels
_COLOURS = {
    "simulated": pictures.MODEL,
    "before": pictures.MODEL,
    "fitted": pictures.FITTED,
}  # of runs, by label


@make_page.register(Comparison)
def fit_page(comparison: Comparison, command: str = "") -> Page:
    """Make the page of a comparison, with the fit if there is one.

    Parameters
    ----------
    comparison : Comparison
    command : str
        That made it; unless given, one that makes the same comparison.
    """
    command = command or _repeating_command(comparison)
    return _make_page([comparison], comparison.fit, command)


@make_page.register(Fit)
def parameters_page(fit: Fit, command: str = "") -> Page:
    """Make the page of a fit alone: values, what is doubtful about them, and how they were found.

    Parameters
    ----------
    fit : Fit
    command : str
        That made it.
    """
    page = Page(_values_sentence(fit), "")
    page.heading("What to do next")
    page.items([*fit.all_warnings, _HOLDOUT])
    page.heading("How sure this is")
    _add_parameters(page, fit)
    _add_correlations(page, fit)
    page.heading("How it was found")
    page.text(_method(fit))
    return page


@make_page.register(JointComparison)
def joint_page(joint: JointComparison, command: str = "") -> Page:
    """Make the page of a fit to several records.

    Parameters
    ----------
    joint : JointComparison
    command : str
        That made it.
    """
    return _make_page([*joint.comparisons.values()], joint.fit, command)


def _make_page(comparisons: Sequence[Comparison], fit: Fit | None, command: str) -> Page:
    """Make the page of a comparison, or of a fit to one record or several."""
    sources = dict.fromkeys(one.record.source for one in comparisons)
    first = comparisons[0]
    names = ", ".join(f"<code>{escaped(source.name)}</code>" for source in sources)
    model = f"<code>{escaped(first.model.name)}</code>"
    errors = [*map(_errors_sentence, comparisons)]
    if len(comparisons) > 1:
        errors = [f"{_label(one)}: {text}" for one, text in zip(comparisons, errors, strict=True)]
    if fit is None:
        page = Page(" ".join(errors), "", Markup(f"Comparison of {model} with {names}"))
    else:
        about = Markup(f"Fit of {model} to {names}")
        page = Page(_values_sentence(fit), " ".join(errors), about)
    page.heading("What is wrong")
    for comparison in comparisons:
        if len(comparisons) > 1:
            page.text(f"{_label(comparison)}:")
        for output in comparison.before:
            page.parts.append(
                elements.bar_chart(_title(comparison, output), _bars_of(comparison, output))
            )
    page.text(
        "Root mean square of measured minus simulated over the record, in percent of that of the"
        " measurement about its mean, and in its unit."
    )
    page.heading("The model beside the record")
    for comparison in comparisons:
        page.chart(
            _draw_runs(comparison),
            f"{comparison.record.source.name}: above what was measured and simulated, below the"
            " difference of both.",
        )
    page.heading("What to do next")
    steps = (step for one in comparisons for step in _next_steps(one, fit, command))
    page.items([*dict.fromkeys(steps)])
    page.heading("How sure this is")
    if fit is not None:
        _add_parameters(page, fit)
        _add_correlations(page, fit)
    page.items([text for one in comparisons for text in _uncertainty_remarks(one, fit)])
    page.heading("How it was found")
    page.text(_method(fit))
    page.items([repair.message for one in comparisons for repair in one.record.repairs])
    page.reproduction([*sources], command)
    return page


def _method(fit: Fit | None) -> str:
    """Return a sentence on how the simulations were made."""
    if fit is None:
        return "The model ran free over the record, with the parameters that it was given."
    return (
        "The model ran free over the record, and the sum of squared differences was minimised, each"
        f" output weighted by its own residual: {fit.evaluations} simulations in {fit.searches}"
        f" {'search' if fit.searches == 1 else 'searches'}."
    )


def _repeating_command(comparison: Comparison) -> str:
    """Return a command that makes the same comparison or fit."""
    fit = comparison.fit
    words: list[str | Path] = ["ppy", "identify" if fit else "compare", comparison.record.source]
    words += ["--model", comparison.model.name]
    if fit is not None:
        words += [flag("fit"), ",".join(fit.estimates)]
    for name, value in comparison.parameters.items():
        words += [flag("settings"), f"{name}={value}"]
    return quoting.shell(words)


def _values_sentence(fit: Fit) -> str:
    """Return a sentence with the first fitted values."""
    values = [
        f"{variable_title(fit.declared[name])} {format_prefixed(value, fit.declared[name])}"
        for name, value in fit.values.items()
    ]
    more = len(values) - _NAMED
    listed = ", ".join(values[:_NAMED]) + (f" and {more} more" if more > 0 else "")
    return f"What fits best: {listed}."


def _errors_sentence(comparison: Comparison) -> str:
    """Return a sentence for each output with its error, and that before a fit."""
    sentences = []
    for output, goodness in comparison.latest.items():
        title = _title(comparison, output)
        before = (
            f" instead of {_error_percent(comparison.before[output])}" if comparison.fit else ""
        )
        error = f"off by {_error_percent(goodness)}{before} of what it moves by"
        sentences.append(f"{title} is {'noise alone' if goodness.is_noise_alone else error}.")
    return " ".join(sentences)


def _label(comparison: Comparison) -> str:
    """Return the name of a record among others."""
    return f"{comparison.record.source.name} {comparison.record.label}".strip()


def _error_percent(goodness: GoodnessOfFit) -> str:
    """Return the error of an output in percent; a dash where the output was constant.

    Noise alone has none.
    """
    if goodness.is_noise_alone:
        return "noise alone"
    share = 100.0 - goodness.fit_percent
    return f"{share:.1f} %" if math.isfinite(share) else "–"


def _title(comparison: Comparison, output: str) -> str:
    cls = comparison.model.cls
    return capitalised(in_words(output) if cls is None else law_title(cls, output))


def _bars_of(comparison: Comparison, output: str) -> list[Bar]:
    """Return a bar of the error of an output in each run; none of noise alone."""
    signal = comparison.model.outputs[output]
    bars = []
    for label, run in presentation.runs(comparison).items():
        goodness = run[output]
        size = write_prefixed(goodness.rms, signal.unit)
        length = math.nan if goodness.is_noise_alone else goodness.rms
        bars.append(Bar(label, _COLOURS[label], length, f"{_error_percent(goodness)} · {size}"))
    return bars


def _draw_runs(comparison: Comparison) -> Markup:
    """Draw every output as measured and in each run, and the residuals."""
    panels = []
    for output in comparison.before:
        panels += _panels_of_output(comparison, output)
    time = comparison.record.time
    is_logarithmic = bool(time[0] > 0.0) and pictures.has_logarithmic_steps(time)
    return stacked(panels, "time [s]", is_logarithmic)


def _panels_of_output(comparison: Comparison, output: str) -> list[Panel]:
    """Return the panel of an output, and the one of its residuals."""
    time = comparison.record.time
    signal = comparison.model.outputs[output]
    unit = comparison.record.display_unit(output, signal)
    difference = unit_of_differences(signal)
    measured = units.convert(comparison.before[output].measured, signal.unit, unit)
    traces = [Trace("measured", time, measured, pictures.MEASURED, 3.5)]
    residuals = []
    for label, run in presentation.runs(comparison).items():
        makes_room = run is comparison.latest
        values = units.convert(run[output].simulated, signal.unit, unit)
        residual = units.convert(run[output].residual, signal.unit, difference)
        colour = _COLOURS[label]
        traces.append(Trace(label, time, values, colour, makes_room=makes_room))
        residuals.append(Trace(label, time, residual, colour, makes_room=makes_room))
    return [
        Panel(pictures.with_unit(_title(comparison, output), unit), _HEIGHT, traces),
        Panel(pictures.with_unit("measured − simulated", difference), _RESIDUAL_HEIGHT, residuals),
    ]


def _next_steps(comparison: Comparison, fit: Fit | None, command: str) -> list[str]:
    """Return what to do after a command: by its warnings, then by whiteness of residuals."""
    tests = {output: goodness.whiteness for output, goodness in comparison.latest.items()}
    coloured = [output for output, test in tests.items() if test and not test.is_white]
    steps = [*comparison.remarks, *(fit.all_warnings if fit else ())]
    if coloured:
        steps.append(
            f"What is left of {' and '.join(in_words(output) for output in coloured)} is no noise:"
            " ppy diagnose names what the model lacks, with the same record and model."
        )
    else:
        steps.append("What is left is noise: nothing in this record asks for another model.")
    if fit is None:
        steps.append("Fit parameters to the record: ppy identify.")
        return steps
    if flag("ssv") not in command:
        steps.append("Write the values for any system: ppy identify --ssv values.ssv.")
    steps.append(_HOLDOUT)
    return steps


def _add_parameters(page: Page, fit: Fit) -> None:
    """Add the table of fitted values with their intervals and start values."""
    profiled = ["95 % by profile"] if fit.profiles else []
    rows = []
    for name, estimate in (fit.estimates | fit.tied).items():
        declared = fit.declared[name]
        start = format_prefixed(estimate.nominal, declared, 4, like=estimate.value)
        cells = [*interval_cells(estimate.value, estimate.interval, declared)]
        if fit.profiles:
            cells.append(fit.profiles[name].written if name in fit.profiles else "")
        doc = getattr(declared, "doc", "")
        title = elements.named(capitalised(variable_title(declared)), name, doc)
        rows.append([title, *cells, start])
    page.table(["parameter", "fitted", "95 % interval", *profiled, "started from"], rows)


def _add_correlations(page: Page, fit: Fit) -> None:
    """Add the table of correlations of several parameters."""
    names = [*fit.estimates]
    if len(names) < 2:
        return
    page.table(["correlation", *names], presentation.correlation_rows(fit))


def _uncertainty_remarks(comparison: Comparison, fit: Fit | None) -> list[str]:
    """Return the results of the residual tests, and the strongly correlated parameters."""
    texts = []
    for output, goodness in comparison.latest.items():
        whiteness = goodness.whiteness.summary() if goodness.whiteness else "too short"
        texts.append(f"{_title(comparison, output)}: {whiteness}.")
    texts += [
        f"{in_words(a)} and {in_words(b)} are known together better than each (correlation"
        f" {r:+.2f})."
        for (a, b), r in (fit.coupled.items() if fit else ())
    ]
    return texts
