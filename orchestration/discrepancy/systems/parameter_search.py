"""The output-error problem of an FMU whose equations nobody knows: derivatives are differences of simulations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.discrepancy.systems.member import MemberSimulation
from orchestration.fmu.archive import read_description
from orchestration.fmu.signal import read_signal
from orchestration.identify.covariance import covariance, sandwich
from orchestration.identify.least_squares import minimise
from orchestration.identify.metrics import rms
from orchestration.identify.noise.model import estimate
from orchestration.identify.problem import Scale

Array = NDArray[np.float64]
_DIFFERENCE_STEP = 1e-2  # of a searched coordinate, to see what it does
_PRIOR_STD = (
    1.0  # in searched coordinates, of what is assumed of a parameter before the record is seen
)
_TOLERANCE = 1e-4  # relative fall of the cost that ends a search
_TRIALS = 12
_MIN_IMPROVEMENT = 20.0  # by which the cost, in squared widths of the residual, must fall for a parameter to be adjusted
_COLLINEAR = 1e-6  # share of the effect of a parameter that remains when others have theirs


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
    """Parameters in coordinates in which a step of one is large, and residuals in widths of what they are at first.

    A residual is measured minus simulated.

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
    previous : Point or None
        The best with another view of the inputs.
    """

    def __init__(self, simulation: MemberSimulation, simulated: Mapping[str, Array]):
        member = simulation.isolated.member
        self.simulation = simulation
        self._present = {o: np.isfinite(y) for o, y in simulation.isolated.outputs.items()}
        described = read_description(member.fmu).modelVariables
        variables = [v for v in described if v.causality == "parameter" and v.type == "Real"]
        signals = {v.name: read_signal(v) for v in variables}
        self.declared = {
            n: replace(s, start=float(member.parameters.get(n, s.start)))
            for n, s in signals.items()
        }
        size = {v.name: abs(self.declared[v.name].start) or _nominal(v) for v in variables}
        self._scales = {
            n: Scale(p.min >= 0.0 and p.start > 0.0, size[n]) for n, p in self.declared.items()
        }
        self.names: list[str] = []
        self._weigh(simulated)
        self.best = Point(np.inf, np.empty(0))
        self.previous: Point | None = None
        self._newest: tuple[bytes, Array] | None = None

    def _coordinates(self, attribute: str) -> Array:
        return np.array(
            [self._scales[n].position(getattr(self.declared[n], attribute)) for n in self.names]
        )

    @property
    def start(self) -> Array:
        """Where the search starts."""
        return self._coordinates("start")

    def values(self, q: Array) -> dict[str, float]:
        """Parameters at a point."""
        return {n: self._scales[n].value(x) for n, x in zip(self.names, q, strict=True)}

    def _residuals(self, simulated: Mapping[str, Array]) -> dict[str, Array]:
        measured = self.simulation.isolated.outputs
        return {o: (y - simulated[o])[self._present[o]] for o, y in measured.items()}

    def _in_widths(self, simulated: Mapping[str, Array]) -> Array:
        return np.concatenate([e / self.width[o] for o, e in self._residuals(simulated).items()])

    def _weigh(self, simulated: Mapping[str, Array]) -> None:
        self.width = {o: rms(e) or 1.0 for o, e in self._residuals(simulated).items()}

    def _residual(self, q: Array) -> Array:
        """Residual in widths; the last simulation is remembered."""
        if self._newest is None or self._newest[0] != q.tobytes():
            self._newest = (q.tobytes(), self._in_widths(self.simulation.simulate(self.values(q))))
        return self._newest[1]

    def restart(self) -> None:
        """Begin again, with other widths or another view of the inputs."""
        self.previous, self.best, self._newest = self.best, Point(np.inf, self.best.q), None

    def reweight(self) -> None:
        """Weigh outputs by their residuals at the best point."""
        if len(self.width) > 1:
            self._weigh(self.simulation.simulate(self.values(self.best.q)))
            self.restart()
            self.previous = None

    def fit(self, q: Array) -> None:
        """Find the best point from one on, see ``best``."""
        low, high = self._coordinates("min"), self._coordinates("max")
        minimise(self._rows, self._slopes, q, low, high, _TOLERANCE, _TRIALS)

    def _rows(self, q: Array) -> Array:
        """Residual, and deviations from the prior."""
        rows = np.concatenate([residual := self._residual(q), (q - self.start) / _PRIOR_STD])
        if (cost := float(rows @ rows)) < self.best.cost:
            self.best = Point(cost, q, residual, self.best.jacobian)
        return rows

    def _slopes(self, q: Array) -> Array:
        residual = self._residual(q)
        columns = np.column_stack([self._column(q, i, residual) for i in range(q.size)])
        self.best = replace(self.best, jacobian=columns)
        return np.vstack([columns, np.eye(q.size) / _PRIOR_STD])

    def _column(self, q: Array, i: int, residual: Array) -> Array:
        """Derivative of the residual by one coordinate."""
        moved = q.copy()
        beyond = q[i] + _DIFFERENCE_STEP > self._coordinates("max")[i]
        moved[i] += (step := -_DIFFERENCE_STEP if beyond else _DIFFERENCE_STEP)
        return (self._residual(moved) - residual) / step

    def choose(self, simulated: Mapping[str, Array], most: int) -> None:
        """Choose parameters one at a time, each the one that would take most off what the others leave.

        Parameters
        ----------
        simulated : Mapping of str to ndarray, shape (n,)
            With the parameters as they are.
        most : int
            How many at most.
        """
        residual, columns = self._in_widths(simulated), dict[str, Array]()
        for name in self.declared:
            self.names, self._newest = [name], None
            try:
                column = self._column(self.start, 0, residual)
            except UserError:
                continue  # it cannot be moved
            if np.isfinite(column).all() and column @ column > 0.0:
                columns[name] = column
        self.names, self._newest = _greedy(residual, columns, most), None
        self.best = Point(np.inf, self.start)

    def standard_errors(self) -> Array:
        """Of the best point, allowing for the colour of the residual (Ljung: System Identification, section 9.4)."""
        residual, jacobian = self.best.residual, self.best.jacobian
        if residual is None or jacobian is None:
            return np.full(self.best.q.size, np.inf)
        ends = np.cumsum([present.sum() for present in self._present.values()])[:-1]
        noise = [
            estimate(e, present)
            for e, present in zip(np.split(residual, ends), self._present.values(), strict=True)
        ]
        bread = covariance(jacobian.T @ jacobian, _PRIOR_STD**-2)
        return sandwich(bread, np.split(jacobian, ends), noise).standard_errors


def _greedy(residual: Array, columns: dict[str, Array], most: int) -> list[str]:
    """Names of the columns that take most off a residual, one after another, by orthogonal matching pursuit."""
    size, chosen = {n: float(c @ c) for n, c in columns.items()}, list[str]()
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
    text = getattr(variable, "nominal", None) or getattr(variable.declaredType, "nominal", None)
    return float(text) if text else 1.0
