"""From a record to a verdict: fit on its first part, name what the model gets wrong, confirm on the part held out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from fmus.kit import Component, Effect
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.data.holdout import HELD_OUT, Prediction, Unseen
from orchestration.discrepancy.data.screening import lasting, moves, trusted, usable
from orchestration.discrepancy.residuals.correlation import Shown, show
from orchestration.discrepancy.residuals.lines import Jump, Line, jumps, lines, startled
from orchestration.discrepancy.selection.search import Data, Evidence, Search
from orchestration.discrepancy.selection.stepwise import Selection, select
from orchestration.discrepancy.validation.estimates import absurd, differing, estimates
from orchestration.identify.grey_box import Estimate
from orchestration.identify.metrics import Whiteness, number, whiteness
from orchestration.identify.noise import segments

Array = NDArray[np.float64]
_SHORTEST = 150  # samples to fit to
_WORSE = 1.1  # times the error before, above which it has grown
_FORM = 0.25  # of the structure in a residual that may be left beside a cause, which never has the catalogue's form
_BEYOND_DOUBT = 1e-4  # probability of what counts as structure that is left
_MOSTLY = 0.75  # share of what an effect does that another would do too, to be told


@dataclass(frozen=True)
class Left:
    """What is left of one output after all that was found.

    Attributes
    ----------
    lines : list of Line
    jumps : list of Jump
    whiteness : Whiteness
        Of the innovations.
    startled : float
        How probable it is in noise that innovations are so much larger where an input steps.
    shown : Shown
        What it goes along with, where it is larger than elsewhere, and whether it wanders.
    even : bool
        Whether samples are equally spaced; else only where it is larger can be told.
    """

    lines: list[Line]
    jumps: list[Jump]
    whiteness: Whiteness
    startled: float
    shown: Shown
    even: bool = True

    @property
    def texts(self) -> list[str]:
        """What cannot be noise, beside lines and jumps: one line each, the most telling first."""
        shown = self.shown
        regions = [region.text for region in shown.regions if region.p_value < _BEYOND_DOUBT]
        if not self.even:
            return regions
        found = ["it wanders slowly"] if shown.slow.significant else []
        found += ["it is worse where an input steps"] if self.startled < _BEYOND_DOUBT else []
        return found + regions + [a.text for a in shown.associations if a.p_value < _BEYOND_DOUBT]


@dataclass(frozen=True)
class Diagnosis:
    """The verdict and what it rests on.

    Attributes
    ----------
    verdict : {"consistent", "recalibrate", "cause", "ambiguous", "unexplained"}
    selection : Selection
    estimates : dict of str to Estimate
        Of the best model, fitted to all that was measured.
    differing : list of str
        Parameters that differ from nominal, the surest first.
    left : dict of str to Left
        By output, of the best model where it was fitted.
    before, after : dict of str to float
        Normalised RMS error on the part held out, of the refitted base and of the best model, by output.
    data : Data
        What was fitted to.
    unseen : Unseen
        What was held out.
    final : Evidence
        The best model fitted to all that was measured, now that its gain is known; the estimates are its.
    notes : list of str
        What could not be judged, and why.
    """

    verdict: str
    selection: Selection
    estimates: dict[str, Estimate]
    differing: list[str]
    left: dict[str, Left]
    before: dict[str, float]
    after: dict[str, float]
    data: Data
    unseen: Unseen
    final: Evidence
    notes: list[str] = field(default_factory=list)

    @property
    def causes(self) -> list[str]:
        """Effects named, in the order in which they were found."""
        return [step.chosen.last for step in self.selection.steps]

    def as_json(self) -> dict[str, Any]:
        """Figures in the form of the design, section 8."""
        best = self.selection.best
        causes = []
        for step in self.selection.steps:
            effect = step.chosen.effect
            own = [name for name in best.candidate.parameters if name in effect.declared]
            causes.append({
                "effect": effect.id, "component": self.selection.base.candidate.cls.name,
                **({"output": effect.output} if effect.output else {}),
                "parameters": {name: _json(self.estimates[name]) for name in own},
                "evidence": {"delta_bic": step.gain, "p_value": step.p_value},
            })  # fmt: skip
        alternatives = [
            {"effect": e.last, "instead_of": cause,
             "delta_bic": s.gain + s.chosen.fitted.bic - e.fitted.bic}
            for cause, s in zip(self.causes, self.selection.steps, strict=True) for e in s.rivals
        ]  # fmt: skip
        gain = {
            "holdout_nrmse_before": {o: number(e) for o, e in self.before.items()},
            "holdout_nrmse_after": {o: number(e) for o, e in self.after.items()},
            "residual_white_after": all(left.whiteness.is_white for left in self.left.values()),
        }  # fmt: skip
        return {
            "verdict": self.verdict,
            "baseline": {"holdout_fit_percent": {o: number(100.0 * (1.0 - e)) for o, e in self.before.items()}},
            "parameters": {name: _json(e) for name, e in self.estimates.items()},
            "differing": self.differing,
            "causes": causes, "alternatives": alternatives, "gain": gain, "notes": self.notes,
            "left": {
                o: {"lines_hz": [line.frequency for line in l.lines], "jumps_s": [j.time for j in l.jumps],
                    "other": l.texts} for o, l in self.left.items()
            },
        }  # fmt: skip


def _json(e: Estimate) -> dict[str, Any]:
    return {"value": e.value, "ci95": [number(end) for end in e.interval], "nominal": e.nominal, "unit": e.unit}


def searched(cls: type[Component]) -> list[str]:
    """Parameters that every candidate refits: the physical ones, and where the continuous states start."""
    layout = cls.layout
    others = {d.period for d in layout.discretes} | {f"{d.name}_start" for d in layout.discretes}
    return [p.name for p in layout.parameters if p.type == "real" and p.name not in others]


# fits run side by side, and the matrices are narrow: a thread for each product would only wait for the others
@threadpool_limits.wrap(limits=1)
def diagnose(
    cls: type[Component],
    data: Data,
    effects: Sequence[type[Effect]],
    fixed: Mapping[str, float] | None = None,
    progress: Callable[[str], None] = lambda text: None,
    holdout: Data | None = None,
    held: Sequence[str] = (),
) -> Diagnosis:
    """Tell what a model gets wrong on a record.

    Parameters
    ----------
    cls : type[Component]
    data : Data
        The record.
    effects : sequence of type[Effect]
        The catalogue.
    fixed : Mapping of str to float, optional
        Values of parameters where the search starts.
    progress : callable
        Told what is being done.
    holdout : Data, optional
        Another record to judge by; without it the last third of the record is held out.
    held : sequence of str
        Parameters that are known, and keep their values. Where no input moves, a record can be judged only if every
        start value is among them.

    Returns
    -------
    Diagnosis

    Raises
    ------
    UserError
        If the model cannot be simulated over the record, or no output can be trusted.
    """
    data, first, unseen, notes = _divided(cls, data, holdout, fixed or {})
    search = Search(first, cls, [n for n in searched(cls) if n not in held], fixed or {}, progress)
    still = not moves(cls, first, fixed or {})
    starts = [name for name in search.parameters if name.endswith("_start")]
    idle = still and bool(starts)  # without knowing where it starts, how it settles tells nothing
    if idle:
        if any(np.ptp(values) > 0.0 for values in first.inputs.values()):
            notes.append("no input moves by more than is lost in the noise of the outputs: nothing can be judged")
        notes.append(f"if it started at rest, say so, and it can be judged how it settled: --hold {','.join(starts)}")
    elif still:
        notes = [note for note in notes if not note.startswith("no input moves")]
    found = Selection(search.nominal()) if idle else select(search, effects)
    found, predictions, dropped = _confirmed(found, unseen)
    notes += dropped
    final = replace(search, data=data).refitted(found.best) if unseen.continued else found.best
    known = estimates(final)
    others = [] if idle else differing(final, search.parameters)
    odd = absurd(known, search.parameters)
    notes += [f"out of all reason: {', '.join(odd)}; look at units, signs and columns first"] if odd else []
    shown = show(found.best, first)
    left = {output: _left(found.best, output, first, shown[output]) for output in found.best.fitted.residual}
    notes += [f"{name} was not judged: {reason}" for name, reason in sorted(search.unjudged.items())]
    notes += _confounded(found)
    verdict = "ambiguous" if idle else "unexplained" if odd else _verdict(found, left, others)
    before, after = predictions[0].errors, predictions[-1].errors
    gained = any(after[o] < before[o] for o in before) and not any(after[o] > _WORSE * before[o] for o in before)
    if found.steps and not gained:
        notes.append(
            "no gain is claimed: with what was named the part held out is likelier, given how uncertain the parameters "
            "are, but the error there is not smaller in every output"
        )
    return Diagnosis(verdict, found, known, others, left, before, after, first, unseen, final, notes)


def _divided(
    cls: type[Component], data: Data, holdout: Data | None, fixed: Mapping[str, float]
) -> tuple[Data, Data, Unseen, list[str]]:
    """Return what can be trusted, what of it is fitted to, what is held out, and what was left out of either."""
    least = round(_SHORTEST / (1.0 - HELD_OUT)) if holdout is None else _SHORTEST
    if len(data.time) < least:
        raise UserError(f"{len(data.time)} samples are too few for a diagnosis; {least} are the least")
    data, notes = trusted(cls, data, fixed)
    if holdout is not None:
        holdout, more = trusted(cls, holdout, fixed)
        notes += [f"in the record held out: {note}" for note in more if note not in notes]
    data, early = lasting(data)
    first, unseen = Unseen.part_of(data) if holdout is None else (data, Unseen.another(holdout))
    kept = usable(first)
    notes += early + [f"{o}: too little of it is without gaps to say anything" for o in first.measured if o not in kept]
    first, data = first.only(kept), data.only(kept)
    unseen = replace(unseen, data=unseen.data.only(kept))
    if not (first.measured and unseen.data.measured):
        raise UserError("; ".join(["no output can be both fitted and judged", *notes]))
    notes += [
        f"{o}: not in the record held out, so nothing of it is judged there"
        for o in kept
        if o not in unseen.data.measured
    ]
    return data, first, unseen, notes


def _confirmed(found: Selection, unseen: Unseen) -> tuple[Selection, list[Prediction], list[str]]:
    """Keep the steps that make what nothing was fitted to more likely; of each what it says there."""
    models = [found.base, *(step.chosen for step in found.steps)]
    predictions = [unseen.predicted(models[0])]
    for k, richer in enumerate(models[1:]):
        prediction, noise = unseen.predicted(richer), richer.fitted.noise
        if unseen.misfit(prediction, noise) >= unseen.misfit(predictions[-1], noise):
            dropped = ", ".join(model.last for model in models[k + 1 :])
            note = f"{dropped}: fits what was fitted to better, but not the part held out, and is not claimed"
            return replace(found, steps=found.steps[:k]), predictions, [note]
        predictions.append(prediction)
    return found, predictions, []


def _confounded(found: Selection) -> list[str]:
    """What else may be behind part of what was named."""
    named = {label(effect) for effect in found.best.candidate.effects}
    told = []
    for step in found.steps:
        rivals = {rival.last for rival in step.rivals}
        near = {name: share for name, share in step.alike.items() if share > _MOSTLY and name not in named | rivals}
        if near:
            others = ", ".join(f"{name} ({100.0 * near[name]:.0f} %)" for name in sorted(near, key=lambda n: -near[n]))
            told.append(f"{step.chosen.last}: much of what it does, others would do: {others}")
    return told


def _verdict(found: Selection, left: Mapping[str, Left], differing: Sequence[str]) -> str:
    if any(rest.lines or rest.jumps for rest in left.values()):
        return "unexplained"
    # what was named is never quite of the form that the catalogue gives it, and that leaves something where it acts
    before, after = found.base.fitted, found.best.fitted
    floor = {o: noise.deviation**2 for o, noise in after.noise.items()}
    rest_of = {o: np.var(after.residual[o]) - floor[o] for o in left}
    small = {o: bool(found.steps) and rest_of[o] < _FORM * (np.var(before.residual[o]) - floor[o]) for o in left}
    if any(rest.texts and not small[o] for o, rest in left.items()):
        return "unexplained"
    if found.steps:
        return "ambiguous" if any(step.rivals for step in found.strong) else "cause"
    return "recalibrate" if differing else "consistent"


def _left(evidence: Evidence, output: str, data: Data, shown: Shown) -> Left:
    residual = evidence.fitted.residual[output]
    present = evidence.problem.present[output]
    time, inputs = data.time[present], {name: values[present] for name, values in data.inputs.items()}
    step = float(np.median(np.diff(data.time)))
    white = whiteness(evidence.fitted.innovation[output])
    at = evidence.fitted.noise[output].kept(present)
    surprise = startled(evidence.fitted.innovation[output], at, data.inputs)
    if not evidence.problem.even:  # samples say nothing of frequencies, nor of what is sudden
        return Left([], [], white, surprise, shown, even=False)
    a, b = max(segments(present, 0), key=lambda ends: ends[1] - ends[0])
    hums = lines(residual[a:b], step, data.measured[output][present][a:b])
    return Left(hums, jumps(residual, time, inputs), white, surprise, shown)
