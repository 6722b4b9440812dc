"""Adjustment of a few parameters of a member to a record, without its equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.discrepancy.systems.member import BudgetExceeded, MemberSimulation
from orchestration.fmu import Signal, read_description
from orchestration.fmu.signal import read_signal
from orchestration.identify import rms
from orchestration.identify.fitting import Scale, minimise
from orchestration.identify.noise import estimate_noise
from orchestration.identify.uncertainty import parameter_covariance, sandwich_covariance

_BETTER = 0.98  # of the cost, for another view of what an input does between samples
_DIFFERENCE_STEP = 1e-2  # of a searched coordinate, to see what it does
# in searched coordinates, of what is assumed of a parameter before the record is seen
_PRIOR_STD = 1.0
_TOLERANCE = 1e-4  # relative fall of the cost that ends a search
_TRIALS = 12
# by which the cost, in squared widths of the residual, must fall for a parameter to be adjusted
_MIN_IMPROVEMENT = 20.0
# standard error, near that of the prior, from which on a record does not determine a parameter
_OPEN = 0.6
NORMAL_95 = 1.96  # standard errors to either side
_COLLINEAR = 1e-6  # share of the effect of a parameter that remains when others have theirs


@dataclass(frozen=True)
class AdjustmentResult:
    """Parameters that were adjusted.

    Attributes
    ----------
    values, nominal : dict of str to float
        In the units of the FMU.
    change, standard_error : dict of str to float
        By how much and its standard error: of the logarithm where a parameter is positive by
        nature, else relative to its size.
    interval : dict of str to tuple of float, or None
        95 % confidence intervals; None where the record does not determine a parameter.
    complete : bool
        Whether the search ended by itself, not because there were no more simulations to make.
    """

    values: dict[str, float]
    nominal: dict[str, float]
    change: dict[str, float]
    standard_error: dict[str, float]
    interval: dict[str, tuple[float, float] | None]
    complete: bool


def adjust(
    simulation: MemberSimulation,
    simulated: Mapping[str, Array],
    most: int,
    interpolation: bool = True,
) -> AdjustmentResult:
    """Adjust the few parameters that help most.

    Parameters
    ----------
    simulation : MemberSimulation
        Its choice of inputs that are held may change.
    simulated : Mapping of str to ndarray, shape (n,)
        With the parameters as they are.
    most : int
        Parameters that are adjusted.
    interpolation : bool
        Whether to look again, with the parameters free, at what inputs do between samples: that an
        input is held can look like a parameter that is off.

    Returns
    -------
    AdjustmentResult
    """
    search = ParameterSearch(simulation, simulated)
    complete = _search_parameters(search, simulated, most)
    if search.names and interpolation:
        for name in simulation.inputs.continuous:
            complete = complete and _search_with_other_interpolation(search, name)
    q = search.best.q
    changes = (q - search.start).tolist()
    errors = search.standard_errors().tolist()
    return AdjustmentResult(
        values=search.values(q),
        nominal={name: search.declared[name].start for name in search.names},
        change=dict(zip(search.names, changes, strict=True)),
        standard_error=dict(zip(search.names, errors, strict=True)),
        interval={
            name: search.interval(name, x, error) if error < _OPEN else None
            for name, x, error in zip(search.names, q.tolist(), errors, strict=True)
        },
        complete=complete,
    )


def _search_parameters(search: ParameterSearch, simulated: Mapping[str, Array], most: int) -> bool:
    """Choose parameters, fit them, and once more with new weights of the outputs.

    Returns
    -------
    bool
        False if the simulations did not suffice.
    """
    try:
        search.choose(simulated, most)
        if search.names:
            search.fit(search.start)
            search.reweight()
            search.fit(search.best.q)
    except BudgetExceeded:
        if not np.isfinite(search.best.cost) and search.names:
            # parameters were chosen, and nothing is fitted: they have their start values
            search.best = Point(np.inf, search.start)
        return False
    return True


def _search_with_other_interpolation(search: ParameterSearch, name: str) -> bool:
    """Fit with an input held that was linear, or the other way, and keep what is better.

    Returns
    -------
    bool
        False if the simulations did not suffice.
    """
    inputs = search.simulation.inputs
    before = search.best
    held = set(inputs.held)
    inputs.held = held ^ {name}
    search.restart()
    complete = True
    least = _BETTER * before.cost
    try:
        search.fit(before.q)
    except BudgetExceeded:
        complete = False
        least = before.cost
    if search.best.cost >= least:
        search.best = before
        inputs.held = held
    return complete


@dataclass(frozen=True)
class Point:
    """A point of the search.

    Attributes
    ----------
    cost : float
        Infinite where nothing was simulated.
    q : ndarray, shape (p,)
        Searched coordinates.
    residual : ndarray, shape (m,), optional
        Of all outputs, in their widths.
    jacobian : ndarray, shape (m, p), optional
        Of the residual; of the best point before this one until there is one here.
    """

    cost: float
    q: Array
    residual: Array | None = None
    jacobian: Array | None = None


class ParameterSearch:
    """Output-error problem of an FMU: derivatives are differences of simulations.

    Parameters are searched in coordinates in which a step of one is large, and a residual, measured
    minus simulated, is in widths of what it is at first.

    Parameters
    ----------
    simulation : MemberSimulation
    simulated : Mapping of str to ndarray, shape (n,)
        With the parameters as they are.

    Attributes
    ----------
    declared : dict of str to Signal
        Real parameters of the FMU, as the system sets them.
    names : list of str
        Those that are searched.
    width : dict of str to float
        Of residuals, by output.
    best : Point
    """

    def __init__(self, simulation: MemberSimulation, simulated: Mapping[str, Array]):
        member = simulation.isolated.member
        self.simulation = simulation
        self._present = {o: np.isfinite(y) for o, y in simulation.isolated.outputs.items()}
        self.declared: dict[str, Signal] = {}
        self._scales: dict[str, Scale] = {}
        for variable in read_description(member.fmu).modelVariables:
            if variable.causality != "parameter" or variable.type != "Real":
                continue
            signal = read_signal(variable)
            start = float(member.parameters.get(variable.name, signal.start))
            positive = signal.min >= 0.0 and start > 0.0
            self.declared[variable.name] = replace(signal, start=start)
            self._scales[variable.name] = Scale(positive, abs(start) or _nominal(variable))
        self.names: list[str] = []
        self.best = Point(np.inf, np.empty(0))
        self._newest: tuple[bytes, Array] | None = None
        self._weigh(simulated)

    def _coordinates(self, attribute: str) -> Array:
        """Return an attribute of the declared parameters in searched coordinates, (p,)."""
        return np.array(
            [self._scales[n].position(getattr(self.declared[n], attribute)) for n in self.names]
        )

    @property
    def start(self) -> Array:
        """Point (p,) at which the search starts."""
        return self._coordinates("start")

    def values(self, q: Array) -> dict[str, float]:
        """Return the parameters at a point (p,)."""
        return {n: self._scales[n].value(x) for n, x in zip(self.names, q, strict=True)}

    def interval(self, name: str, position: float, standard_error: float) -> tuple[float, float]:
        """Return the 95 % confidence interval of a parameter within its range."""
        half = NORMAL_95 * standard_error
        scale = self._scales[name]
        declared = self.declared[name]
        ends = (scale.value(position - half), scale.value(position + half))
        low, high = (min(max(end, declared.min), declared.max) for end in ends)
        return low, high

    def _residuals(self, simulated: Mapping[str, Array]) -> dict[str, Array]:
        measured = self.simulation.isolated.outputs
        return {o: (y - simulated[o])[self._present[o]] for o, y in measured.items()}

    def _in_widths(self, simulated: Mapping[str, Array]) -> Array:
        return np.concatenate([e / self.width[o] for o, e in self._residuals(simulated).items()])

    def _weigh(self, simulated: Mapping[str, Array]) -> None:
        self.width = {o: rms(e) or 1.0 for o, e in self._residuals(simulated).items()}

    def _residual(self, q: Array) -> Array:
        """Return the residual (m,) in widths; the last simulation is remembered."""
        if self._newest is None or self._newest[0] != q.tobytes():
            self._newest = (q.tobytes(), self._in_widths(self.simulation.simulate(self.values(q))))
        return self._newest[1]

    def restart(self) -> None:
        """Begin again, with other widths or another view of the inputs."""
        self.best = Point(np.inf, self.best.q)
        self._newest = None

    def reweight(self) -> None:
        """Weigh outputs by their residuals at the best point."""
        if len(self.width) > 1:
            self._weigh(self.simulation.simulate(self.values(self.best.q)))
            self.restart()

    def fit(self, q: Array) -> None:
        """Find the best point, starting from another; see ``best``."""
        low = self._coordinates("min")
        high = self._coordinates("max")
        minimise(self._rows, self._slopes, q, low, high, _TOLERANCE, trials=_TRIALS)

    def _rows(self, q: Array) -> Array:
        """Return the residual, and deviations from the prior."""
        residual = self._residual(q)
        rows = np.concatenate([residual, (q - self.start) / _PRIOR_STD])
        cost = float(rows @ rows)
        if cost < self.best.cost:
            self.best = Point(cost, q, residual, self.best.jacobian)
        return rows

    def _slopes(self, q: Array) -> Array:
        """Return the derivatives of the rows."""
        residual = self._residual(q)
        columns = np.column_stack([self._column(q, i, residual) for i in range(q.size)])
        self.best = replace(self.best, jacobian=columns)
        return np.vstack([columns, np.eye(q.size) / _PRIOR_STD])

    def _column(self, q: Array, i: int, residual: Array) -> Array:
        """Return the derivative of the residual by one coordinate, as a difference in its range."""
        beyond = q[i] + _DIFFERENCE_STEP > self._coordinates("max")[i]
        step = -_DIFFERENCE_STEP if beyond else _DIFFERENCE_STEP
        moved = q.copy()
        moved[i] += step
        return (self._residual(moved) - residual) / step

    def choose(self, simulated: Mapping[str, Array], most: int) -> None:
        """Choose parameters one by one, each to take most off the residual with the others.

        Parameters
        ----------
        simulated : Mapping of str to ndarray, shape (n,)
            With the parameters as they are.
        most : int
            How many at most.
        """
        residual = self._in_widths(simulated)
        columns = dict[str, Array]()
        for name in self.declared:
            self.names = [name]
            self._newest = None
            try:
                column = self._column(self.start, 0, residual)
            except UserError:
                continue  # it cannot be moved
            if np.isfinite(column).all() and column @ column > 0.0:
                columns[name] = column
        self.names = _matching_pursuit(residual, columns, most)
        self._newest = None
        self.best = Point(np.inf, self.start)

    def standard_errors(self) -> Array:
        """Return the standard errors (p,) of the best point.

        They allow for the colour of the residual (Ljung: System Identification, section 9.4).
        """
        residual = self.best.residual
        jacobian = self.best.jacobian
        if residual is None or jacobian is None:
            return np.full(self.best.q.size, np.inf)
        present = list(self._present.values())
        ends = np.cumsum([mask.sum() for mask in present])[:-1]
        by_output = np.split(residual, ends)
        noise = [estimate_noise(e, mask) for e, mask in zip(by_output, present, strict=True)]
        assumed = parameter_covariance(jacobian.T @ jacobian, _PRIOR_STD**-2)
        return sandwich_covariance(assumed, np.split(jacobian, ends), noise).standard_errors


def _matching_pursuit(residual: Array, columns: dict[str, Array], most: int) -> list[str]:
    """Choose the columns (m,) that take most off a residual (m,), one after another.

    This is orthogonal matching pursuit.
    """
    size = {n: float(c @ c) for n, c in columns.items()}
    chosen = list[str]()
    while columns and len(chosen) < most:
        gains = {
            n: float(c @ residual) ** 2 / float(c @ c + 1.0 / _PRIOR_STD**2)
            for n, c in columns.items()
        }
        name = max(gains, key=lambda n: gains[n])
        if gains[name] < _MIN_IMPROVEMENT:
            break
        chosen.append(name)
        unit = columns[name] / np.linalg.norm(columns[name])
        residual = residual - unit * (unit @ residual)
        columns = {n: c - unit * (unit @ c) for n, c in columns.items()}
        columns = {n: c for n, c in columns.items() if c @ c > _COLLINEAR * size[n]}
    return chosen


def _nominal(variable: Any) -> float:
    """Return the nominal value of a variable of an FMU, its own or that of its type, or 1."""
    text = getattr(variable, "nominal", None) or getattr(variable.declaredType, "nominal", None)
    return float(text) if text else 1.0
