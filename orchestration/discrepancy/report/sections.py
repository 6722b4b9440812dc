"""Sections of the report: errors, curves, parameters and residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from fmus.kit.units import shown_difference, unit_of_differences
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.pipeline import Result, file_names
from orchestration.discrepancy.report import elements, figures, typography, wording
from orchestration.discrepancy.report.errors import error_rows
from orchestration.discrepancy.report.figures import EXTENDED, NOMINAL, REFITTED, ShownModel
from orchestration.discrepancy.validation.prediction import predict
from orchestration.identify.metrics import rms
from orchestration.records.joined import base_name, shown_name
from orchestration.reporting.page import Markup, Page, escaped

Array = NDArray[np.float64]
Simulated = dict[str, dict[str, Array]]  # outputs by the label of the model and the name, SI
_LISTED = 5  # lines, jumps, and what a residual correlates with


def shown_models(result: Result) -> tuple[list[ShownModel], Simulated]:
    """Return the models that are shown beside the measurement, and their outputs over the validation data.

    Those of the FMUs are taken where they were run.
    """
    validation = result.diagnosis.validation
    models, simulated = _simulated(
        _models(result.diagnosis), lambda model: predict(validation, model).simulated
    )
    if result.gain:
        own = {REFITTED: result.gain.base, EXTENDED: result.gain.extended}
        simulated |= {name: outputs for name, outputs in own.items() if name in simulated}
    return models, simulated


def _models(diagnosis: Diagnosis) -> list[ShownModel]:
    base = diagnosis.selection.base
    models = [
        ShownModel(NOMINAL, replace(base, fit=replace(base.fit, values={}))),
        ShownModel(REFITTED, base),
    ]
    best = diagnosis.selection.best
    return [*models, ShownModel(EXTENDED, best)] if diagnosis.selection.steps else models


def _simulated(
    models: Sequence[ShownModel], simulate: Callable[[FittedCandidate], dict[str, Array]]
) -> tuple[list[ShownModel], Simulated]:
    """Simulate every model; one that cannot be, as the nominal one may not, is left out."""
    done: Simulated = {}
    for shown in models:
        try:
            done[shown.label] = simulate(shown.model)
        except UserError:
            if shown.label != NOMINAL:
                raise
    return [shown for shown in models if shown.label in done], done


def _measured(data: Dataset) -> Dataset:
    """Data without outputs of which nothing was measured."""
    return replace(data, measured={o: y for o, y in data.measured.items() if np.isfinite(y).any()})


def anywhere(data: Dataset) -> NDArray[np.bool_]:
    """Samples at which anything was measured."""
    return np.any([np.isfinite(y) for y in data.measured.values()], axis=0)


def _at(signals: Mapping[str, Array], there: NDArray[np.bool_]) -> dict[str, Array]:
    return {name: values[there] for name, values in signals.items()}


def gain(made: Page, result: Result, models: Sequence[ShownModel], simulated: Simulated) -> None:
    """How far off every model is where nothing was fitted."""
    diagnosis = result.diagnosis
    made.heading("Error on data that no fit has seen")
    validation = diagnosis.validation
    for output, y in _measured(diagnosis.validation.data).measured.items():
        rows = []
        for shown in models:
            values = simulated[shown.label][output]
            misses = (y - values)[validation.judged]
            share = 100.0 * validation.nrmse({**validation.data.measured, output: values})[output]
            size = typography.pretty(shown_difference(rms(misses), result.model.outputs[output], 3))
            percent = f"{share:.3g} %" if share < 100.0 else f"{share:.0f} %"
            text = Markup(f"{percent} · {size}") if np.isfinite(share) else size
            rows.append((shown.label, shown.colour, share, text))
        made.parts.append(elements.bars(output, rows))
    made.parts.append(
        elements.aside(
            "Root mean square of measured minus simulated: in percent of that of the measurement about its mean, and in "
            f"its unit. {NOMINAL.capitalize()}: the model as it came; {REFITTED}: with all parameters fitted"
            + (
                f"; {EXTENDED}: with {diagnosis.selection.best.candidate.name} as well"
                if diagnosis.selection.steps
                else ""
            )
            + (
                ". Simulated by the exported FMU and that of the base model."
                if result.gain
                else "."
            )
        )
    )
    head, body = error_rows(diagnosis)
    made.table(head, body)
    made.parts.append(
        elements.aside(
            "Errors over the spread of the measurement, also where it was fitted. Least squares fits the free run of the "
            "model without effects, from several starts; what is refitted stays within 2 % of it."
        )
    )


def curves(made: Page, result: Result, models: Sequence[ShownModel], simulated: Simulated) -> None:
    """Measured and simulated over time, and what is between them."""
    diagnosis, model = result.diagnosis, result.model
    validation = diagnosis.validation
    several = bool(diagnosis.estimation.several or validation.data.several)
    if result.holdout is None and not validation.data.several:
        made.heading("The record and the model")
        if validation.first == 0:
            made.parts.append(elements.aside("Only samples that were held out are shown."))
            there = anywhere(validation.data)
            data = _measured(validation.data).where(there)
            made.plot(
                *figures.over_time(
                    model, data, models, {n: _at(s, there) for n, s in simulated.items()}, None
                )
            )
            return
        made.plot(
            *figures.over_time(
                model,
                _measured(validation.data),
                models,
                simulated,
                (validation.first, "fitted", "held out"),
            )
        )
        return
    made.heading("The records held out" if several else "The record held out")
    made.parts.append(elements.aside(file_names(result.holdouts or result.records)))
    parts = None if validation.data.several else (validation.first, "start fitted", "judged")
    made.plot(*figures.over_time(model, _measured(validation.data), models, simulated, parts))
    made.heading("The records fitted to" if several else "The record fitted to")
    made.parts.append(elements.aside(result.files))
    data = _measured(diagnosis.estimation)

    def over(e: FittedCandidate) -> dict[str, Array]:
        values = e.problem.start | e.fit.values
        signals = e.problem.model.run(data.time, data.inputs, values, runs=data.runs).signals
        return {output: signals[output] for output in data.measured}

    made.plot(*figures.over_time(model, data, *_simulated(models, over), None))


def parameters(made: Page, diagnosis: Diagnosis) -> None:
    """Values with intervals beside nominal."""
    best = diagnosis.selection.best
    declared, estimates = diagnosis.final.problem.declared, diagnosis.estimates
    owner = {name: label(effect) for effect in best.candidate.effects for name in effect.declared}
    starts = [name for name in estimates if declared[name].starts]
    scale = elements.Scale.of(
        [e for name, e in estimates.items() if name not in owner and name not in starts]
    )
    rows = []
    for name, e in estimates.items():
        if name in starts:
            continue
        value, interval, nominal = typography.estimate(e, declared[name])
        note: str = (
            elements.chip("differs", typography.change(e))
            if name in diagnosis.changed
            else typography.change(e)
        )
        if name in owner:
            note = f"without {owner[name]}" if e.nominal == declared[name].start else ""
        drawn = "" if name in owner else scale.drawn(e, name in diagnosis.changed)
        rows.append(
            [
                elements.two(shown_name(name), declared[name].doc),
                elements.two(value, interval),
                elements.two(nominal, note),
                drawn,
            ]
        )
    made.heading("Parameters")
    made.table(["parameter", "value (95 %)", "nominal", scale.title], rows)
    marked = (
        "Marked are those that surely and noticeably differ from nominal."
        if diagnosis.changed
        else ""
    )
    made.parts.append(elements.aside(f"Of {best.candidate.cls.name}, fitted. {marked}"))
    if starts:
        values = [
            (_state(name, declared), *typography.estimate(estimates[name], declared[name]))
            for name in starts
        ]
        texts = [f"{escaped(name)} {value} ({interval})" for name, value, interval, _ in values]
        made.text(Markup(f"Where the states start: {'; '.join(texts)}."))


def _state(name: str, declared: Mapping[str, Any]) -> str:
    """Name of the state that a parameter is the start value of, with the run that starts there."""
    return shown_name(name.replace(base_name(name), declared[name].starts, 1))


def residuals(made: Page, result: Result) -> None:
    """What no model explains, before and after."""
    diagnosis = result.diagnosis
    made.heading("What is left")
    models = [shown for shown in _models(diagnosis) if shown.label != NOMINAL]
    best, step = diagnosis.selection.best, np.median(np.diff(diagnosis.estimation.time))
    for output, analysis in diagnosis.residuals.items():
        signal = result.model.outputs[output]
        texts: list[str] = [
            f"Once the colour of the noise is taken off: {analysis.whiteness.summary()}."
        ]
        for line in analysis.lines[:_LISTED]:
            size = typography.pretty(shown_difference(line.amplitude, signal, 3))
            texts.append(Markup(f"A line at {line.frequency:.4g} Hz with an amplitude of {size}."))
        for jump in analysis.level_shifts[:_LISTED]:
            size = typography.pretty(shown_difference(jump.size, signal, 3))
            texts.append(Markup(f"A jump of {size} at {jump.time:.6g} s."))
        for what, many in (("lines", len(analysis.lines)), ("jumps", len(analysis.level_shifts))):
            texts += [f"{many - _LISTED} more {what}."] if many > _LISTED else []
        dependences = [wording.correlation(c) for c in analysis.correlations if c.significant][
            :_LISTED
        ]
        dependences += [wording.mean(m) for m in analysis.means if m.significant][:_LISTED]
        dependences += [wording.region(r) for r in analysis.regions if r.significant][:_LISTED]
        texts += [line[:1].upper() + line[1:] + "." for line in dependences]
        made.parts.append(f"<h3>{escaped(output)}</h3>")
        made.items(texts)
        if not diagnosis.estimation.even:
            made.text("Sampling is uneven, so there is no spectrum and no autocorrelation to show.")
            continue
        unit, lines = (
            (signal.unit, unit_of_differences(signal)),
            [line.frequency for line in analysis.lines[:_LISTED]],
        )
        present, noise = best.problem.present[output], best.fit.noise[output]
        spectra, correlations = figures.of_residual(
            unit, float(step), present, noise, models, output, lines
        )
        made.parts.append('<div class="pair">')
        made.plot(spectra, "Spectrum of measured minus simulated, where the model was fitted.")
        made.plot(correlations, "Autocorrelation, once the colour of the noise is taken off.")
        made.parts.append("</div>")
