"""Optimisation from Python: ``ppy.optimise``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np

from fmus.kit import Component, UserError
from fmus.kit.arrays import Array
from orchestration.api.declaration import takes
from orchestration.api.forms import seconds
from orchestration.api.options import OptimiseKeywords
from orchestration.api.simulation import Inputs, as_declared, inputs_over, values_of
from orchestration.fmu import Model
from orchestration.fmu.simulation import grid
from orchestration.reporting import option
from orchestration.sweeps.pareto import Objective, Objectives, pareto_front, read_objective
from orchestration.sweeps.ranges import Range, read_range

if TYPE_CHECKING:
    from orchestration.sweeps.pareto import Front

_MOST = 2


@takes(OptimiseKeywords)
def optimise(
    model: Model | type[Component] | str | Path,
    over: Mapping[str, str],
    inputs: Inputs | None = None,
    **options: Unpack[OptimiseKeywords],
) -> Front:
    """Optimise one output of a component over its parameters, or find the Pareto front of two.

    Parameters
    ----------
    model, inputs
        As in `simulate`; the model is a component, as its equations are needed.
    over : Mapping of str to str
        Range of each searched parameter: ``"15..25 mm"``, ``"1e-3..1e-1 log"``.

    Returns
    -------
    Front
        Pareto-optimal points; a single point for one objective.

    Raises
    ------
    UserError
        If an argument does not fit the model, or the model has no equations.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> over = {"r_po": "30..45 mm", "r_pl": "5..30 mm"}
    >>> objectives = ["ankle_limited_force & toe_limited_force", "toe_stroke"]
    >>> front = ppy.optimise("foot_design", over, maximise=objectives, levels=5)
    >>> front.values.shape
    (5, 2)
    """
    subject = as_declared(model)
    if subject.cls is None:
        raise UserError(f"{subject.without_equations}; a component can be optimised")
    objectives = _objectives(subject, options)
    starts = options["starts"]
    if starts & (starts - 1):  # more than one bit is set
        raise UserError(f"{option('starts', starts)}: a power of 2, such as 256")
    ranges = _ranges(subject, over)
    points = _points(subject.cls, options)
    settings = values_of(subject, options["settings"])
    twice = next((one.name for one in ranges if one.name in settings), None)
    if twice is not None:
        raise UserError(f"{twice} is searched, and set to one value besides")
    constant = {name: float(settings.pop(name)) for name in subject.inputs if name in settings}
    driven = inputs_over(subject, {**constant, **(inputs or {})}, points)
    numbers = {name: float(value) for name, value in settings.items()}
    search = Objectives(subject.cls, ranges, objectives, points, driven, numbers)
    folder = None if options["folder"] is None else Path(options["folder"])
    return pareto_front(
        search, options["levels"], starts, options["seed"], options["progress"], folder
    )


def _objectives(subject: Model, options: OptimiseKeywords) -> list[Objective]:
    """Return the one or two objectives, first those that are maximised."""
    units = {name: signal.unit for name, signal in subject.outputs.items()}
    objectives = [
        *(read_objective(text, 1.0, units, "maximise") for text in options["maximise"]),
        *(read_objective(text, -1.0, units, "minimise") for text in options["minimise"]),
    ]
    if not 1 <= len(objectives) <= _MOST:
        raise UserError(
            f"{len(objectives)} objectives: {option('maximise')} and {option('minimise')} name one"
            " or two"
        )
    if len({one.name for one in objectives}) < len(objectives):
        raise UserError(f"{objectives[0].name} is named by both objectives")
    return objectives


def _ranges(subject: Model, over: Mapping[str, str]) -> list[Range]:
    """Return the ranges of the searched parameters."""
    if not over:
        raise UserError(f"no parameter to search: {option('over')} names some with their ranges")
    ranges = [read_range(f"{name}={text}", subject) for name, text in over.items()]
    for one in ranges:
        if one.counted or one.name not in subject.parameters:
            raise UserError(
                f"{option('over', {one.name: over[one.name]})}: write parameter=from..to, or that"
                " with log"
            )
    return ranges


def _points(cls: type[Component], options: OptimiseKeywords) -> Array:
    """Return the points in time of a run (n,) in s; one point for a component without states."""
    if options["time"] is not None:
        return np.asarray(options["time"], dtype=float)
    layout = cls.layout
    if not layout.states and not layout.discretes and options["stop"] is None:
        return np.zeros(1)
    stop, step = cls.experiment
    last = stop if options["stop"] is None else seconds(options["stop"])
    return grid(0.0, last, step if options["step"] is None else seconds(options["step"]))
