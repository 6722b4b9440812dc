"""Sweep described in a TOML file: an experiment, the values of parameters, and what is kept."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.files import is_file
from orchestration.experiment import Experiment, parse, read, shipped
from orchestration.experiment.preparation import prepare
from orchestration.experiment.subjects import subject
from orchestration.experiment.system_model import find_system, system_model
from orchestration.experiment.values import ValueTable, checked, read_toml
from orchestration.fmu import Model, Value, find_model
from orchestration.sweeps.fitted import read_fitted
from orchestration.sweeps.reductions import KEPT, TRACE
from orchestration.sweeps.sensitivity import BANDS as DRAWS
from orchestration.sweeps.sensitivity import TORNADO

ENDINGS = (".toml",)


class SweepTable(ValueTable):
    """The keys of the file; ``docs/how-to/sweeps.md`` describes them."""

    title: str = ""
    experiment: str | dict[str, Any]
    over: dict[str, str | list[float | str]] = {}
    fitted: str | None = None
    design: str = "grid"
    samples: Annotated[int, Field(ge=1, strict=True)] | None = None
    seed: Annotated[int, Field(ge=0, strict=True)] = 0
    keep: Annotated[list[str], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _says_what_is_swept(self) -> SweepTable:
        if bool(self.over) == (self.fitted is not None):
            raise ValueError(
                "says in [over] what parameters go through, or names a fit to draw them from:"
                " fitted = ..."
            )
        if self.fitted is not None and {"design"} & self.model_fields_set:
            raise ValueError("has a fit to draw parameters from, and a design besides")
        if self.fitted is not None and self.samples is None:
            raise ValueError(
                "has a fit to draw parameters from; say how many cases are drawn, such as samples"
                " = 200"
            )
        return self


@dataclass(frozen=True)
class SweepRequest:
    """A sweep as a file requests it, checked against its model.

    Attributes
    ----------
    model : Model
    over : dict of str to str or ndarray
        The values of each parameter.
    kind : str
        Design.
    samples : int or None
        Of a design that chooses values.
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
        Called with a line for every remark: repairs in a file, inputs that stay at their start
        value.

    Raises
    ------
    UserError
        If the file cannot be read, or something in it is wrong: one line.
    """
    where = str(path)
    if not is_file(path):
        reason = "a folder" if path.is_dir() else "no such file"
        raise UserError(f"{where}: {reason}")
    table = checked(SweepTable, read_toml(path), where, str(path.parent))
    stated = _experiment(table.experiment, path)
    model = _model(stated, where)
    fit = read_fitted(path.parent / table.fitted, model) if table.fitted is not None else None
    over: Mapping[str, str | Array] = (
        _over(table) if fit is None else fit.draws(table.samples, table.seed)
    )
    # in a tornado a parameter stays at the value of the experiment while another one is moved
    replaced = {} if table.design == TORNADO else over
    experiment = _without(stated, replaced)
    with subject(experiment, where) as on:
        fed = {name: signal for name, signal in on.inputs.items() if name not in over}
        prepared = prepare(experiment, replace(on, inputs=fed), where, note)
    settings = {name: value for name, value in prepared.settings.items() if name not in replaced}
    if fit is not None:
        for line in fit.differences(settings):
            note(line)
    return SweepRequest(
        model=model,
        over=over,
        kind=table.design if fit is None else DRAWS,
        samples=table.samples if fit is None else None,
        keep=table.keep or [*(KEPT if fit is None else (TRACE,))],
        time=prepared.time,
        inputs=prepared.inputs,
        settings=settings,
        outputs=prepared.record,
        table=table,
    )


def _model(stated: Experiment, where: str) -> Model:
    """Return the model of an experiment that can be swept."""
    if stated.noise:
        raise UserError(f"{where}: noise is of what is measured; a sweep has none")
    if stated.component is None:
        system = find_system(str(stated.system), stated.chosen_runtime)
        return system_model(replace(system, step=stated.step or system.step), stated.master)
    return find_model(stated.component, stated.chosen_runtime, stated.effects)


def _over(table: SweepTable) -> dict[str, str]:
    """Return values of parameters as the command line has them."""
    over = {}
    for name, values in table.over.items():
        over[name] = values if isinstance(values, str) else ", ".join(map(str, values))
    return over


def _experiment(given: str | dict[str, Any], path: Path) -> Experiment:
    """Return the experiment that a file states itself or names.

    A name is that of a file beside it, or of an experiment that ships.
    """
    if isinstance(given, dict):
        return parse(given, f"{path}: experiment", str(path.parent))
    beside = path.parent / given
    return read(str(beside) if given not in shipped() and is_file(beside) else given)


def _without(experiment: Experiment, swept: Mapping[str, Any]) -> Experiment:
    """Return an experiment without parameters and inputs that are swept."""
    update = {}
    for group in ("parameters", "inputs"):
        values = getattr(experiment, group)
        update[group] = {name: value for name, value in values.items() if name not in swept}
    return experiment.model_copy(update=update)
