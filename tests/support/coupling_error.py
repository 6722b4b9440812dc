"""Coupling error: the difference of co-simulation from the fused system, at several steps.

Both have the same inputs at the same communication points: only the exchange differs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.kit.arrays import Array, Mask
from fmus.kit.record import CompiledModel
from orchestration.master import run
from orchestration.master.reference import fuse, imbalance, mechanical
from orchestration.system import System


@dataclass(frozen=True)
class CouplingError:
    """Coupling error of a system over the communication step.

    Attributes
    ----------
    steps : ndarray, shape (m,)
        Communication steps in s.
    errors : dict of str to ndarray, shape (m,)
        For each signal the largest difference from the fused system, relative to its largest
        magnitude there.
    imbalances : dict of str to ndarray, shape (m,)
        For each mechanical coupling, energy made relative to work exchanged.
    floor : float
        Errors below it are those of the integration.
    """

    steps: Array
    errors: dict[str, Array]
    imbalances: dict[str, Array]
    floor: float

    def order(self, name: str) -> float:
        """Return the observed order of the error of a signal or mechanical coupling.

        It is the slope of log error over log step by least squares; NaN unless at least two errors
        are above the floor.
        """
        errors = (self.errors | self.imbalances)[name]
        above_floor = errors > self.floor
        if above_floor.sum() < 2:
            return float("nan")
        log_steps = np.log(self.steps[above_floor])
        return float(np.polyfit(log_steps, np.log(errors[above_floor]), 1)[0])


def coupling_error(
    system: System,
    steps: Sequence[float],
    stop: float,
    inputs: Mapping[str, Callable[[Array], Array]],
    *,
    since: float = 0.0,
    **options: Any,
) -> CouplingError:
    """Run a system at several communication steps, and compare each run with the fused system.

    Parameters
    ----------
    system : System
        A system of components of this project; see :func:`.fuse`.
    steps : sequence of float
        Communication steps in s; the stop time is a multiple of each.
    stop : float
        Stop time in s; the start is at zero.
    inputs : Mapping of str to callable
        Values of inputs of the system at given times. Both sides hold them from each communication
        point to the next.
    since : float
        Time in s from which errors are compared. An order shows only where signals are smooth
        between communication points: sample instants must be such points, and tension must not come
        and go. Members that sample each other at the same instants must be in the order in which
        the master steps them.
    **options
        ``method``, ``extrapolation`` and others of :func:`orchestration.master.run`. Without
        ``feedthrough`` there are no imbalances: lengths and forces then belong to different points.

    Returns
    -------
    CouplingError
    """
    graph = fuse(system)
    model = CompiledModel(graph)
    couplings = mechanical(system) if options.get("feedthrough", True) else []
    errors = []
    imbalances = []
    for step in steps:
        time = _communication_points(stop, step)
        input_values = {name: function(time) for name, function in inputs.items()}
        result = run(system, time, input_values, **options)
        assert result.complete, result.message
        exact = model.run(time, input_values).signals
        errors.append(_relative_errors(result.signals, exact, time >= since))
        made = imbalance(couplings, result.signals, options.get("extrapolation", 0))
        imbalances.append({name: energy.relative for name, energy in made.items()})
    return CouplingError(
        np.array(steps), _by_name(errors), _by_name(imbalances), floor=10.0 * graph.tolerance
    )


def _relative_errors(
    signals: Mapping[str, Array], exact: Mapping[str, Array], compared: Mask
) -> dict[str, float]:
    """Return the largest error of each signal, relative to its largest magnitude, where compared.

    Parameters
    ----------
    signals, exact : Mapping of str to ndarray, shape (n,)
    compared : ndarray of bool, shape (n,)
    """
    errors = {}
    for name, values in signals.items():
        largest = np.abs(exact[name][compared]).max() or 1.0
        errors[name] = float(np.abs(values - exact[name])[compared].max() / largest)
    return errors


def _by_name(rows: Sequence[Mapping[str, float]]) -> dict[str, Array]:
    """Return the values of every name over the rows, all of which have the same names."""
    names = rows[0] if rows else ()
    return {name: np.array([row[name] for row in rows]) for name in names}


def _communication_points(stop: float, step: float) -> Array:
    return np.linspace(0.0, stop, round(stop / step) + 1)
