"""A correction fitted in its model, with all parameters: a curve as rough as its evidence asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Effect
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.candidate import Candidate
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.laws.evidence import Basis, Columns, Curve
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.least_squares import minimise
from orchestration.identify.noise.model import Noise, Whitening
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]
_SHARES = 1.0, 0.3, 0.0  # of what the map says of a curve, from which a fit may begin
_ROUNDS, _FALL = (
    8,
    2.0,
)  # of choosing noise and roughness anew and fitting on, while the criterion falls by so much
# fall of the cost, relative, that ends a fit, and points that it tries at most
_ROUGHLY, _SETTLED = (1e-3, 20), (1e-6, 200)


@dataclass(frozen=True)
class FittedCurve:
    """A table in a law, fitted.

    Attributes
    ----------
    candidate : Candidate
    problem : Problem
    q : ndarray
        Searched coordinates: of the model's own parameters, then the values of the table.
    basis : Basis
    curve : Curve
        Values and covariance at the knots.
    noise : dict of str to Noise
    residual : dict of str to ndarray
    """

    candidate: Candidate
    problem: Problem
    q: Array
    basis: Basis
    curve: Curve
    noise: dict[str, Noise]
    residual: dict[str, Array]
    criterion: float

    @property
    def values(self) -> dict[str, float]:
        """Parameters by name, SI."""
        return self.problem.values(self.q)


class CurveFit:
    """Fits of one table.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
    effect : type[Effect]
        With a table over the knots of the basis.
    basis : Basis
    """

    def __init__(self, search: Search, base: FittedCandidate, effect: type[Effect], basis: Basis):
        self.basis, self._base = basis, base
        candidate = base.candidate.with_effect(effect)
        tables = [n for n in effect.declared if "_at_" in n and n.startswith(effect.neutral)]
        fixed = {**search.fixed, **base.fit.values, effect.neutral: 1.0}
        constants = [n for n in effect.declared if n.endswith("_memory_constant")]
        parameters = [
            *search.parameters,
            *base.candidate.parameters,
            *base.candidate.starts,
            *constants,
        ]
        self.candidate, self.problem = (
            candidate,
            search.problem(candidate, [*parameters, *tables], fixed),
        )
        self._own = len(base.problem.names) + len(constants)
        self._precision = np.append(base.fit.prior_precision, np.zeros(len(constants)))
        self._size = np.array([s.size for s in self.problem.scales[self._own :]])

    def first(
        self, starts: Sequence[Mapping[str, float]], curve: Curve, floor: Mapping[str, Noise]
    ) -> FittedCurve:
        """Fit once from a curve, beside values of the model's own parameters; from the nearest of several.

        In white noise of the size that is left at best: what a start leaves has the colour of its own faults.

        Parameters
        ----------
        starts : sequence of Mapping of str to float
            Values of the model's own parameters, SI.
        curve : Curve
            As the map has it.
        floor : Mapping of str to Noise
        """
        problem, base = self.problem, self._base
        tried = []
        for own, share in product(starts, _SHARES):
            q = problem.position(problem.start | base.fit.values | dict(own))
            q[self._own :] = share * curve.values / self._size
            try:
                error, _ = problem.evaluate(problem.inside(q))
            except UserError:
                continue
            with np.errstate(over="ignore"):  # a simulation that runs away is far off
                size = sum(float(np.log(e @ e)) for e in error.values())
            tried.append((size, problem.inside(q)))
        q = min(tried, key=lambda t: t[0])[1]
        error, _ = problem.evaluate(q)
        found = self._fitted(q, Whitening.of(floor, error, problem.present), curve, _ROUGHLY)
        problem.forget()
        return found

    def settled(self, fitted: FittedCurve) -> FittedCurve:
        """Fit on from there, in the noise and with the roughness that the fit itself asks for."""
        for _ in range(_ROUNDS):
            before = fitted
            whitening = Whitening.of(before.noise, before.residual, self.problem.present)
            curve = self._weighed(
                whitening(before.residual), whitening(self.problem.evaluate(before.q)[1]), before.q
            )
            fitted = self._fitted(before.q, whitening, curve, _SETTLED)
            if fitted.criterion > before.criterion - _FALL:
                fitted = min(fitted, before, key=lambda one: one.criterion)
                break
        self.problem.forget()
        return fitted

    def _fitted(
        self, q: Array, whitening: Whitening, curve: Curve, effort: tuple[float, int]
    ) -> FittedCurve:
        """Fit from a point, with the roughness that a curve expects."""
        problem = self.problem
        q, rough = self._minimised(q, whitening, _root(curve.prior), effort)
        error, jacobian = problem.evaluate(q)
        noise = dict(problem.noise(error))
        now = Whitening.of(noise, error, problem.present)
        again = self._weighed(now(error), now(jacobian), q)
        found = replace(
            curve, values=q[self._own :] * self._size, covariance=again.covariance, gain=again.gain
        )
        deviance = sum(
            n.deviance(n.whiten(error[o], problem.present[o]), problem.present[o])
            for o, n in noise.items()
        )
        weight = self._precision
        moved = (
            q[: self._own] - problem.position(problem.start | self._base.problem.start)[: self._own]
        )
        deviance += float(np.sum(np.where(weight > 0.0, weight * moved**2, 0.0)))
        order = sum(n.parameters for n in noise.values()) + self._own
        criterion = deviance + rough + found.complexity + order * np.log(problem.samples)
        return FittedCurve(
            self.candidate, problem, q, self.basis, found, noise, dict(error), float(criterion)
        )

    def _free(self, slopes: Array) -> Array:
        """What the model's own parameters can do, as an orthonormal basis."""
        own = slopes[:, : self._own]
        sizes = np.linalg.norm(own, axis=0)
        prior = np.diag(np.sqrt(self._precision))
        whole = np.vstack([own, prior])[:, sizes > 0.0] / sizes[sizes > 0.0]
        left, strength, _ = np.linalg.svd(whole, full_matrices=False)
        return np.asarray(left[:, strength > 1e-7 * strength.max()][: len(own)])

    def _weighed(self, error: Array, slopes: Array, q: Array) -> Curve:
        """Evidence of the curve about a point."""
        own = self._free(slopes)
        columns = -slopes[:, self._own :] / self._size
        alone, columns = columns, columns - own @ (own.T @ columns)
        wanted = error - own @ (own.T @ error) + columns @ (q[self._own :] * self._size)
        products = Columns(self.basis, columns.T @ columns, alone.T @ alone, len(error))
        if not np.isfinite(products.alone).all():
            raise UserError(
                "the model runs away: the square of what the curve does to it is no number"
            )
        return products.best(columns.T @ wanted)

    def _minimised(
        self, q: Array, whitening: Whitening, root: Array, effort: tuple[float, int]
    ) -> tuple[Array, float]:
        """Least squares with the prior, the curve being the root times as many coordinates of unit size."""
        problem, own, base = self.problem, self._own, self._base
        weight = np.sqrt(self._precision)
        centre = problem.position(problem.start | base.problem.start)[:own]
        centre = np.where(weight > 0.0, centre, 0.0)
        low, high = problem.bounds()

        def whole(z: Array) -> Array:
            return np.concatenate([z[:own], root @ z[own:] / self._size])

        def residual(z: Array) -> Array:
            return np.concatenate(
                [whitening(problem.evaluate(whole(z))[0]), weight * (z[:own] - centre), z[own:]]
            )

        def jacobian(z: Array) -> Array:
            slopes = whitening(problem.evaluate(whole(z))[1])
            top = np.hstack([slopes[:, :own], slopes[:, own:] @ (root / self._size[:, None])])
            return np.vstack([top, np.diag(np.concatenate([weight, np.ones(root.shape[1])]))])

        begin = np.concatenate(
            [q[:own], np.linalg.lstsq(root, q[own:] * self._size, rcond=None)[0]]
        )
        far = np.full(root.shape[1], np.inf)
        bounds = np.append(low[:own], -far), np.append(high[:own], far)
        end = minimise(residual, jacobian, begin, *bounds, *effort)
        return whole(end.q), float(end.q[own:] @ end.q[own:])


def _root(covariance: Array) -> Array:
    """Columns whose outer products add up to a covariance, without directions in which there is none."""
    values, axes = np.linalg.eigh(covariance)
    kept = values > 1e-12 * values.max()
    return np.asarray(axes[:, kept] * np.sqrt(values[kept]))
