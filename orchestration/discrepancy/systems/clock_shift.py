"""Shift of a sampled controller's clock against that of the record, estimated with the parameters.

A cost over it has kinks, where a sample of the one passes a sample of the other, and many minima:
the nearest shift of a grid over one period is where a joint fit with the parameters begins. A shift
that is fitted alone makes up for parameters that are off, and these for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fmus.kit import Component
from fmus.kit.arrays import Array
from fmus.kit.record import CompiledModel
from orchestration.discrepancy.data import Dataset
from orchestration.identify.fitting import PRIOR_STD, Problem, error_scales, minimise

_GRID = 24  # shifts over a period; a joint fit begins within 2 % of a period of the nearest
_DIFFERENCE = 0.01  # of a period, for the derivative
_TOLERANCE = 1e-6  # of internal steps, as in a search for causes
_CONVERGED = 1e-5  # relative fall of the cost; 2000 samples tell no more
_TRIALS = 40


def shifts_of(cls: type[Component]) -> dict[str, str]:
    """Return the parameters that shift a clock, each with the parameter that is its period.

    Parameters
    ----------
    cls : type[Component]
    """
    return {
        name: clock.period
        for clock, _ in cls.layout.sampled
        if isinstance(clock.period, str)
        for name in clock.shift
    }


def estimate_shift(
    cls: type[Component],
    data: Dataset,
    fixed: Mapping[str, float],
    names: Sequence[str],
    shift: str,
) -> float:
    """Estimate the shift of a sampled clock over a record.

    Parameters
    ----------
    cls : type[Component]
    data : Dataset
        With inputs between samples as they are taken.
    fixed : Mapping of str to float
        Values of parameters, the period among them where it is not the default.
    names : sequence of str
        Parameters that are fitted with it.
    shift : str
        The parameter that is the shift.

    Returns
    -------
    float
        Seconds, from zero to one period.

    Raises
    ------
    UserError
        If the model cannot be simulated over the record.
    """
    fit = _ShiftFit(cls, data, fixed, names, shift)
    return fit.fitted(fit.nearest())


class _ShiftFit:
    """Output-error fit of parameters and of the shift, whose coordinate, in periods, is the last.

    Parameters
    ----------
    cls, data, fixed, names, shift
        See `estimate_shift`.
    """

    def __init__(
        self,
        cls: type[Component],
        data: Dataset,
        fixed: Mapping[str, float],
        names: Sequence[str],
        shift: str,
    ):
        self._data = data
        self._shift = shift
        self._plain = CompiledModel(cls)
        linear = data.linear or ()
        arguments = (cls, data.time, data.inputs, data.measured, names, fixed)
        problem = Problem(*arguments, linear=linear, order=0)
        problem.tolerance = _TOLERANCE
        self._problem = problem
        self._period = problem.start[shifts_of(cls)[shift]]
        self._start = problem.inside(problem.position(problem.start))
        self._prior = np.array([not problem.declared[name].starts for name in names]) / PRIOR_STD
        self._scales = error_scales(problem)

    def nearest(self) -> float:
        """Return the shift of the grid, in periods, at which a simulation is nearest."""
        return min((k / _GRID for k in range(_GRID)), key=self._cost)

    def fitted(self, shift: float) -> float:
        """Return the shift, in seconds, of the fit that begins at another, in periods."""
        low, high = self._problem.bounds()
        minimum = minimise(
            self._rows,
            self._slopes,
            np.append(self._start, shift),
            np.append(low, shift - 1.0 / _GRID),
            np.append(high, shift + 1.0 / _GRID),
            _CONVERGED,
            trials=_TRIALS,
        )
        return self._seconds(float(minimum.q[-1]))

    def _seconds(self, shift: float) -> float:
        return self._period * (shift % 1.0)

    def _cost(self, shift: float) -> float:
        errors = self._errors(self._start, shift)
        return sum(float(np.log(np.mean(e**2) + np.finfo(float).tiny)) for e in errors.values())

    def _errors(self, q: Array, shift: float) -> dict[str, Array]:
        """Return residuals (m,) by output."""
        problem = self._problem
        values = problem.start | problem.values(q) | {self._shift: self._seconds(shift)}
        data = self._data
        run = self._plain.run(
            data.time, data.inputs, values, data.linear or (), tolerance=_TOLERANCE
        )
        return {o: (y - run.signals[o])[problem.present[o]] for o, y in problem.measured.items()}

    def _at(self, point: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return residuals and Jacobians by output at a point, without the column of the shift."""
        seconds = self._seconds(float(point[-1]))
        if self._problem.start[self._shift] != seconds:
            self._problem.start[self._shift] = seconds
            self._problem.forget_simulation()
        return self._problem.evaluate(point[:-1])

    def _rows(self, point: Array) -> Array:
        """Return weighted residuals, and deviations from the prior."""
        residual = self._at(point)[0]
        weighted = [e / self._scales[o] for o, e in residual.items()]
        return np.concatenate([*weighted, self._prior * (point[:-1] - self._start)])

    def _slopes(self, point: Array) -> Array:
        """Return the derivatives of the rows."""
        shift = float(point[-1])
        residual, jacobian = self._at(point)
        there = self._errors(point[:-1], shift + _DIFFERENCE)
        slopes = [
            np.column_stack([jacobian[o], (there[o] - residual[o]) / _DIFFERENCE]) / self._scales[o]
            for o in residual
        ]
        prior = np.column_stack([np.diag(self._prior), np.zeros(len(self._prior))])
        return np.vstack([*slopes, prior])
