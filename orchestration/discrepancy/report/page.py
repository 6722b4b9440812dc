"""The report of a diagnosis: one page that tells what is wrong, shows it, and lets others check it."""

from __future__ import annotations

import platform
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Effect
from fmus.kit.errors import UserError
from fmus.kit.units import shown_difference, unit_of_differences
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.report import elements as marks
from orchestration.discrepancy.report import figures
from orchestration.discrepancy.report import wording as words
from orchestration.discrepancy.report.figures import EXTENDED, NOMINAL, REFITTED, Run
from orchestration.discrepancy.selection.search import Data, Evidence
from orchestration.fmu.model import Model
from orchestration.identify.metrics import normalised_rms, rms
from orchestration.records import Record
from orchestration.reporting.page import Markup, Page, escaped

if TYPE_CHECKING:
    from orchestration.discrepancy.design.experiment import Separation
    from orchestration.discrepancy.extended_model import Gain
    from orchestration.discrepancy.residuals.correlation import Shown

Array = NDArray[np.float64]
Simulated = dict[str, dict[str, Array]]  # outputs by the label of the run and the name, SI
_LISTED = 5  # lines, jumps, and what a residual goes along with


@dataclass(frozen=True)
class Context:
    """What a diagnosis does not know of itself.

    Attributes
    ----------
    record : Record
    model : Model
    command : sequence of str
        That made the page.
    effects : sequence of type[Effect]
        The catalogue that was looked through.
    holdout : Record, optional
        Another record that was held out.
    gain : Gain, optional
        What the exported FMU says of the data held out; then it is what is shown there.
    shown : Mapping of str to Shown, optional
        What the residual of the best model goes along with, by output.
    experiment : Separation, optional
        That would tell rivals apart.
    """

    record: Record
    model: Model
    command: Sequence[str]
    effects: Sequence[type[Effect]] = ()
    holdout: Record | None = None
    gain: Gain | None = None
    shown: Mapping[str, Shown] = field(default_factory=dict)
    experiment: Separation | None = None

    @property
    def records(self) -> list[Record]:
        """All that was read."""
        return [self.record, *([self.holdout] if self.holdout else [])]


def page(found: Diagnosis, context: Context) -> Page:
    """Make the page.

    Parameters
    ----------
    found : Diagnosis
    context : Context

    Returns
    -------
    Page
    """
    more = "".join(f'<span class="detail">{line}</span>' for line in words.details(found))
    verdict = Markup(f"{marks.chip(found.verdict, found.verdict)} {escaped(words.sentence(found))}{more}")
    made = Page(f"{context.model.name} against {context.record.source.name}", verdict, marks.STYLE)
    runs, unseen = _simulated(_runs(found), found.unseen.simulated)
    if context.gain:
        own = {REFITTED: context.gain.base, EXTENDED: context.gain.extended}
        unseen |= {name: simulated for name, simulated in own.items() if name in unseen}
    _summary(made, found, context)
    _gain(made, found, context, runs, unseen)
    _curves(made, found, context, runs, unseen)
    _evidence(made, found, context)
    _parameters(made, found)
    _left(made, found, context)
    if found.notes:
        made.heading("What could not be judged")
        made.items(found.notes)
    if context.experiment:
        made.heading("An experiment that would tell more")
        made.text(
            f"{context.experiment.sentence()} Save it as experiment.toml, and ppy run experiment.toml rehearses it."
        )
        made.code([context.experiment.toml(context.model.name)])
    _data(made, context)
    _reproduce(made, context)
    return made


def _runs(found: Diagnosis) -> list[Run]:
    base = found.selection.base
    runs = [Run(NOMINAL, replace(base, fitted=replace(base.fitted, values={}))), Run(REFITTED, base)]
    best = found.selection.best
    return [*runs, Run(EXTENDED, best)] if found.selection.steps else runs


def _simulated(runs: Sequence[Run], simulate: Callable[[Evidence], dict[str, Array]]) -> tuple[list[Run], Simulated]:
    """Simulate every model; one that cannot be, as the nominal one may not, is left out."""
    done: Simulated = {}
    for run in runs:
        try:
            done[run.label] = simulate(run.evidence)
        except UserError:
            if run.label != NOMINAL:
                raise
    return [run for run in runs if run.label in done], done


def _measured(data: Data) -> Data:
    """Data without outputs of which nothing was measured."""
    return replace(data, measured={o: y for o, y in data.measured.items() if np.isfinite(y).any()})


def _any(data: Data) -> NDArray[np.bool_]:
    """Samples at which anything was measured."""
    return np.any([np.isfinite(y) for y in data.measured.values()], axis=0)


def _at(signals: Mapping[str, Array], there: NDArray[np.bool_]) -> dict[str, Array]:
    return {name: values[there] for name, values in signals.items()}


# --- sections -------------------------------------------------------------------------------------------------------


def _summary(made: Page, found: Diagnosis, context: Context) -> None:
    """What was fitted to, and what was held out."""
    data, unseen = found.data, found.unseen
    if unseen.first == 0:
        fitted, judged = (int(_any(part).sum()) for part in (data, unseen.data))
        made.parts.append(marks.aside(
            f"{' and '.join(found.left)}: {context.record.source.name} is sampled unevenly, so every third sample was "
            f"held out: fitted to {fitted}, judged on {judged}."
        ))  # fmt: skip
        return
    last = unseen.data.time[unseen.first :]
    where = "that follow" if context.holdout is None else f"of {context.holdout.source.name}"
    made.parts.append(marks.aside(
        f"{' and '.join(found.left)}: fitted to {_length(data.time)} of {context.record.source.name} "
        f"({len(data.time)} samples), judged on the {_length(last)} {where} ({len(last)} samples)."
    ))  # fmt: skip


def _gain(made: Page, found: Diagnosis, context: Context, runs: Sequence[Run], simulated: Simulated) -> None:
    """How far off every model is where nothing was fitted."""
    made.heading("Error on data that no fit has seen")
    first = found.unseen.first
    for output, y in _measured(found.unseen.data).measured.items():
        rows = []
        for run in runs:
            misses = y[first:] - simulated[run.label][output][first:]
            share = 100.0 * normalised_rms(y[first:], simulated[run.label][output][first:])
            size = words.pretty(shown_difference(rms(misses), context.model.outputs[output], 3))
            percent = f"{share:.3g} %" if share < 100.0 else f"{share:.0f} %"
            text = Markup(f"{percent} · {size}") if np.isfinite(share) else size
            rows.append((run.label, run.colour, share, text))
        made.parts.append(marks.bars(output, rows))
    made.parts.append(marks.aside(
        "Root mean square of measured minus simulated: in percent of that of the measurement about its mean, and in "
        f"its unit. {NOMINAL.capitalize()}: the model as it came; {REFITTED}: with all parameters fitted"
        + (f"; {EXTENDED}: with {found.selection.best.candidate.name} as well" if found.selection.steps else "")
        + (". Simulated by the exported FMU and that of the base model." if context.gain else ".")
    ))  # fmt: skip


def _curves(made: Page, found: Diagnosis, context: Context, runs: Sequence[Run], simulated: Simulated) -> None:
    """Measured and simulated over time, and what is between them."""
    unseen, model = found.unseen, context.model
    if context.holdout is None:
        made.heading("The record and the model")
        if unseen.first == 0:
            made.parts.append(marks.aside("Only samples that were held out are shown."))
            there = _any(unseen.data)
            data = _measured(unseen.data).where(there)
            made.plot(*figures.over_time(model, data, runs, {n: _at(s, there) for n, s in simulated.items()}, None))
            return
        made.plot(
            *figures.over_time(model, _measured(unseen.data), runs, simulated, (unseen.first, "fitted", "held out"))
        )
        return
    made.heading("The record held out")
    made.parts.append(marks.aside(context.holdout.source.name))
    parts = (unseen.first, "start fitted", "judged")
    made.plot(*figures.over_time(model, _measured(unseen.data), runs, simulated, parts))
    made.heading("The record fitted to")
    made.parts.append(marks.aside(context.record.source.name))
    data = _measured(found.data)

    def over(e: Evidence) -> dict[str, Array]:
        signals = e.problem.model.run(data.time, data.inputs, e.problem.start | e.fitted.values).signals
        return {output: signals[output] for output in data.measured}

    made.plot(*figures.over_time(model, data, *_simulated(runs, over), None))


@dataclass(frozen=True)
class _Tried:
    """An effect that was fitted, and what became of it."""

    evidence: Evidence
    gain: float
    p_value: float
    verdict: str
    why: str = ""


def _tried(found: Diagnosis) -> list[_Tried]:
    """Every effect that was fitted, once: those named, those not told apart from them, others by their last look."""
    steps, tried = found.selection.steps, found.selection.tried
    below = [found.selection.base, *(step.chosen for step in steps)]
    named = [step.chosen.last for step in steps]
    rows = [_Tried(step.chosen, step.gain, step.p_value, "named") for step in steps]
    for step, under in zip(steps, below, strict=False):
        for rival in step.rivals:
            gain = step.gain - (rival.fitted.bic - step.chosen.fitted.bic)
            why = f"from {step.chosen.last}"
            rows.append(_Tried(rival, gain, rival.p_value(under, tried), "not told apart", why))
    told = {row.evidence.last for row in rows}
    looks: dict[str, list[tuple[Evidence, float, Evidence]]] = {}
    for look, under in zip([*(step.rejected for step in steps), found.selection.rejected], below, strict=True):
        for evidence, gain in look:
            looks.setdefault(evidence.last, []).append((evidence, gain, under))
    others = []
    for name in looks.keys() - told:
        evidence, gain, under = looks[name][-1]
        why = words.why_not([g for _, g, _ in looks[name]], " and ".join(named))
        others.append(_Tried(evidence, gain, evidence.p_value(under, tried), "rejected", why))
    return rows + sorted(others, key=lambda row: (-row.gain, row.evidence.candidate.name))


def _evidence(made: Page, found: Diagnosis, context: Context) -> None:
    """What speaks for every effect, and why it was named or not."""
    made.heading("Evidence: what was tried")
    rows = _tried(found)
    if rows:
        most = max(row.gain for row in rows)
        head = ["effect", "fall of BIC", "p-value", "verdict"]
        made.table(head, [[
            marks.two(row.evidence.last, words.does(row.evidence.effect)),
            marks.bar(row.gain, most), words.probability(row.p_value),
            marks.two(marks.chip(row.verdict, row.verdict), row.why),
        ] for row in rows])  # fmt: skip
        made.parts.append(marks.aside(
            "BIC weighs how likely a model makes the record against the number of its parameters. Its fall is less the "
            f"price of looking at {found.selection.tried} effects, and p-values are corrected for that. Every "
            "candidate refits all parameters and the colour of the noise."
        ))  # fmt: skip
    fitted = {row.evidence.last for row in rows}
    rest = [label(effect) for effect in context.effects if label(effect) not in fitted]
    if rest:
        none = "Looked at; none was promising enough to be fitted" if found.selection.tried else "Not tried"
        why = "Less promising, and so not fitted" if rows else none
        made.text(f"{why}: {', '.join(rest)}.")


def _parameters(made: Page, found: Diagnosis) -> None:
    """Values with intervals beside nominal."""
    best = found.selection.best
    declared, estimates = best.problem.declared, found.estimates
    owner = {name: label(effect) for effect in best.candidate.effects for name in effect.declared}
    starts = [name for name in estimates if name.endswith("_start")]
    scale = marks.Scale.of([e for name, e in estimates.items() if name not in owner and name not in starts])
    rows = []
    for name, e in estimates.items():
        if name in starts:
            continue
        value, interval, nominal = words.estimate(e, declared[name])
        note: str = marks.chip("differs", words.change(e)) if name in found.differing else words.change(e)
        if name in owner:
            note = f"without {owner[name]}" if e.nominal == declared[name].start else ""
        drawn = "" if name in owner else scale.drawn(e, name in found.differing)
        rows.append([marks.two(name, declared[name].doc), marks.two(value, interval), marks.two(nominal, note), drawn])
    made.heading("Parameters")
    made.table(["parameter", "value (95 %)", "nominal", scale.title], rows)
    marked = "Marked are those that surely and noticeably differ from nominal." if found.differing else ""
    made.parts.append(marks.aside(f"Of {best.candidate.cls.name}, fitted. {marked}"))
    if starts:
        told = [(name.removesuffix("_start"), *words.estimate(estimates[name], declared[name])) for name in starts]
        texts = [f"{escaped(name)} {value} ({interval})" for name, value, interval, _ in told]
        made.text(Markup(f"Where the states start: {'; '.join(texts)}."))


def _left(made: Page, found: Diagnosis, context: Context) -> None:
    """What no model explains, before and after."""
    made.heading("What is left")
    runs = [run for run in _runs(found) if run.label != NOMINAL]
    least, step, most = np.quantile(np.diff(found.data.time), [0.05, 0.5, 0.95])
    for output, rest in found.left.items():
        signal = context.model.outputs[output]
        texts: list[str] = [f"Once the colour of the noise is taken off: {rest.whiteness.summary()}."]
        for line in rest.lines[:_LISTED]:
            size = words.pretty(shown_difference(line.amplitude, signal, 3))
            texts.append(Markup(f"A line at {line.frequency:.4g} Hz with an amplitude of {size}."))
        for jump in rest.jumps[:_LISTED]:
            size = words.pretty(shown_difference(jump.size, signal, 3))
            texts.append(Markup(f"A jump of {size} at {jump.time:.6g} s."))
        for what, many in (("lines", len(rest.lines)), ("jumps", len(rest.jumps))):
            texts += [f"{many - _LISTED} more {what}."] if many > _LISTED else []
        if output in context.shown:
            known = context.shown[output]
            along = [a.text for a in known.associations if a.significant][:_LISTED]
            along += [region.text for region in known.regions if region.significant][:_LISTED]
            texts += [line[:1].upper() + line[1:] + "." for line in along]
        made.parts.append(f"<h3>{escaped(output)}</h3>")
        made.items(texts)
        if most > 2.0 * least:
            made.text("Sampling is uneven, so there is no spectrum and no autocorrelation to show.")
            continue
        best = found.selection.best
        unit, lines = (signal.unit, unit_of_differences(signal)), [line.frequency for line in rest.lines[:_LISTED]]
        present, noise = best.problem.present[output], best.fitted.noise[output]
        spectra, correlations = figures.of_residual(unit, float(step), present, noise, runs, output, lines)
        made.parts.append('<div class="pair">')
        made.plot(spectra, "Spectrum of measured minus simulated, where the model was fitted.")
        made.plot(correlations, "Autocorrelation, once the colour of the noise is taken off.")
        made.parts.append("</div>")


def _data(made: Page, context: Context) -> None:
    """What was repaired in the files."""
    made.heading("The data")
    for record in context.records:
        told = [f"{'repaired' if r.changed_data else 'noted'}: {r.message}" for r in record.repairs]
        made.text(f"{record.source.name}: {'as follows.' if told else 'nothing had to be repaired.'}")
        made.items(told)


def _reproduce(made: Page, context: Context) -> None:
    """The command, and what it was given."""
    made.heading("How to reproduce")
    made.code([shlex.join(context.command)])
    which = {"ppy-rig": version("ppy-rig"), "Python": platform.python_version()}
    which |= {f"SHA-256 of {record.source.name}": _digest(record.source) for record in context.records}
    made.items([Markup(f"{escaped(name)}: <code>{escaped(text)}</code>") for name, text in which.items()])
    made.text("Nothing is drawn at random: the same files give the same page.")


def _length(time: Array) -> str:
    values, unit = figures.readable(time)
    return f"{values[-1] - values[0]:.4g} {unit}"


def _digest(path: Path) -> str:
    try:
        return sha256(path.read_bytes()).hexdigest()
    except OSError:
        return "cannot be read again"
