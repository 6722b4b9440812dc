"""Design of controllers from Python: ``ppy.design``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from fmus.kit import Component, UserError, registry
from fmus.kit.errors import find
from fmus.kit.extras import require
from orchestration.api.declaration import only, takes
from orchestration.api.forms import rows_per_second, seconds
from orchestration.api.linearisation import fit_of, linearise
from orchestration.api.options import DesignKeywords, LineariseKeywords
from orchestration.api.results import DiagnosisResult
from orchestration.api.simulation import as_declared, values_of
from orchestration.experiment.subjects import is_system
from orchestration.fmu import Model, Value
from orchestration.fmu.signal import read_amount
from orchestration.linear import (
    ControllerDesign,
    LinearModel,
    linear_model_of,
    sampled_plant,
)
from orchestration.reporting import option
from orchestration.system import System

Linearised = Callable[[Sequence[str], Sequence[str]], LinearModel]


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
    rules = registry.designs()
    rule = registry.load(find(options["controller"], rules, "no kind of controller"))
    linearised, runs = _plant(model, options)
    named = (options["command"], options["measured"])
    linear = linearised(*([name] if name else [] for name in named))
    for key, end, names in (
        ("command", "input", linear.inputs),
        ("measured", "output", linear.outputs),
    ):
        if len(names) != 1:
            raise UserError(
                f"{option(key)} names the {end} at which the controller acts: {', '.join(names)}"
            )
    plant = _sampled(linear, options)
    request = _request(plant, linearised, options)
    designed = rule(request)
    given = values_of(as_declared(designed.component), options["controller_settings"])
    designed = replace(designed, arguments={**designed.arguments, **given})
    inputs = {*plant.point.inputs} - {*plant.inputs}
    measures = [one for one in designed.signals.values() if one not in inputs]
    if measures != [*plant.outputs]:
        plant = _sampled(linearised(plant.inputs, measures), options)
    found = ControllerDesign(designed, plant, request.limits, runs, _settings(runs, options))
    # that of the rule knows no loop: until this one has settled, by samples
    experiment = (float(found.time[-1]), float(plant.period))
    return replace(found, designed=replace(designed, experiment=experiment))


def _settings(model: Any, options: DesignKeywords) -> dict[str, Value]:
    """Return the values of parameters with which a plant runs, those of a fit among them."""
    if not isinstance(model, Model):
        return {}
    fit = fit_of(model, options)
    return (fit.values if fit else {}) | values_of(model, options["settings"])


def _request(
    plant: LinearModel, linearised: Linearised, options: DesignKeywords
) -> registry.DesignRequest:
    """Return what a design rule takes."""
    command, measured = (
        registry.DesignSignal(name, plant.units.get(name, "1"), plant.at_rest(name))
        for name in (plant.inputs[0], plant.outputs[0])
    )
    if not np.any(plant.part()(0.5j)):
        raise UserError(
            f"{plant.name}: {measured.name} does not answer {command.name}; an FMU that hides its"
            f" states is given pulses of {option('step')}, which may be too short"
        )
    crossover = options["crossover"]
    return registry.DesignRequest(
        plant.part(),
        measured,
        command,
        _limits(options["limits"], command),
        options["phase_margin"],
        None if crossover is None else rows_per_second(crossover),
        linearised,
    )


def _plant(model: Any, options: DesignKeywords) -> tuple[Linearised, Model | System | str | None]:
    """Return the linear model of a plant, by its inputs and outputs, and the plant as it runs."""
    import control

    if isinstance(model, control.lti.LTI):
        model = linear_model_of(model)
    if isinstance(model, LinearModel):
        return model.between, None
    chosen: Any = only(LineariseKeywords, options)
    if isinstance(model, DiagnosisResult):
        if not chosen["over"] and chosen["fitted"] is None:
            chosen["over"] = _intervals(model)
        model = model.model
    if not isinstance(model, System) and not is_system(str(model)):
        model = as_declared(model)
        for key, name, known in (
            ("command", options["command"], model.inputs),
            ("measured", options["measured"], model.outputs),
        ):
            if name:
                find(name, known, f"{option(key, name)}: {model.name} has no signal")
    return lambda inputs, outputs: linearise(
        model, **{**chosen, "inputs": inputs, "outputs": outputs}
    ), model


def _intervals(result: DiagnosisResult) -> dict[str, str]:
    """Return the ranges of the parameters of a diagnosis, their intervals, by name."""
    ranges = {}
    for declared in result.model.layout.parameters:
        estimate = result.parameters.get(declared.name)
        if estimate is not None:
            ends = np.clip(estimate.interval, declared.min, declared.max).tolist()
            if ends[0] < ends[1] and np.isfinite(ends).all():
                ranges[declared.name] = "..".join(map(repr, ends))
    return ranges


def _sampled(linear: LinearModel, options: DesignKeywords) -> LinearModel:
    """Return a plant as a controller sees it."""
    given = options["sample_period"]
    if given is None and not linear.period:
        raise UserError(
            f"{option('sample_period')}: a controller is sampled, and {linear.name} is continuous;"
            " give a time, such as 10ms"
        )
    period = linear.period if given is None else seconds(given)
    if not 0.0 < period < np.inf:
        raise UserError(f"{option('sample_period', f'{period:g}')}: a time above 0 s")
    return sampled_plant(linear, period, seconds(options["delay"]))


def _limits(
    ends: Sequence[float | str] | None, command: registry.DesignSignal
) -> tuple[float, float]:
    """Return the lowest and the highest command; infinite ones if none are given."""
    if ends is None:
        return -np.inf, np.inf
    shown = option("limits", "..".join(map(str, ends)))
    low, high = (read_amount(str(end), command.unit, shown) for end in ends)
    if not (low < high and low <= command.value <= high):
        raise UserError(
            f"{shown}: the first command must be below the second one, and that at the operating"
            f" point, {command.value:g}, within"
        )
    return low, high
