"""What the commands show on the terminal, and the order in which they do their work."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)  # fmt: skip
from rich.table import Table
from rich.text import Text

from fmus.kit.errors import UserError

if TYPE_CHECKING:
    from orchestration.fmu.model import Model
    from orchestration.identify.comparison import Comparison

# in a file or a pipe there is no edge to wrap at; 160 keeps the tables whole
_WIDTH = None if sys.stdout.isatty() or "COLUMNS" in os.environ else 160
# names and messages are shown as they are: brackets and colons in them are no markup
out = Console(highlight=False, markup=False, emoji=False, soft_wrap=True, width=_WIDTH)
err = Console(stderr=True, highlight=False, markup=False, emoji=False)


class Tell:
    """Says what is being done, and how far it is."""

    def __init__(self, bar: Progress | None):
        self._bar = bar
        self._task = bar.add_task("", total=None) if bar else None

    def __call__(self, text: str) -> None:
        """Begin something new; where there is no terminal, a line of its own."""
        if self._bar is not None and self._task is not None:
            self._bar.reset(self._task, description=text, total=None)
        else:
            err.print(text, soft_wrap=True, markup=False)

    def done(self, part: int, whole: int) -> None:
        """So much of it is done."""
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=part, total=whole)


class _Rate(ProgressColumn):
    """How many parts are done in a second."""

    def render(self, task: Task) -> Text:
        return Text(f"{task.speed:,.0f}/s" if task.speed else "", style="progress.data.speed")


@contextmanager
def progress() -> Iterator[Tell]:
    """Show on standard error what is being done, how far it is and how long it will take."""
    if not err.is_terminal:
        yield Tell(None)
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        _Rate(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=err, transient=True) as bar:
        yield Tell(bar)


def info(name: str) -> None:
    """Show a component: variables with units, defaults and ranges, presets, sources."""
    from fmus import component
    from fmus.kit.units import allowed, shown

    cls = component(name)
    out.print(name, style="bold", end="  ")
    out.print(f"{(cls.__doc__ or '').strip().splitlines()[0]}\n")
    layout = cls.layout
    for title, variables in (("inputs", layout.inputs), ("outputs", layout.measurable)):
        table = plain_table(title, "name", "unit", "meaning")
        for v in variables:
            table.add_row(v.name, v.unit, v.doc)
        out.print(table)
        out.print()
    table = plain_table("parameters", "name", "default", "allowed", "meaning")
    for p in layout.parameters:
        table.add_row(p.name, shown(p.start, p), allowed(p), p.doc)
    out.print(table)
    sources: dict[str, list[str]] = {}
    for p in layout.parameters:
        if p.source:
            sources.setdefault(p.source, []).append(p.name)
    for source, names in sources.items():
        out.print(f"  {', '.join(names)}: {source}", style="dim", markup=False)
    for preset, about in cls.presets.items():
        out.print(Text.assemble("\npreset ", (preset, "cyan"), f": {about.doc}"))
    out.print(f"\nstep {cls.experiment[1]:g} s by default; internal accuracy {cls.tolerance:g}")


def plain_table(title: str | None, *columns: str) -> Table:
    """Make a plain table whose last column takes the room that is left."""
    table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for column in columns[:-1]:
        table.add_column(column, no_wrap=True)
    table.add_column(columns[-1])
    return table


def check(files: Sequence[Path]) -> bool:
    """Print the findings for each file; true if there is no error."""
    from orchestration.fmu.check import check_fmu

    good = True
    for path in files:
        findings = check_fmu(path)
        errors = sum(f.severity == "error" for f in findings)
        good &= errors == 0
        for finding in findings:
            style = {"error": "red", "warning": "yellow"}.get(finding.severity, "dim")
            rest = f" (contract line {finding.line}) {finding.message}"
            out.print(Text.assemble(f"{path}: ", (finding.severity, style), rest))
        warnings = sum(f.severity == "warning" for f in findings)
        out.print(f"{path}: {'no errors' if errors == 0 else f'{errors} errors'}, {warnings} warnings")
    return good


def _model(name: str, runtime: str) -> Model:
    from fmus import COMPONENTS
    from orchestration.fmu.model import find_model

    with progress() as tell:
        if name in COMPONENTS:
            tell(f"building {name} ({runtime}) unless it is there")
        return find_model(name, runtime)


def check_results(
    sources: Mapping[str, Path | None], result: Path | None, picture: Path | None, page: bool = False
) -> None:
    """Refuse, before any work is done, names under which nothing can be written or something would be lost.

    The sources are the files that are read, by what they are. A picture that is a page may have any ending.
    """
    from orchestration.reporting.pictures import picture_format

    for option, path in (("--out", result), ("--plot", picture)):
        if path is not None and path.is_dir():
            raise UserError(f"{option} {path}: this is a folder; name a file in it")
        for what, source in sources.items():
            if path is not None and source is not None and path.exists() and source.exists() and path.samefile(source):
                raise UserError(f"{option} {path}: this is the {what} itself; it will not be overwritten")
    if result is not None and result == picture:
        raise UserError(f"--out and --plot both name {result}")
    if picture is not None and not page:
        picture_format(picture)


def _check_inputs(model: Model, signals: Collection[str], parameters: Collection[str]) -> None:
    """Refuse inputs that are given twice; tell which inputs no file and no setting gives."""
    from fmus.kit.units import shown

    for name, signal in model.inputs.items():
        if name in signals and name in parameters:
            raise UserError(f"--set {name}: the record has a column for it; leave out one of the two")
        if name not in signals and name not in parameters:
            start = shown(signal.start, signal)
            err.print(f"warning: no values for the input {name}; it stays at {start}", markup=False)


def simulate(
    name: str, runtime: str, input_file: Path | None, mapping: Sequence[str], settings: Sequence[str],
    preset: str | None, stop: float | None, step: float | None, result: Path | None, picture: Path | None,
) -> None:  # fmt: skip
    """Do ``ppy simulate``."""
    import numpy as np

    from fmus.kit.units import shown
    from orchestration.fmu import simulate as work
    from orchestration.fmu.archive import read_description
    from orchestration.records import parse_mapping, read_record, write_record

    renamed = parse_mapping(mapping)
    if renamed and input_file is None:
        raise UserError("--map renames the columns of a record; give the record with --input")
    check_results({"record": input_file}, result, picture)
    model = _model(name, runtime)
    parameters = model.settings(settings, preset)
    experiment = read_description(model.path).defaultExperiment
    inputs = {}
    if input_file is not None:
        units_of = {s.name: s.unit for s in model.inputs.values()}
        record = read_record(input_file, units_of, mapping=renamed, inputs=list(units_of))
        tell_repairs(record.repairs)
        _check_inputs(model, record.signals, parameters)
        time = work.points(record.time, stop, step)
        inputs = {signal: work.held(record, signal, time) for signal in record.signals}
    else:
        last = stop if stop is not None else float(getattr(experiment, "stopTime", None) or 10.0)
        time = work.grid(
            0.0, last, step if step is not None else float(getattr(experiment, "stepSize", None) or last / 1000)
        )
    inputs = {n: np.full(time.size, v) for n, v in parameters.items() if n in model.inputs} | inputs
    with progress() as tell:
        tell(f"simulating {model.name}")
        outputs = work.simulate(model, time, inputs, parameters, lambda n: tell.done(n, time.size))
    everything = inputs | outputs
    units_of = {s.name: s.unit for s in (*model.inputs.values(), *model.outputs.values())}
    table = Table(box=None, pad_edge=False)
    for column in ("output", "smallest", "largest", "last"):
        table.add_column(column, justify="left" if column == "output" else "right")
    for output, values in outputs.items():
        table.add_row(output, *(shown(v, model.outputs[output]) for v in (values.min(), values.max(), values[-1])))
    out.print(f"{model.name}: {time.size} points from {time[0]:g} s to {time[-1]:g} s")
    out.print(table)
    if result is not None:
        write_record(result, time, everything, {n: units_of[n] for n in everything})
        out.print(f"wrote {result}")
    if picture is not None:
        work.plot(picture, model, time, everything)
        out.print(f"wrote {picture}")


def compare(
    record: Path, name: str, runtime: str, mapping: Sequence[str], settings: Sequence[str], preset: str | None,
    names: Sequence[str], result: Path | None, picture: Path | None,
) -> None:  # fmt: skip
    """Do ``ppy compare``."""
    from orchestration.identify import comparison as work
    from orchestration.records import parse_mapping

    check_results({"record": record}, result, picture)
    model = _model(name, runtime)
    parameters = model.settings(settings, preset)
    data = work.read_for(model, record, parse_mapping(mapping))
    tell_repairs(data.repairs)
    _check_inputs(model, data.signals, parameters)
    with progress() as tell:
        comparison = work.compare(model, data, parameters, names, tell)
    show(comparison)
    if result is not None:
        work.write_json(comparison, result)
        out.print(f"wrote {result}")
    if picture is not None:
        work.plot(comparison, picture)
        out.print(f"wrote {picture}")


def show(comparison: Comparison) -> None:
    """Print a comparison: fit per output, and the fitted parameters with their intervals."""
    from fmus.kit.units import shown, shown_difference

    model = comparison.model
    runs = [("simulated" if comparison.after is None else "before", comparison.before)]
    runs += [("fitted", comparison.after)] if comparison.after is not None else []
    table = Table(box=None, pad_edge=False)
    for column in ("output", "run", "fit", "RMS error", "residual"):
        table.add_column(column, justify="right" if column in ("fit", "RMS error") else "left")
    for output in comparison.before:
        for label, judged in runs:
            j = judged[output]
            rest = j.whiteness.summary() if j.whiteness else "too short to judge"
            error = shown_difference(j.rms, model.outputs[output])
            table.add_row(output, label, _percent(j.fit_percent), error, rest)
    out.print(f"{comparison.record.source.name} against {model.name}: {comparison.record.time.size} samples")
    out.print(table)
    if comparison.fit is not None:
        table = Table(box=None, pad_edge=False)
        for column in ("parameter", "fitted", "95 % interval", "started from"):
            table.add_column(column, justify="left" if column == "parameter" else "right")
        for parameter, e in comparison.fit.estimates.items():
            signal = model.parameters[parameter]
            value, nominal, low, high = (shown(x, signal) for x in (e.value, e.nominal, *e.interval))
            table.add_row(parameter, value, f"{low} … {high}", nominal)
        out.print()
        out.print(table)
        for warning in comparison.fit.warnings:
            err.print(f"warning: {warning}", markup=False, soft_wrap=True)


def _percent(fit: float) -> str:
    return f"{fit:.2f} %" if math.isfinite(fit) else "undefined"  # of an output that was constant


def tell_repairs(repairs: Sequence[object]) -> None:
    """Tell what was repaired or noticed in a record."""
    for repair in repairs:
        word = "repaired" if getattr(repair, "changed_data", False) else "noted"
        err.print(f"{word}: {getattr(repair, 'message', repair)}", markup=False, soft_wrap=True, style="dim")
