"""Simulation from Python: ``ppy.simulate`` and its result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit import Component, registry
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from fmus.kit.symbolic import check_component
from orchestration.api.declaration import takes
from orchestration.api.forms import seconds
from orchestration.api.options import SimulateKeywords
from orchestration.experiment.subjects import find_system, is_system
from orchestration.experiment.system_model import fused_model, system_model
from orchestration.fmu import Model, Value
from orchestration.fmu.isolation import isolation
from orchestration.fmu.model import built, declared_model, declared_model_of
from orchestration.fmu.simulation import (
    EndedSimulation,
    draw_signals,
    extremes,
    grid,
    points_before,
    source_of,
)
from orchestration.fmu.simulation import simulate as run_fmu
from orchestration.records import write_record
from orchestration.reporting import Displayable, one_line, plain_table
from orchestration.system import NAMES, System

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from rich.console import RenderableType

AnyModel = Model | System | type[Component] | str | Path
Inputs = Mapping[str, ArrayLike | Callable[[Array], ArrayLike]]


@dataclass(frozen=True)
class Simulation(Displayable):
    """Inputs and outputs of a model over time.

    Attributes
    ----------
    model : Model
    time : ndarray, shape (n,)
        Seconds.
    inputs, outputs : dict of str to ndarray, shape (n,)
        In the model's units.
    """

    model: Model
    time: Array
    inputs: dict[str, Array]
    outputs: dict[str, Array]

    def __getitem__(self, name: str) -> Array:
        """Return the values of an input or an output (n,)."""
        return (self.inputs | self.outputs)[name]

    def overview(self) -> Iterator[RenderableType]:
        """Yield the extent in time, and a table with extremes and last values of the outputs."""
        columns = ("smallest", "largest", "last")
        table = plain_table(None, "output", *columns, right=columns)
        for name, values in self.outputs.items():
            table.add_row(name, *extremes(values, self.model.outputs[name]))
        yield (
            f"{self.model.title}: {self.time.size} points from {self.time[0]:g} s to"
            f" {self.time[-1]:g} s"
        )
        yield table

    def __repr__(self) -> str:
        extent = f"{self.time.size} points to {self.time[-1]:g} s"
        return one_line(f"Simulation {self.model.name}: {extent}")

    def to_dict(self) -> dict[str, Any]:
        """Return time and signals as lists."""
        signals = self.inputs | self.outputs
        return {"time": self.time.tolist()} | {
            name: values.tolist() for name, values in signals.items()
        }

    def to_frame(self) -> pandas.DataFrame:
        """Return the signals as a table over time.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        return pandas.DataFrame(
            self.inputs | self.outputs, index=pandas.Index(self.time, name="time")
        )

    def to_csv(self, path: str | Path) -> Path:
        """Write a record that `read_record` reads.

        Raises
        ------
        UserError
            If it cannot be written.
        """
        signals = self.inputs | self.outputs
        known = {**self.model.driven, **self.model.outputs}
        units = {name: known[name].unit_in_files for name in signals}
        write_record(Path(path), self.time, signals, units)
        return Path(path)

    def draw(self) -> Figure:
        """Draw inputs and outputs over time, one panel each, in display units."""
        return draw_signals(self.model, self.time, self.inputs | self.outputs, self.model.title)


@takes(SimulateKeywords)
def simulate(
    model: AnyModel,
    inputs: Inputs | None = None,
    **options: Unpack[SimulateKeywords],
) -> Simulation:
    """Simulate a component, any FMU or a system.

    Parameters
    ----------
    model : Model, System, type[Component], str or Path
        A component's name, an FMU file, ``path/to/file.py:Class``, a class such as
        ``diagnose(...).model``, or a result of `find_model`; or a system, by its name or its
        ``.ssp`` file.
    inputs : Mapping of str to array_like, shape (n,), or callable of time, optional
        In the model's units, constant between points; a number is constant throughout.

    Returns
    -------
    Simulation
        It has fewer points if the FMU requests an end.

    Raises
    ------
    UserError
        If there is no such model or input, a value is out of range, or the FMU fails; the error
        then has ``time`` and ``outputs`` of the points before.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> step = ppy.simulate("ppy_actuator", {"current": 0.9}, stop=30.0, settings={"R1": 0.5})
    >>> round(float(step["charge"][-1]), 2)
    5.59
    """
    subject = as_model(model).with_options(options).with_texts(options["outputs"])
    points = points_of(subject, options["time"], options["stop"], options["step"])
    driven = inputs_over(subject, {} if inputs is None else inputs, points)
    try:
        outputs = run_fmu(
            subject,
            points,
            driven,
            values_of(subject, options["settings"]),
            isolation=isolation(options["isolate"]),
        )
    except EndedSimulation as ended:
        reached = points_before(points, ended.time)
        computed = {name: values[reached] for name, values in driven.items()}
        return Simulation(subject, ended.time, computed, ended.outputs)
    return Simulation(subject, points, driven, outputs)


def points_of(
    model: Model,
    time: ArrayLike | None,
    stop: float | str | None,
    step: float | str | None,
    start: float | None = None,
) -> Array:
    """Return the points in time (n,) in s of a simulation; arguments as those of `simulate`.

    The first one is that of the FMU unless `start` in s is given.
    """
    if time is not None:
        return np.asarray(time, dtype=float)
    declared, own_stop, own_step = source_of(model).default_experiment
    first = declared if start is None else start
    if stop is None:
        stop = first + 10.0 if own_stop is None else own_stop
    last = seconds(stop)
    even = seconds(step if step is not None else own_step or (last - first) / 1000)
    return grid(first, last, even)


def inputs_over(model: Model, inputs: Inputs, points: Array) -> dict[str, Array]:
    """Return inputs (n,) at points in time, in the model's units; arguments as in `simulate`."""
    driven = {}
    if not isinstance(inputs, Mapping):
        known = next(iter(model.inputs), "input")
        raise UserError(
            f"inputs: {type(inputs).__name__} has no names; give a dictionary of values by name, as"
            f" in {{{known!r}: values}}"
        )
    for name, values in inputs.items():
        if name not in model.inputs:
            raise UserError(
                f"{model.name}: no input named {name!r}{suggestion(name, model.inputs)}"
            )
        kind = str if model.inputs[name].type == "string" else float
        given = np.asarray(values(points) if callable(values) else values, dtype=kind)
        if given.shape not in ((), points.shape):
            raise UserError(f"{name}: shape {given.shape} for {points.size} points in time")
        driven[name] = np.broadcast_to(given, points.shape)
    return driven


def as_model(model: AnyModel) -> Model:
    """Return a built model from a model, the class of a component, a system, or a name."""
    return built(as_runnable(model))


def as_measured(
    model: AnyModel | None, effects: Sequence[str] = (), runtime: str | None = None
) -> Model:
    """Return a model for comparison with a record: a system is fused if that is possible.

    Parameters
    ----------
    model, effects, runtime
        See `as_runnable`.

    Raises
    ------
    UserError
        See `as_runnable`.
    """
    if isinstance(model, System):
        return fused_model(model)
    if isinstance(model, str | Path) and is_system(name := str(model)):
        _refuse_effects(name, effects)
        return fused_model(find_system(name, runtime), name)
    return as_runnable(model, effects, runtime)


def as_runnable(
    model: AnyModel | None, effects: Sequence[str] = (), runtime: str | None = None
) -> Model:
    """Return a model like `as_model`, not built yet, so that a record is read and checked first.

    Parameters
    ----------
    model : Model, System, type[Component], str or Path, optional
        By default that of the registry.
    effects : sequence of str
        Effects that are added to a component of that name.
    runtime : {"native", "python"}, optional
        Kind of build of the members of a system that ships; native by default.

    Raises
    ------
    UserError
        If there is no such model, or effects are given for a system, or a runtime for a file.
    """
    if isinstance(model, System):
        return system_model(model)
    if not isinstance(model, str | Path):
        return as_declared(model)
    name = str(model)
    if not is_system(name):
        _refuse_misspelt(name)
        return declared_model(name, effects)
    _refuse_effects(name, effects)
    return system_model(find_system(name, runtime), name=name)


def _refuse_effects(system: str, effects: Sequence[str]) -> None:
    if effects:
        raise UserError(f"{system} is a system; {effects[0]} is laid over one model")


def _refuse_misspelt(name: str) -> None:
    """Raise UserError for a name that is similar to a system's, and to no component's."""
    hint = suggestion(name, NAMES, few=0)
    known = registry.models()
    if hint and name.isidentifier() and name not in known and not suggestion(name, known, few=0):
        raise UserError(f"no component and no system named {name!r}{hint}")


def as_declared(model: Model | type[Component] | str | Path | None) -> Model:
    """Return a component or an FMU as a model, not built yet."""
    if model is None:
        return declared_model(registry.default_model())
    if isinstance(model, type):
        if model.__module__ == "__main__":  # from a notebook or a script, not checked yet
            check_component(model)
        return declared_model_of(model)
    return declared_model(str(model)) if isinstance(model, str | Path) else model


def values_of(
    model: Model, settings: Mapping[str, float | str] | None, preset: str | None = None
) -> dict[str, Value]:
    """Return the values of a preset, and of settings over them, in the model's units."""
    texts = [f"{name}={value}" for name, value in (settings or {}).items()]
    return model.settings(texts, preset)
