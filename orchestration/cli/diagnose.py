"""What ``ppy diagnose`` shows on the terminal, and the order in which it does its work."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit.build import build_cached
from fmus.kit.errors import UserError, suggestion
from fmus.kit.files import write
from fmus.kit.units import shown
from orchestration.cli.models import model_file, note_neutral, open_model
from orchestration.cli.outputs import JSON, PAGE, Outputs, same_file, write_json
from orchestration.discrepancy.candidates.candidate import catalogue, label
from orchestration.discrepancy.design.experiment import Separation, design
from orchestration.discrepancy.diagnosis import Diagnosis, diagnose
from orchestration.discrepancy.extended_model import Gain, destinations, export, extended, measured_gain
from orchestration.discrepancy.report.page import Context, page
from orchestration.discrepancy.report.wording import sentence
from orchestration.discrepancy.selection.search import Data
from orchestration.fmu import model as models
from orchestration.fmu.model import Model
from orchestration.identify.comparison import read_for
from orchestration.identify.metrics import number
from orchestration.records import Record, parse_mapping
from orchestration.reporting.console import out, plain_table, progress, tell_repairs, wrote
from orchestration.rig.emulator import DRIVEN, HIGHEST, LIMITS

if TYPE_CHECKING:
    from fmus.kit import Effect


@dataclass(frozen=True)
class Files:
    """What is read and written.

    Attributes
    ----------
    record : Path
    holdout : Path, optional
        Another record to judge by.
    result, report, fmu, experiment : Path, optional
        JSON, HTML, FMU and TOML to write.
    platforms : sequence of str, optional
        FMI platforms to build the FMU for; default is every one that a compiler here can serve.
    """

    record: Path
    holdout: Path | None = None
    result: Path | None = None
    report: Path | None = None
    fmu: Path | None = None
    experiment: Path | None = None
    platforms: Sequence[str] | None = None

    def check(self, sources: Sequence[Path] = ()) -> None:
        """Refuse, before any work is done, names under which nothing can be written or something would be lost.

        Parameters
        ----------
        sources : sequence of Path
            Files of the model.

        Raises
        ------
        UserError
        """
        read = {"the record": self.record, "the record held out": self.holdout}
        read |= {f"the {'FMU' if place.suffix == '.fmu' else 'file'} of --model": place for place in sources}
        written = {"--json": self.result, "--report": self.report, "--experiment": self.experiment}
        if self.fmu is not None:
            written |= {f"--fmu ({kind})": p for kind, p in destinations(self.fmu, ()).items()}
        Outputs(read, written, {"--json": JSON, "--report": PAGE, "--experiment": (".toml",)}).check()
        if self.holdout is not None and same_file(self.record, self.holdout):
            raise UserError(f"--holdout {self.holdout}: this is the record itself; nothing would be held out")


def run(
    files: Files, name: str, mapping: Sequence[str], settings: Sequence[str], wanted: Sequence[str],
    command: Sequence[str], held: Sequence[str] = (), linear: bool = False, effects: Sequence[str] = (),
) -> Diagnosis:  # fmt: skip
    """Do ``ppy diagnose``; the command is told in the report, parameters that are held keep their values.

    The effects are laid over the model before it is judged.

    Raises
    ------
    UserError
        If a record or the model cannot be used, an effect is unknown, or something could not be written.
    """
    files.check([file] if (file := model_file(name)) else [])
    model = open_model(name, effects=effects)
    with progress() as tell:
        if model.cls is None:
            raise UserError(f"{name} is an FMU without equations; name a component (see ppy list) or file.py:Class")
        given, renamed = model.settings(settings), parse_mapping(mapping)
        note_neutral(model, given)
        record = read_for(model, files.record, renamed)
        tell_repairs(record.repairs)
        data = replace(_data(model, record, given), linear=linear)
        absent = _absent(model, record, given, files.record)
        other = holdout = None
        if files.holdout is not None:
            other = read_for(model, files.holdout, renamed)
            tell_repairs([replace(r, message=f"{files.holdout.name}: {r.message}") for r in other.repairs])
            absent += _absent(model, other, given, files.holdout)
            holdout = _judged(replace(_data(model, other, given), linear=linear), data, files.holdout)
        chosen = _chosen(catalogue(model.cls, models.catalogue(model.cls), data.measured), wanted)
        fixed = {n: value for n, value in given.items() if n in model.parameters}
        for name in held:
            if name not in model.parameters:
                raise UserError(
                    f"--hold: {model.name} has no parameter named {name!r}{suggestion(name, model.parameters)}"
                )
        found = diagnose(model.cls, data, chosen, fixed, tell, holdout, held)
        found.notes[:0] = absent
        gain, made = _extended(found, files, tell)
        trial = _experiment(found, data, model, tell)
        if files.report is not None:
            tell("drawing the report")
            left = {output: rest.shown for output, rest in found.left.items()}
            context = Context(record, model, command, chosen, other, gain, left, trial)
            page(found, context).write(files.report)
    _show(found, gain)
    if trial is not None:
        out.print(trial.sentence(), markup=False)
        if files.experiment is not None:
            write(files.experiment, trial.toml(model.name).encode())
            made.append(files.experiment)
    elif files.experiment is not None:
        out.print(f"nothing is to be told apart: {files.experiment} was not written", markup=False)
    write_json(files.result, as_json(found, gain, trial))
    for path in filter(None, (files.report, *made)):
        wrote(path)
    return found


def _extended(found: Diagnosis, files: Files, tell: Callable[[str], None]) -> tuple[Gain | None, list[Path]]:
    """Make an FMU of what was found, and measure with it what is gained; write it if wanted."""
    if found.verdict == "ambiguous" and not found.causes:
        if files.fmu is not None:
            out.print(f"nothing was found to make an FMU of: {files.fmu} was not written", markup=False)
        return None, []
    cls = extended(found, files.record.name)
    made = []
    if files.fmu is not None:
        made = export(cls, files.fmu, filter(None, (files.record, files.holdout)), files.platforms, tell)
    tell("running the extended FMU over the part held out")
    try:
        return measured_gain(found, made[0] if made else build_cached(cls, "native")), made
    except UserError as error:  # what was found stands without it
        found.notes.append(f"the extended FMU could not be run over the part held out: {error}")
        return None, made


def _experiment(found: Diagnosis, data: Data, model: Model, tell: Callable[[str], None]) -> Separation | None:
    """Design an experiment where something cannot be told apart."""
    if found.verdict != "ambiguous":
        return None
    ours = model.name == DRIVEN
    try:
        return design(found.selection, data, LIMITS if ours else None, HIGHEST if ours else np.inf, None, tell)
    except UserError as error:  # what was found stands without it
        found.notes.append(f"no experiment could be designed: {error}")
        return None


def as_json(found: Diagnosis, gain: Gain | None, trial: Separation | None) -> dict[str, Any]:
    """Gather the figures of a diagnosis, those of the FMU in place of the simulation's where there is one."""
    figures = found.as_json()
    if gain is not None:
        figures["gain"] |= {
            "holdout_nrmse_before": {o: number(e) for o, e in gain.before.items()},
            "holdout_nrmse_after": {o: number(e) for o, e in gain.after.items()},
        }
    return figures | ({"experiment": trial.as_json()} if trial else {})


def _data(model: Model, record: Record, given: Mapping[str, float]) -> Data:
    """Split a record into inputs and real outputs; inputs that are absent are constant, as given or as they start."""
    given = {n: value for n, value in given.items() if n in model.inputs}
    constant = {n: signal.start for n, signal in model.inputs.items() if signal.type == "real"} | given
    inputs = {n: np.full(record.time.size, value) for n, value in constant.items()}
    inputs |= {n: values for n, values in record.signals.items() if n in model.inputs and n not in given}
    real = {n for n, signal in model.outputs.items() if signal.type == "real"}
    return Data(record.time, inputs, {n: values for n, values in record.signals.items() if n in real})


def _absent(model: Model, record: Record, given: Mapping[str, float], path: Path) -> list[str]:
    """Tell which inputs are neither in a record nor given."""
    return [
        f"{path.name} has no {n}: taken to be {signal.start:g} {signal.unit} throughout; --set {n}=... says otherwise"
        for n, signal in model.inputs.items()
        if signal.type == "real" and n not in record.signals and n not in given
    ]


def _judged(holdout: Data, data: Data, path: Path) -> Data:
    """Leave out what only the held-out record has: no model was fitted to it."""
    measured = {n: values for n, values in holdout.measured.items() if n in data.measured}
    if not measured:
        raise UserError(f"--holdout {path}: it has none of the outputs of the record, {', '.join(data.measured)}")
    return replace(holdout, measured=measured)


def _chosen(known: Sequence[type[Effect]], wanted: Sequence[str]) -> list[type[Effect]]:
    """Pick effects by id, with or without an output; all if nothing is wanted, and none if that is."""
    if list(wanted) == ["none"]:
        return []
    names = {label(effect): effect for effect in known}
    ids = {effect.id for effect in known}
    for name in wanted:
        if name not in names and name not in ids:
            raise UserError(f"--effects: no effect named {name!r}{suggestion(name, [*ids, *names])}")
    return [effect for effect in known if not wanted or effect.id in wanted or label(effect) in wanted]


def _show(found: Diagnosis, gain: Gain | None) -> None:
    out.print(found.verdict, style="bold", end="  ")
    out.print(sentence(found), markup=False)
    for note in found.notes:
        out.print(note, markup=False)
    declared = found.selection.best.problem.declared
    for name in found.differing:
        e, p = found.estimates[name], declared[name]
        times = f", times {e.value / e.nominal:.3g}" if e.nominal else ""
        out.print(f"{name} differs: {shown(e.value, p)} instead of {shown(e.nominal, p)}{times}", markup=False)
    out.print()
    rows = plain_table("error where nothing was fitted, rms over the spread of the signal", "output", "before", "after")
    errors = (gain.before, gain.after) if gain else (found.before, found.after)
    for output, before in errors[0].items():
        rows.add_row(output, f"{before:.4g}", f"{errors[1][output]:.4g}")
    out.print(rows)
    out.print()
    if found.selection.steps or found.selection.rejected:
        _show_evidence(found)
    rows = plain_table("parameters", "name", "value", "95 % interval", "nominal")
    for name, e in found.estimates.items():
        p = declared[name]
        interval = " … ".join(shown(end, p) for end in e.interval)
        rows.add_row(name, shown(e.value, p), interval, shown(e.nominal, p))
    out.print(rows)


def _show_evidence(found: Diagnosis) -> None:
    rows = plain_table("evidence", "effect", "fall of BIC", "verdict")
    for step in found.selection.steps:
        rows.add_row(step.chosen.last, f"{step.gain:.1f}", "named")
        for rival in step.rivals:
            fall = step.gain - (rival.fitted.bic - step.chosen.fitted.bic)
            rows.add_row(rival.last, f"{fall:.1f}", "not told apart")
    for evidence, fall in found.selection.rejected[:5]:
        rows.add_row(evidence.last, f"{fall:.1f}", "rejected")
    out.print(rows)
    out.print()
