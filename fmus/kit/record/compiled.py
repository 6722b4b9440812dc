"""Simulation of a component over a whole record as compiled C, with exact sensitivities.

It makes fits fast. The laws, tables and integrator are those of the native FMU, with
``fmi/record.c`` in place of the FMI front-end; they are compiled once for this machine and stored
in the user's cache folder. All models share the library with the integrator. Components that are
stiff over the record have another integrator (``fmi/exponential.c``).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import RLock

import numpy as np

from fmus.kit.arrays import Array, Signals
from fmus.kit.build import record_model_sources, record_sources
from fmus.kit.component import Component
from fmus.kit.errors import UserError
from fmus.kit.record.buffered_function import BufferedFunction
from fmus.kit.record.library import RecordLibrary, compiled
from fmus.kit.record.linearisation import Linearisation
from fmus.kit.symbolic import Graph, hoist, trace, with_sensitivities

# CasADi's reference counts of constants, which all expressions share, are not thread-safe: the
# process crashes if two threads create or delete expressions at once.
_EXPRESSIONS = RLock()


@dataclass(frozen=True)
class Trajectory:
    """The signals of a simulation over a record, and their sensitivities.

    Attributes
    ----------
    signals : dict of str to ndarray, shape (n,)
        Outputs, states and discrete states by name, SI.
    sensitivities : dict of str to ndarray, shape (n, p)
        Derivatives of the signals with respect to p parameters.
    steps : float
        Number of internal steps of the integrator; 0 if it is not known.
    """

    signals: dict[str, Array]
    sensitivities: dict[str, Array]
    steps: float = 0.0


class CompiledModel:
    """A component compiled for this machine.

    Parameters
    ----------
    model : type[Component] or Graph
        The component, or its traced graph.
    sensitivities : sequence of str
        Parameters (start values included) with respect to which derivatives are computed.

    Raises
    ------
    UserError
        If there is no sensitivity to a name (see :func:`.with_sensitivities`), or no C compiler.
    """

    def __init__(self, model: type[Component] | Graph, sensitivities: Sequence[str] = ()):
        self.names = list(sensitivities)
        with _EXPRESSIONS:
            base = _graph(model)
            self.layout = base.layout
            self._graph = with_sensitivities(base, self.names)
            self._linearisation = Linearisation(base, self._graph)
            hoisted, values = hoist(self._graph)
            self._parameters = np.zeros(len(self._graph.layout.parameters))
            self._hoisted = BufferedFunction(values, [self._parameters])
            layout = hoisted.layout
            sources = record_model_sources(hoisted)
            del base, hoisted, values  # within the lock; see `_EXPRESSIONS`
        self._library = RecordLibrary.from_sources(layout, sources)

    def __del__(self) -> None:
        """Delete the expressions within the lock; see `_EXPRESSIONS`."""
        with _EXPRESSIONS:
            self.__dict__.clear()

    def run(
        self,
        time: Array,
        inputs: Signals,
        parameters: Mapping[str, float] | None = None,
        linear: bool | Collection[str] = False,
        effort: float = 1e6,
        tolerance: float = 0.0,
    ) -> Trajectory:
        """Simulate the component over a record.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds, increasing.
        inputs : Mapping[str, ndarray]
            Values of shape (n,) by input name, SI; others are constant at their start value.
        parameters : Mapping[str, float], optional
            Values that replace defaults, SI.
        linear : bool or collection of str
            Inputs that are interpolated linearly between samples: all, none, or some by name. The
            others are constant from sample to sample.
        effort : float
            Largest mean number of internal steps per sample; the simulation fails beyond it.
        tolerance : float
            Accuracy of an internal step, if it may be less than that of the component.

        Returns
        -------
        Trajectory
            Values at ``time``; outputs are those with the inputs of the same sample.

        Raises
        ------
        UserError
            If an input or a parameter is unknown or the simulation fails.
        """
        layout = self._graph.layout
        self._check_inputs(inputs)
        vector = self._parameter_vector(parameters or {})
        n = len(time)
        columns = [
            np.broadcast_to(np.asarray(inputs.get(v.name, v.start), dtype=float), n)
            for v in layout.inputs
        ]
        table = np.ascontiguousarray(np.column_stack(columns)) if columns else np.empty((n, 0))
        times = np.ascontiguousarray(time, dtype=float)
        linear_names = {v.name for v in layout.inputs} if linear is True else linear or ()
        interpolated = np.array([float(v.name in linear_names) for v in layout.inputs])
        # a ladder creates expressions at its first use, and the buffers allow one thread at a time
        with _EXPRESSIONS:
            self._parameters[:] = vector
            values = np.concatenate([vector, self._hoisted()])
            ladder = self._linearisation.ladder(times, table, bool(interpolated.any()), vector)
        outputs, states, steps = self._library.simulate(
            times,
            table,
            interpolated,
            values,
            tolerance=max(tolerance, self._graph.tolerance),
            effort=effort,
            ladder=ladder,
        )
        return self._trajectory(outputs, states, steps)

    def _check_inputs(self, inputs: Signals) -> None:
        """Raise an error unless the model has all these inputs."""
        known = [v.name for v in self._graph.layout.inputs]
        unknown = [name for name in inputs if name not in known]
        if unknown:
            names = ", ".join(map(repr, unknown))
            raise UserError(
                f"{self._graph.name}: no input named {names} (there are: {', '.join(known)})"
            )

    def _parameter_vector(self, parameters: Mapping[str, float]) -> Array:
        """Return the values of all parameters: given ones, and defaults."""
        values = {p.name: float(p.start) for p in self._graph.layout.parameters}
        for name, value in parameters.items():
            if name not in values:
                raise UserError(f"no parameter named {name!r}")
            values[name] = float(value)
        return np.array(list(values.values()))

    def _trajectory(self, outputs: Array, states: Array, steps: float) -> Trajectory:
        """Split the rows of outputs and states into signals and sensitivities."""
        signals: dict[str, Array] = {}
        sensitivities: dict[str, Array] = {}
        continuous, discrete = np.split(states, [len(self._graph.layout.states)], axis=1)
        base = self.layout
        for group, rows in (
            (base.outputs, outputs),
            (base.states, continuous),
            (base.discretes, discrete),
        ):
            # a row has the values, then their derivatives, parameter by parameter
            by_parameter = rows.reshape(len(rows), 1 + len(self.names), len(group))
            for i, variable in enumerate(group):
                signals[variable.name] = by_parameter[:, 0, i]
                sensitivities[variable.name] = by_parameter[:, 1:, i]
        return Trajectory(signals, sensitivities, steps)


def plain_library(cls: type[Component]) -> tuple[Path, float]:
    """Compile a component without sensitivities to a library that rounds like its native FMU.

    Parameters
    ----------
    cls : type[Component]

    Returns
    -------
    path : Path
        Engine and model of a `RecordLibrary` that runs without a ladder. The parameters are those
        of the component's layout.
    tolerance : float
        Accuracy of an internal step.

    Raises
    ------
    UserError
        If there is no compiler, or the component has no equations.
    """
    with _EXPRESSIONS:
        graph = _graph(cls)
        tolerance = graph.tolerance
        sources = record_sources(graph)
        del graph  # within the lock
    return compiled(sources), tolerance


def _graph(model: type[Component] | Graph) -> Graph:
    """Return the graph of a component; raise a UserError if it has no laws."""
    graph = model if isinstance(model, Graph) else trace(model)
    if not graph.restorable:
        raise UserError(
            f"{graph.name} has no equations: it stands for something outside; simulate or run it"
        )
    return graph
