"""Sweep in a TOML file: an experiment, values of parameters, and the reductions to keep."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.files import is_file
from orchestration.experiment import Experiment, parse, read, shipped
from orchestration.experiment.preparation import prepare
from orchestration.experiment.subjects import find_system, open_subject
from orchestration.experiment.system_model import system_model
from orchestration.experiment.values import ValueTable, checked, read_toml
from orchestration.fmu import Model, Value, find_model
from orchestration.sweeps.fitted import read_fitted
from orchestration.sweeps.reductions import KEPT, TRACE
from orchestration.sweeps.sensitivity import BANDS as DRAWS
from orchestration.sweeps.sensitivity import TORNADO

ENDINGS = (".toml",)


class SweepTable(ValueTable):
    """The keys of a sweep file, see ``docs/how-to/sweeps.md``."""

    title: str = ""
    experiment: str | dict[str, Any]
    over: dict[str, str | list[float | str]] = {}
    fitted: str | None = None
    design: str = "grid"
    samples: Annotated[int, Field(ge=1, strict=True)] | None = None
    seed: Annotated[int, Field(ge=0, strict=True)] = 0
    keep: Annotated[list[str], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _check_parameters(self) -> SweepTable:
        """Raise if the values of the parameters are not given in exactly one way."""
        if bool(self.over) == (self.fitted is not None):
            raise ValueError(
                "needs either values of parameters in [over] or a fit to draw them from, fitted ="
                " ..."
            )
        if self.fitted is not None and {"design"} & self.model_fields_set:
            raise ValueError(
                "has both a fit to draw parameters from and a design; remove one of them"
            )
        if self.fitted is not None and self.samples is None:
            raise ValueError(
                "has a fit to draw parameters from; state the number of cases, such as samples ="
                " 200"
            )
        return self


@dataclass(frozen=True)
class SweepRequest:
    """A sweep as a file requests it, after the checks against its model.

    Attributes
    ----------
    model : Model
    over : dict of str to str or ndarray
        Values by parameter.
    kind : str
        Design.
    samples : int or None
        Samples of a design that chooses values.
    keep : list of str
    time : ndarray, shape (n,)
        Communication points, s.
    inputs : Mapping of str to ndarray, shape (n,)
        In the FMU's units.
    settings : dict of str to float or str
        In the FMU's units.
    outputs : list of str
    table : SweepTable
    """

    model: Model
    over: Mapping[str, str | Array]
    kind: str
    samples: int | None
    keep: list[str]
    time: Array
    inputs: Mapping[str, Array]
    settings: dict[str, Value]
    outputs: list[str]
    table: SweepTable


def read_sweep(path: Path, note: Callable[[str], None] = lambda line: None) -> SweepRequest:
    """Read a sweep, and check its experiment against the model.

    Parameters
    ----------
    path : Path
    note : callable
        Called with a line for every remark: repairs of a record, inputs that stay at their start
        value.

    Returns
    -------
    SweepRequest

    Raises
    ------
    UserError
        If the file cannot be read, or has an error.
    """
    where = str(path)
    if not is_file(path):
        reason = "a folder" if path.is_dir() else "no such file"
        raise UserError(f"{where}: {reason}")
    table = checked(SweepTable, read_toml(path), where, str(path.parent))
    stated = _read_experiment(table.experiment, path)
    model = _model_of(stated, where)
    over: Mapping[str, str | Array]
    if table.fitted is None:
        fit = None
        over = _values_as_text(table)
        kind = table.design
        usually_kept: Sequence[str] = KEPT
    else:
        fit = read_fitted(path.parent / table.fitted, model)
        over = fit.draws(table.samples, table.seed)
        kind = DRAWS
        usually_kept = (TRACE,)
    # in a tornado a parameter keeps the value of the experiment while another one changes
    replaced = {} if kind == TORNADO else over
    experiment = _without_swept(stated, replaced)
    with open_subject(experiment, where) as subject:
        inputs = {name: signal for name, signal in subject.inputs.items() if name not in over}
        prepared = prepare(experiment, replace(subject, inputs=inputs), where, note)
    settings = {name: value for name, value in prepared.settings.items() if name not in replaced}
    for line in fit.differences(settings) if fit else ():
        note(line)
    return SweepRequest(
        model=model,
        over=over,
        kind=kind,
        samples=None if fit else table.samples,
        keep=table.keep or [*usually_kept],
        time=prepared.time,
        inputs=prepared.inputs,
        settings=settings,
        outputs=prepared.record,
        table=table,
    )


def _model_of(stated: Experiment, where: str) -> Model:
    """Return the model of an experiment that can be swept."""
    if stated.noise:
        raise UserError(f"{where}: a sweep cannot have noise of measurements")
    if stated.component is None:
        system = find_system(str(stated.system), stated.chosen_runtime)
        return system_model(replace(system, step=stated.step or system.step), stated.master)
    return find_model(stated.component, stated.chosen_runtime, stated.effects)


def _values_as_text(table: SweepTable) -> dict[str, str]:
    """Return values of parameters in the notation of the command line."""
    over = {}
    for name, values in table.over.items():
        over[name] = values if isinstance(values, str) else ", ".join(map(str, values))
    return over


def _read_experiment(entry: str | dict[str, Any], path: Path) -> Experiment:
    """Return the experiment of a sweep file: a table, or the name of a shipped one or of a file.

    A shipped name takes precedence; a file is searched in the folder of the sweep file first.
    """
    if isinstance(entry, dict):
        return parse(entry, f"{path}: experiment", str(path.parent))
    file = path.parent / entry
    return read(str(file) if entry not in shipped() and is_file(file) else entry)


def _without_swept(experiment: Experiment, swept: Mapping[str, Any]) -> Experiment:
    """Return an experiment without the parameters and inputs of a sweep."""
    update = {}
    for group in ("parameters", "inputs"):
        values = getattr(experiment, group)
        update[group] = {name: value for name, value in values.items() if name not in swept}
    return experiment.model_copy(update=update)
