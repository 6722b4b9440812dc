"""What ``ppy diagnose`` shows on the terminal, and the order in which it does its work."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit import archive
from fmus.kit.documentation import shown
from fmus.kit.errors import UserError, suggestion
from orchestration import models
from orchestration.compare import read_for
from orchestration.discrepancy.candidate import catalogue, label
from orchestration.discrepancy.diagnosis import Diagnosis, diagnose
from orchestration.discrepancy.evidence import Data
from orchestration.records import parse_mapping
from orchestration.screen import out, plain_table, progress, tell_repairs

if TYPE_CHECKING:
    from fmus.kit import Effect

_SENTENCES = {
    "consistent": "The model is consistent with the record: nothing is wrong beyond noise.",
    "recalibrate": "The structure of the model is fine; parameters differ from nominal: {differing}.",
    "cause": "What the model gets wrong: {causes}.",
    "ambiguous": "Something is wrong that this record cannot tell apart: {causes}{rivals}.",
    "unexplained": "Something is left that nothing in the catalogue accounts for: {left}.",
}


def run(
    path: Path, name: str, mapping: Sequence[str], settings: Sequence[str], wanted: Sequence[str], result: Path | None
) -> None:
    """Do ``ppy diagnose``.

    Raises
    ------
    UserError
        If the record or the model cannot be used, or an effect is unknown.
    """
    if result is not None and result.exists() and path.exists() and result.samefile(path):
        raise UserError(f"--json {result}: this is the record itself; it will not be overwritten")
    with progress() as tell:
        tell(f"building {name} unless it is there")
        model = models.find_model(name)
        if model.cls is None:
            raise UserError(f"{name} is an FMU without equations; name a component (see ppy list) or file.py:Class")
        given = model.settings(settings)
        record = read_for(model, path, parse_mapping(mapping))
        tell_repairs(record.repairs)
        inputs = {n: values for n, values in record.signals.items() if n in model.inputs}
        inputs |= {n: np.full(record.time.size, value) for n, value in given.items() if n in model.inputs}
        real = {n for n, signal in model.outputs.items() if signal.type == "real"}
        measured = {n: values for n, values in record.signals.items() if n in real}
        chosen = _chosen(catalogue(model.cls, models.catalogue(model.cls), measured), wanted)
        fixed = {n: value for n, value in given.items() if n in model.parameters}
        found = diagnose(model.cls, Data(record.time, inputs, measured), chosen, fixed, tell)
    _show(found)
    if result is not None:
        archive.write(result, json.dumps(found.as_json(), indent=2, allow_nan=False).encode())
        out.print(f"wrote {result}", markup=False)


def _chosen(known: Sequence[type[Effect]], wanted: Sequence[str]) -> list[type[Effect]]:
    """Pick effects by id, with or without an output; all if none is wanted."""
    names = {label(effect): effect for effect in known}
    ids = {effect.id for effect in known}
    for name in wanted:
        if name not in names and name not in ids:
            raise UserError(f"--effects: no effect named {name!r}{suggestion(name, [*ids, *names])}")
    return [effect for effect in known if not wanted or effect.id in wanted or label(effect) in wanted]


def sentence(found: Diagnosis) -> str:
    """The verdict in one sentence."""
    rivals = [e.candidate.name.split(" + ")[-1] for step in found.selection.steps for e in step.rivals]
    left = []
    for output, rest in found.left.items():
        left += [f"a line at {line.frequency:.3g} Hz in {output}" for line in rest.lines[:1]]
        left += [f"{len(rest.jumps)} jumps of {output}"] if rest.jumps else []
    words = {
        "differing": ", ".join(found.differing), "causes": ", ".join(found.causes) or "no input moves",
        "rivals": f" or {', '.join(rivals)}" if rivals else "", "left": "; ".join(left),
    }  # fmt: skip
    return _SENTENCES[found.verdict].format(**words)


def _show(found: Diagnosis) -> None:
    out.print(found.verdict, style="bold", end="  ")
    out.print(sentence(found), markup=False)
    for note in found.notes:
        out.print(note, markup=False)
    out.print()
    rows = plain_table("on the part held out", "output", "error before", "after")
    for output, before in found.before.items():
        rows.add_row(output, f"{before:.4g}", f"{found.after[output]:.4g}")
    out.print(rows)
    out.print()
    rows = plain_table("evidence", "effect", "fall of BIC", "verdict")
    for step in found.selection.steps:
        rows.add_row(label(step.chosen.candidate.effects[-1]), f"{step.gain:.1f}", "named")
        for rival in step.rivals:
            fall = step.gain - (rival.fitted.bic - step.chosen.fitted.bic)
            rows.add_row(rival.candidate.name.split(" + ")[-1], f"{fall:.1f}", "not told apart")
    for evidence, gain in found.selection.rejected[:5]:
        rows.add_row(label(evidence.candidate.effects[-1]), f"{gain:.1f}", "rejected")
    out.print(rows)
    out.print()
    rows = plain_table("parameters", "name", "value", "95 % interval", "nominal")
    declared = found.selection.best.problem.declared
    for name, e in found.estimates.items():
        p = declared[name]
        interval = " … ".join(shown(end, p) for end in e.interval)
        rows.add_row(name, shown(e.value, p), interval, shown(e.nominal, p))
    out.print(rows)
