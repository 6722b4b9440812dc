"""Design of controllers from Python: ``ppy.design``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from fmus.kit import Component, UserError, registry
from fmus.kit.errors import find
from fmus.kit.extras import require
from orchestration.api.declaration import only, takes
from orchestration.api.forms import rows_per_second, seconds
from orchestration.api.linearisation import linearise
from orchestration.api.options import DesignKeywords, LineariseKeywords
from orchestration.api.results import DiagnosisResult
from orchestration.api.simulation import as_declared, values_of
from orchestration.experiment.system_model import is_system
from orchestration.fmu import Model
from orchestration.fmu.signal import read_amount
from orchestration.linear import (
    ControllerDesign,
    LinearModel,
    linear_model_of,
    sampled_plant,
)
from orchestration.reporting import option
from orchestration.system import System

_ENDS = {"command": "input", "measured": "output"}  # end of the plant at which a signal is
_LARGEST_MARGIN = 180.0  # degrees; a larger phase margin is one of the other sign


@takes(DesignKeywords)
def design(
    model: DiagnosisResult | LinearModel | System | Model | type[Component] | str | Path | Any,
    **options: Unpack[DesignKeywords],
) -> ControllerDesign:
    """Design a controller for a model, with margins, step responses, and their bands.

    Parameters
    ----------
    model : DiagnosisResult, LinearModel, control.LTI, or as in `linearise`
        Of a diagnosis the extended model, with the intervals of its parameters as a band. A linear
        model, also of python-control, has no operating point, so that its signals are deviations.

    Returns
    -------
    ControllerDesign
        ``margins()``, ``peaks()``, ``step(...)``, ``parameters``, ``plot("loop.png")``,
        ``write("folder")``; ``controller``, a class for `build`; ``system``, the loop for `run`;
        ``plant``, ``law`` and ``loop`` as linear models with ``state_space`` for python-control.

    Raises
    ------
    UserError
        If an argument does not fit the model, or no controller does what is asked for.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> found = ppy.design("ppy_actuator", command="current", measured="displacement",
    ...                    sample_period="20ms", crossover=0.5, limits=(-1.3, 1.3))
    >>> margins = found.margins()
    >>> round(margins.phase, 2), round(margins.crossover, 4)
    (60.0, 0.5)
    """
    require("control")
    if not 0.0 < options["phase_margin"] < _LARGEST_MARGIN:
        raise UserError(
            f"{option('phase_margin', options['phase_margin'])}: above 0 and below"
            f" {_LARGEST_MARGIN:g} degrees"
        )
    rules = registry.designs()
    rule = registry.load(find(options["controller"], rules, "no kind of controller"))
    linear, runs = _linear_plant(model, options)
    _check_single(linear.inputs, "command")
    _check_single(linear.outputs, "measured")
    plant = sampled_plant(linear, _period(linear, options), _delay(options))
    crossover = options["crossover"]
    command, measured = plant.inputs[0], plant.outputs[0]
    at_rest = {name: plant.point.values.get(name, 0.0) for name in (command, measured)}
    limits = _limits(options["limits"], plant.units.get(command, "1"), at_rest[command])
    request = registry.DesignRequest(
        plant.part(),
        plant.units.get(measured, "1"),
        plant.units.get(command, "1"),
        at_rest[measured],
        at_rest[command],
        limits,
        options["phase_margin"],
        None if crossover is None else rows_per_second(crossover),
    )
    return ControllerDesign(rule(request), plant, limits, runs, _foreign_settings(runs, options))


def _linear_plant(
    model: Any, options: DesignKeywords
) -> tuple[LinearModel, Model | System | str | None]:
    """Return the linear model of a plant, and the plant as it runs, if it does."""
    import control

    if isinstance(model, control.lti.LTI):
        model = linear_model_of(model)
    if isinstance(model, LinearModel):
        return model.between(options["command"] or "", options["measured"] or ""), None
    chosen: Any = only(LineariseKeywords, options)
    if isinstance(model, DiagnosisResult):
        if not chosen["over"] and chosen["fitted"] is None:
            chosen["over"] = _intervals(model)
        model = model.model
    chosen["inputs"] = _given(options["command"])
    chosen["outputs"] = _given(options["measured"])
    if isinstance(model, System) or (isinstance(model, str | Path) and is_system(str(model))):
        runs = model if isinstance(model, System) else str(model)
        return linearise(runs, **chosen), runs
    declared = as_declared(model)
    for key, known in (("command", declared.inputs), ("measured", declared.outputs)):
        for name in chosen[f"{_ENDS[key]}s"]:
            find(name, known, f"{option(key, name)}: {declared.name} has no signal")
    return linearise(declared, **chosen), declared


def _given(name: str | None) -> list[str]:
    return [] if name is None else [name]


def _intervals(result: DiagnosisResult) -> dict[str, str]:
    """Return the ranges of the parameters of a diagnosis, their intervals, by name."""
    parameters = {p.name: p for p in result.model.layout.parameters}
    ranges = {}
    for name, estimate in result.parameters.items():
        declared = parameters.get(name)
        if declared is None:
            continue
        low, high = np.clip(estimate.interval, declared.min, declared.max)
        if low < high and np.isfinite([low, high]).all():
            ranges[name] = f"{low!r}..{high!r}".replace("np.float64(", "").replace(")", "")
    return ranges


def _check_single(names: Sequence[str], key: str) -> None:
    """Raise UserError unless there is one signal."""
    if len(names) != 1:
        raise UserError(
            f"{option(key)} names the {_ENDS[key]} at which the controller acts: {', '.join(names)}"
        )


def _period(linear: LinearModel, options: DesignKeywords) -> float:
    """Return the sample period of the controller, s."""
    given = options["sample_period"]
    if given is None and not linear.period:
        raise UserError(
            f"{option('sample_period')}: a controller is sampled, and {linear.name} is continuous;"
            " give a time, such as 10ms"
        )
    period = linear.period if given is None else seconds(given)
    if not 0.0 < period < np.inf:
        raise UserError(f"{option('sample_period', f'{period:g}')}: a time above 0 s")
    return period


def _delay(options: DesignKeywords) -> float:
    """Return the delay of the loop, s."""
    delay = seconds(options["delay"])
    if not 0.0 <= delay < np.inf:
        raise UserError(f"{option('delay', f'{delay:g}')}: a time from 0 s on")
    return delay


def _limits(ends: Sequence[float | str] | None, unit: str, at_rest: float) -> tuple[float, float]:
    """Return the lowest and the highest command; infinite ones if none are given."""
    if ends is None:
        return -np.inf, np.inf
    shown = option("limits", "..".join(map(str, ends)))
    low, high = (read_amount(str(end), unit, shown) for end in ends)
    if not low < high:
        raise UserError(f"{shown}: the first command must be below the second one")
    if not low <= at_rest <= high:
        raise UserError(f"{shown}: the command at the operating point, {at_rest:g}, is not within")
    return low, high


def _foreign_settings(
    runs: Model | System | str | None, options: DesignKeywords
) -> Mapping[str, Any]:
    """Return settings of an FMU without equations, by ``member.parameter`` of its system."""
    if not isinstance(runs, Model) or runs.cls is not None:
        return {}
    values = values_of(runs, options["settings"])
    return {f"plant.{name}": value for name, value in values.items()}
