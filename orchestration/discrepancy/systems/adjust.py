"""Parameters of an FMU adjusted without its equations: derivatives are differences of simulations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from fmus.kit.errors import UserError
from orchestration.discrepancy.systems.member import BudgetExceeded, MemberSimulation
from orchestration.fmu.archive import read_description
from orchestration.fmu.signal import read_signal
from orchestration.identify.levenberg_marquardt import minimise
from orchestration.identify.metrics import rms
from orchestration.identify.noise import estimate
from orchestration.identify.problem import Scale

Array = NDArray[np.float64]
_NUDGE = 1e-2  # of a searched coordinate, to see what it does
_BELIEF = 1.0  # width, in searched coordinates, of what is believed of a parameter before the record is seen
_HELPS = 20.0  # by which the cost, in squared widths of the residual, must fall for a parameter to be adjusted
_BETTER = 0.98  # of the cost, for another view of what an input does between samples
_ACCURATE = 1e-4  # relative fall of the cost that ends a search
_TRIALS = 12
_ALIKE = 1e-6  # of the effect of a parameter that is left when others have theirs


@dataclass(frozen=True)
class AdjustmentResult:
    """Parameters that were adjusted.

    Attributes
    ----------
    values, nominal : dict of str to float
        In the units of the FMU.
    moved, error : dict of str to float
        By how much and its standard error: of the logarithm where a parameter is positive by nature, else relative to
        its size.
    whole : bool
        Whether the search ended by itself, not because there were no more simulations to make.
    """

    values: dict[str, float]
    nominal: dict[str, float]
    moved: dict[str, float]
    error: dict[str, float]
    whole: bool


@dataclass(frozen=True)
class _Point:
    """A point of the search.

    Attributes
    ----------
    cost : float
        Infinite where nothing was simulated.
    q : ndarray, shape (p,)
    error : ndarray, shape (m,), optional
        Residuals in their widths.
    jacobian : ndarray, shape (m, p), optional
        Of the residuals; of the best point before this one until there is one here.
    """

    cost: float
    q: Array
    error: Array | None = None
    jacobian: Array | None = None


def adjust(alone: MemberSimulation, simulated: Mapping[str, Array], most: int, views: bool = True) -> AdjustmentResult:
    """Adjust the few parameters that help most.

    Parameters
    ----------
    alone : MemberSimulation
        Its choice of inputs that are held may change.
    simulated : Mapping of str to ndarray, shape (n,)
        With the parameters as they are.
    most : int
        Parameters that are adjusted.
    views : bool
        Whether to look again, with the parameters free, at what inputs do between samples: that an input is held can
        look like a parameter that is off.

    Returns
    -------
    AdjustmentResult
    """
    search, whole, held = _Search(alone, simulated), True, set(alone.held)
    try:
        search.choose(simulated, most)
        if search.names:
            search.fit(search.start)
            search.weigh()
            search.fit(search.best.q)
            for name in [n for n, f in alone.cut.inputs.items() if f.values is not None and f.smooth and views]:
                before, held = search.best, set(alone.held)
                alone.held = held ^ {name}
                search.forget()
                search.fit(before.q)
                if search.best.cost >= _BETTER * before.cost:
                    search.best, alone.held = before, held
    except BudgetExceeded:
        whole = False
        if not np.isfinite(search.best.cost) and search.names:
            search.best = _Point(np.inf, search.start)
    if not whole and search.before is not None and search.before.cost <= search.best.cost:
        search.best, alone.held = search.before, held
    q, spread = search.best.q, search.spread()
    nominal = {n: search.declared[n].start for n in search.names}
    moved, error = ({n: float(x) for n, x in zip(search.names, v, strict=True)} for v in (q - search.start, spread))
    return AdjustmentResult(search.values(q), nominal, moved, error, whole)


class _Search:
    """Parameters in coordinates in which a step of one is large, and residuals in widths of what they are at first."""

    def __init__(self, alone: MemberSimulation, simulated: Mapping[str, Array]):
        member = alone.cut.member
        self.alone, self.present = alone, {o: np.isfinite(y) for o, y in alone.cut.outputs.items()}
        described = read_description(member.fmu).modelVariables
        variables = [v for v in described if v.causality == "parameter" and v.type == "Real"]
        read = {v.name: read_signal(v) for v in variables}
        self.declared = {n: replace(s, start=float(member.parameters.get(n, s.start))) for n, s in read.items()}
        size = {v.name: abs(self.declared[v.name].start) or _nominal(v) for v in variables}
        self.scale = {n: Scale(p.min >= 0.0 and p.start > 0.0, size[n]) for n, p in self.declared.items()}
        self.names: list[str] = []
        self.width = {o: rms(e) or 1.0 for o, e in self._left(simulated).items()}
        self.best = _Point(np.inf, np.empty(0))
        self.before: _Point | None = None
        self._at: tuple[bytes, Array] | None = None
        self._count = 0

    def _ends(self, which: str) -> Array:
        return np.array([self.scale[n].position(getattr(self.declared[n], which)) for n in self.names])

    @property
    def start(self) -> Array:
        """Where the search starts."""
        return self._ends("start")

    def values(self, q: Array) -> dict[str, float]:
        """Parameters at a point."""
        return {n: self.scale[n].value(x) for n, x in zip(self.names, q, strict=True)}

    def _left(self, simulated: Mapping[str, Array]) -> dict[str, Array]:
        return {o: (simulated[o] - y)[self.present[o]] for o, y in self.alone.cut.outputs.items()}

    def _error(self, q: Array) -> Array:
        """Residuals in their widths; the last simulation is remembered."""
        if self._at is None or self._at[0] != q.tobytes():
            left = self._left(self.alone.simulate(self.values(q)))
            self._at = (q.tobytes(), np.concatenate([e / self.width[o] for o, e in left.items()]))
        return self._at[1]

    def forget(self) -> None:
        """Begin again, with other widths or another view of the inputs."""
        self.before, self.best, self._at = self.best, _Point(np.inf, self.best.q), None

    def weigh(self) -> None:
        """Weigh outputs by what is left of them."""
        if len(self.width) > 1:
            left = self._left(self.alone.simulate(self.values(self.best.q)))
            self.width = {o: rms(e) or 1.0 for o, e in left.items()}
            self.forget()
            self.before = None

    def fit(self, q: Array) -> None:
        """Find the best point from one on, see ``best``."""
        minimise(self._rows, self._slopes, q, self._ends("min"), self._ends("max"), _ACCURATE, _TRIALS)

    def _rows(self, q: Array) -> Array:
        try:
            rows = np.concatenate([error := self._error(q), (q - self.start) / _BELIEF])
        except UserError:
            if not self._count:
                raise
            return np.full(self._count, np.inf)  # a point to step back from
        self._count = rows.size
        if (cost := float(rows @ rows)) < self.best.cost:
            self.best = _Point(cost, q, error, self.best.jacobian)
        return rows

    def _slopes(self, q: Array) -> Array:
        middle = self._error(q)
        columns = np.column_stack([self._column(q, i, middle) for i in range(q.size)])
        self.best = replace(self.best, jacobian=columns)
        return np.vstack([columns, np.eye(q.size) / _BELIEF])

    def _column(self, q: Array, i: int, middle: Array) -> Array:
        moved = q.copy()
        moved[i] += (nudge := -_NUDGE if q[i] + _NUDGE > self._ends("max")[i] else _NUDGE)
        return (self._error(moved) - middle) / nudge

    def choose(self, simulated: Mapping[str, Array], most: int) -> None:
        """Choose parameters one at a time, each the one that would take most off what the others leave."""
        left = np.concatenate([e / self.width[o] for o, e in self._left(simulated).items()])
        columns: dict[str, Array] = {}
        for name in self.declared:
            self.names, self._at = [name], None
            try:
                column = self._column(self.start, 0, left)
            except UserError:
                continue  # it cannot be moved
            if np.isfinite(column).all() and column @ column > 0.0:
                columns[name] = column
        size, chosen = {n: float(c @ c) for n, c in columns.items()}, list[str]()
        while columns and len(chosen) < most:
            gains = {n: float(c @ left) ** 2 / float(c @ c + 1.0 / _BELIEF**2) for n, c in columns.items()}
            name = max(gains, key=lambda n: gains[n])
            if gains[name] < _HELPS:
                break
            chosen.append(name)
            unit = columns[name] / np.linalg.norm(columns[name])
            left = left - unit * (unit @ left)
            columns = {n: c - unit * (unit @ c) for n, c in columns.items()}
            columns = {n: c for n, c in columns.items() if c @ c > _ALIKE * size[n]}
        self.names, self._at = chosen, None
        self.best = _Point(np.inf, self.start)

    def spread(self) -> Array:
        """Standard errors of the best point, allowing for the colour of what is left (Ljung, section 9.4)."""
        error, jacobian = self.best.error, self.best.jacobian
        if error is None or jacobian is None:
            return np.full(self.best.q.size, np.inf)
        inverse = np.linalg.pinv(jacobian.T @ jacobian + np.eye(jacobian.shape[1]) / _BELIEF**2)
        begin, scores = 0, []
        for present in self.present.values():
            rows = slice(begin, begin + int(present.sum()))
            begin = rows.stop
            noise = estimate(error[rows], present)
            scores.append(lfilter([noise.deviation], [1.0, *-noise.coefficients], jacobian[rows][::-1], axis=0))
        coloured = np.vstack(scores)
        return np.asarray(np.sqrt(np.diag(inverse @ (coloured.T @ coloured) @ inverse)))


def _nominal(variable: Any) -> float:
    text = getattr(variable, "nominal", None) or getattr(variable.declaredType, "nominal", None)
    return float(text) if text else 1.0
