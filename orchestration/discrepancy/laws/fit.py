"""Fits of a curve in its model, with all parameters, as rough as the evidence asks for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import Effect, UserError
from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import Candidate, FittedCandidate
from orchestration.discrepancy.laws.evidence import Basis, Curve, RegressorColumns
from orchestration.discrepancy.selection import Search
from orchestration.identify.fitting import Problem, SearchEndedError, minimise
from orchestration.identify.noise import Noise, Whitening

_SHARES = 1.0, 0.3  # of the curve in the map, from which a fit may start, beside none of it
# of choosing noise and roughness anew and fitting on, while the criterion falls by so much
_ROUNDS = 8
_FALL = 2.0
# fall of the cost, relative, that ends a fit, and points that it tries at most
_ROUGHLY = (1e-3, 20)
_SETTLED = (1e-6, 200)
# Points after which a fit is given up that leaves so many times the squares of the noise in which
# it began: that noise was estimated where it began, so that it ends no better than there.
_TRIED = 20
_HOPELESS = 20.0


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
        self.basis = basis
        self._base = base
        self.candidate = base.candidate.with_effect(effect)
        tables = [n for n in effect.declared if "_at_" in n and n.startswith(effect.neutral)]
        fixed = {**search.fixed, **base.fit.values, effect.neutral: 1.0}
        constants = [n for n in effect.declared if n.endswith("_memory_constant")]
        parameters = [
            *search.parameters,
            *base.candidate.parameters,
            *base.candidate.starts,
            *constants,
        ]
        self.problem = search.problem(self.candidate, [*parameters, *tables], fixed)
        self._without = search.problem(base.candidate, base.problem.names, fixed)
        self._own = len(base.problem.names) + len(constants)
        self._precision = np.append(base.fit.prior_precision, np.zeros(len(constants)))
        mean = self.problem.position(self.problem.start | base.problem.start)[: self._own]
        self._centre = np.where(self._precision > 0.0, mean, 0.0)
        self._size = np.array([s.size for s in self.problem.scales[self._own :]])

    def first(
        self, starts: Sequence[Mapping[str, float]], curve: Curve, floor: Mapping[str, Noise]
    ) -> FittedCurve:
        """Fit once from a curve, beside those of several parameter values that come nearest.

        In white noise of the least size that any fit leaves: the residual of a start has the colour
        of its own faults.

        Parameters
        ----------
        starts : sequence of Mapping of str to float
            Values of the model's own parameters, SI.
        curve : Curve
            As the map has it.
        floor : Mapping of str to Noise
        """
        problem = self.problem
        tried = []
        for own in starts:
            for share, error in self._errors(dict(own), curve):
                with np.errstate(over="ignore"):  # a simulation that runs away is far off
                    size = sum(float(np.log(e @ e)) for e in error.values())
                tried.append((size, self._start(dict(own), share, curve)))
        _, nearest = min(tried, key=lambda start: start[0])
        error, _ = problem.evaluate(nearest)
        whitening = Whitening.of(floor, error, problem.present)
        fitted = self._fitted(nearest, whitening, curve, _ROUGHLY)
        problem.forget_simulation()
        return fitted

    def _start(self, own: dict[str, float], share: float, curve: Curve) -> Array:
        """Return the point with a share of a curve, beside values of other parameters."""
        problem = self.problem
        q = problem.position(problem.start | self._base.fit.values | own)
        q[self._own :] = share * curve.values / self._size
        return problem.inside(q)

    def _errors(
        self, own: dict[str, float], curve: Curve
    ) -> Iterator[tuple[float, dict[str, Array]]]:
        """Yield shares of a curve, and residuals with them, where the model can be simulated."""
        for share in _SHARES:
            with suppress(UserError):
                yield share, self.problem.evaluate(self._start(own, share, curve))[0]
        # without the curve no derivatives by its values are needed
        without = self._without
        q = without.position(without.start | self._base.fit.values | own)
        with suppress(UserError):
            yield 0.0, without.evaluate(without.inside(q))[0]
        without.forget_simulation()

    def settled(self, fitted: FittedCurve) -> FittedCurve:
        """Continue a fit, in the noise and with the roughness that the fit itself asks for."""
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
        self.problem.forget_simulation()
        return fitted

    def _fitted(
        self, q: Array, whitening: Whitening, curve: Curve, effort: tuple[float, int]
    ) -> FittedCurve:
        """Fit from a point, with the roughness of a curve's prior."""
        problem = self.problem
        q, rough = self._minimised(q, whitening, curve.prior, effort)
        error, jacobian = problem.evaluate(q)
        noise = dict(problem.noise(error))
        now = Whitening.of(noise, error, problem.present)
        again = self._weighed(now(error), now(jacobian), q)
        fitted_curve = replace(
            curve, values=q[self._own :] * self._size, covariance=again.covariance, gain=again.gain
        )
        deviance = problem.deviance(noise, error)
        deviance += float(np.sum(self._precision * (q[: self._own] - self._centre) ** 2))
        order = sum(n.parameters for n in noise.values()) + self._own
        criterion = deviance + rough + fitted_curve.complexity + order * np.log(problem.samples)
        return FittedCurve(
            self.candidate,
            problem,
            q,
            self.basis,
            fitted_curve,
            noise,
            dict(error),
            float(criterion),
        )

    def _free(self, slopes: Array) -> Array:
        """Return an orthonormal basis of the space of the model's own parameters."""
        own = slopes[:, : self._own]
        sizes = np.linalg.norm(own, axis=0)
        prior = np.diag(np.sqrt(self._precision))
        whole = np.vstack([own, prior])[:, sizes > 0.0] / sizes[sizes > 0.0]
        u, strength, _ = np.linalg.svd(whole, full_matrices=False)
        return np.asarray(u[:, strength > 1e-7 * strength.max(initial=0.0)][: len(own)])

    def _weighed(self, error: Array, slopes: Array, q: Array) -> Curve:
        """Return the curve with its evidence, linearised about a point."""
        own = self._free(slopes)
        columns = -slopes[:, self._own :] / self._size
        free = columns - own @ (own.T @ columns)
        wanted = error - own @ (own.T @ error) + free @ (q[self._own :] * self._size)
        products = RegressorColumns(self.basis, free.T @ free, columns.T @ columns, len(error))
        if not np.isfinite(products.alone).all():
            raise UserError(
                "the model runs away: the square of what the curve does to it is no number"
            )
        return products.best(free.T @ wanted)

    def _minimised(
        self, q: Array, whitening: Whitening, covariance: Array, effort: tuple[float, int]
    ) -> tuple[Array, float]:
        """Solve least squares; return the end, and the roughness of the curve there.

        The prior of the curve has a covariance.
        """
        problem = self.problem
        own = self._own
        curve = _WhitenedCurve(own, _root(covariance), self._size)
        weight = np.sqrt(self._precision)
        costs: list[float] = []

        def residual(z: Array) -> Array:
            if len(costs) > _TRIED and min(costs) > _HOPELESS * problem.samples:
                raise SearchEndedError("the curve comes nowhere near the record")
            error, _ = problem.evaluate(curve.point(z))
            rows = np.concatenate([whitening(error), weight * (z[:own] - self._centre), z[own:]])
            costs.append(float(rows @ rows))
            return rows

        def jacobian(z: Array) -> Array:
            _, derivatives = problem.evaluate(curve.point(z))
            prior = np.diag(np.concatenate([weight, np.ones(len(z) - own)]))
            return np.vstack([curve.slopes(whitening(derivatives)), prior])

        low, high = curve.bounds(*problem.bounds())
        limited = problem.time_limited(residual)
        tolerance, trials = effort
        end = minimise(limited, jacobian, curve.begin(q), low, high, tolerance, trials=trials)
        return curve.point(end.q), float(end.q[own:] @ end.q[own:])


@dataclass(frozen=True)
class _WhitenedCurve:
    """A curve whose prior is standard normal: its values are a root of the covariance times it.

    Attributes
    ----------
    own : int
        Coordinates before those of the curve: of the model's own parameters.
    root : ndarray, shape (k, r)
        Of the covariance of the values.
    size : ndarray, shape (k,)
        Values for a searched coordinate of 1.
    """

    own: int
    root: Array
    size: Array

    def point(self, z: Array) -> Array:
        """Return the searched coordinates, with the k values for the r that are whitened."""
        return np.concatenate([z[: self.own], self.root @ z[self.own :] / self.size])

    def begin(self, q: Array) -> Array:
        """Return the coordinates whose values come nearest to those of a point."""
        whitened, *_ = np.linalg.lstsq(self.root, q[self.own :] * self.size, rcond=None)
        return np.concatenate([q[: self.own], whitened])

    def slopes(self, slopes: Array) -> Array:
        """Return derivatives by these coordinates, of those by the searched ones."""
        by_curve = slopes[:, self.own :] @ (self.root / self.size[:, None])
        return np.hstack([slopes[:, : self.own], by_curve])

    def bounds(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return the bounds of these coordinates: those of the model's own parameters."""
        far = np.full(self.root.shape[1], np.inf)
        return np.append(low[: self.own], -far), np.append(high[: self.own], far)


def _root(covariance: Array) -> Array:
    """Return a root of a covariance, without columns for directions in which there is none."""
    values, axes = np.linalg.eigh(covariance)
    kept = values > 1e-12 * values.max()
    return np.asarray(axes[:, kept] * np.sqrt(values[kept]))
