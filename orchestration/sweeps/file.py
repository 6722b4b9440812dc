"""A sweep as a TOML file: an experiment, what its parameters go through, and what is kept."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from fmus.kit.errors import UserError
from fmus.kit.files import is_file
from orchestration.experiment.library import shipped
from orchestration.experiment.model import Experiment, checked, parse
from orchestration.experiment.preparation import prepare
from orchestration.experiment.reading import read, read_toml
from orchestration.experiment.subject import subject
from orchestration.experiment.values import Table
from orchestration.fmu.model import Model, find_model
from orchestration.fmu.signal import Value
from orchestration.sweeps.fitted import read_fitted
from orchestration.sweeps.reductions import KEPT, TRACE
from orchestration.sweeps.sensitivity.bands import KIND as DRAWS
from orchestration.sweeps.sensitivity.tornado import KIND as TORNADO

Array = NDArray[np.float64]
ENDINGS = (".toml",)


class SweepTable(Table):
    """The keys of the file; ``docs/how-to/sweeps.md`` tells them."""

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
                "says in [over] what parameters go through, or names a fit to draw them from: fitted = ..."
            )
        if self.fitted is not None and {"design"} & self.model_fields_set:
            raise ValueError("has a fit to draw parameters from, and a design besides")
        if self.fitted is not None and self.samples is None:
            raise ValueError(
                "has a fit to draw parameters from; say how many cases are drawn, such as samples = 200"
            )
        return self


@dataclass(frozen=True)
class Asked:
    """What a file asks for.

    Attributes
    ----------
    model : Model
    over : dict of str to str or ndarray
        What each parameter goes through.
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


def read_sweep(path: Path, note: Callable[[str], None] = lambda line: None) -> Asked:
    """Read a sweep, and check its experiment against what that is made on.

    Parameters
    ----------
    path : Path
    note : callable
        Called with a line for what is worth knowing: repairs in a file, inputs that stay at their start value.

    Raises
    ------
    UserError
        If the file cannot be read, or something in it is wrong: one line.
    """
    where = str(path)
    if not is_file(path):
        raise UserError(f"{where}: {'a folder' if path.is_dir() else 'no such file'}")
    table = checked(SweepTable, read_toml(path), where, str(path.parent))
    stated = _experiment(table.experiment, path)
    if stated.component is None:
        raise UserError(
            f"{where}: a sweep is of a component or an FMU, and {stated.system} is a system"
        )
    if stated.noise:
        raise UserError(f"{where}: noise is of what is measured; a sweep has none")
    model = find_model(stated.component, stated.runtime, stated.effects)
    fit = read_fitted(path.parent / table.fitted, model) if table.fitted is not None else None
    over: Mapping[str, str | Array] = (
        _over(table) if fit is None else fit.draws(table.samples, table.seed)
    )
    # of a tornado what the experiment has is where the others stay
    replaced = {} if table.design == TORNADO else over
    experiment = _without(stated, replaced)
    with subject(experiment, where) as on:
        left = {name: signal for name, signal in on.inputs.items() if name not in over}
        prepared = prepare(experiment, replace(on, inputs=left), where, note)
    settings = {name: value for name, value in prepared.settings.items() if name not in replaced}
    for line in [] if fit is None else fit.differences(settings):
        note(line)
    kind, samples, keep = (
        (table.design, table.samples, KEPT) if fit is None else (DRAWS, None, (TRACE,))
    )
    return Asked(
        model,
        over,
        kind,
        samples,
        table.keep or [*keep],
        prepared.time,
        prepared.inputs,
        settings,
        prepared.record,
        table,
    )


def _over(table: SweepTable) -> dict[str, str]:
    return {
        name: v if isinstance(v, str) else ", ".join(map(str, v)) for name, v in table.over.items()
    }


def _experiment(given: str | dict[str, Any], path: Path) -> Experiment:
    """Take the experiment that a file names, one that ships or a file beside it, or that it states itself."""
    if isinstance(given, dict):
        return parse(given, f"{path}: experiment", str(path.parent))
    beside = path.parent / given
    return read(str(beside) if given not in shipped() and is_file(beside) else given)


def _without(experiment: Experiment, swept: Mapping[str, Any]) -> Experiment:
    """Leave out what is swept, whatever the experiment has for it."""
    parameters, inputs = (
        {name: value for name, value in group.items() if name not in swept}
        for group in (experiment.parameters, experiment.inputs)
    )
    return experiment.model_copy(update={"parameters": parameters, "inputs": inputs})
