"""Search for the parameters with the least prediction errors, from several starting points.

The criterion of a model with denominators has many minima (Ljung, section 10.5; Söderström and
Stoica: Automatica 18, 1982). A search begins at estimates from a long ARX model, at the optima of
the models that are contained in the one searched for, at its own lowest minimum with the roots of
one polynomial drawn anew, and anywhere. All starts are followed a few steps, the best of them to
the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.black_box.gauss_newton import GaussNewtonMinimum, minimise
from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.polynomials import roots
from orchestration.identify.black_box.prediction_error import Coefficients, PredictionError
from orchestration.identify.black_box.start_values import (
    denominators,
    hannan_rissanen,
    noise_numerator,
)
from orchestration.identify.black_box.variable_projection import ReducedPredictionError

_ONE = np.ones(1)
_SHORT = 4  # iterations after which starts are compared
_FOLLOWED = 3  # starts that are followed farther, of each set
_LONGER = 12  # iterations after which one must be about as low as the lowest before
_LONG = 60  # iterations of those that are
_NEAR = 3e-4  # relative cost by which it may still be above
_ROUNDS = 3  # of drawing roots anew, at least
_MOST_ROUNDS = 6
_CONTAINED = 2  # best of the contained models that are starting points
_DRAWS = 4  # for each path, for the noise model and of all roots, in a round
_SPREADS = (0.5, 1.0, 2.0)  # of coordinates drawn anywhere: poles of 0.46, 0.76 and 0.96
_OSCILLATING = 0.5  # share of pairs of roots that are drawn complex
_NEGLIGIBLE = 1e-4  # relative difference of costs that makes no difference
_ROUGH = 1e-7  # share of the cost that a step promises, below which minima are compared


class Optimum(NamedTuple):
    """The model of some orders with the least prediction errors.

    Attributes
    ----------
    orders : Orders
    parts : Coefficients
    cost : float
        Sum of squared prediction errors.
    converged : bool
    """

    orders: Orders
    parts: Coefficients
    cost: float
    converged: bool


def optimum(problem: PredictionError, contained: Sequence[Optimum] = ()) -> Optimum:
    """Search for the model with the least prediction errors.

    Parameters
    ----------
    problem : PredictionError
    contained : sequence of Optimum
        Optima of models that are nested in this one.

    Returns
    -------
    Optimum
        Its cost is not above that of any nested model from the same samples.
    """
    reduced = ReducedPredictionError(problem)
    best, *others = _first_minima(reduced, contained)
    # where all starts lead to one minimum there are hardly others
    is_only_minimum = all(other.cost <= (1.0 + _NEGLIGIBLE) * best.cost for other in others)
    random = np.random.default_rng(0)
    for k in range(_MOST_ROUNDS if reduced.size else 0):
        before = best.cost
        points = list(_random_points(reduced, best.theta, random))
        lowest = _lowest_minima(reduced, points, before)[0]
        best = min(best, lowest, key=lambda minimum: minimum.cost)
        is_lower = best.cost <= (1.0 - _NEGLIGIBLE) * before
        is_only_minimum = is_only_minimum and not is_lower
        if not is_lower and (is_only_minimum or k + 1 >= _ROUNDS):
            break
    return _optimum_at(reduced, minimise(reduced, best.theta))


def refine(problem: PredictionError, near: Coefficients, hopeless: float) -> Optimum | None:
    """Search from F, C and D of a model, and return the optimum; None from a hopeless start.

    That is one whose cost, with all other parameters at their optimum, is above `hopeless`.
    """
    reduced = ReducedPredictionError(problem)
    start = reduced.coordinates([*near.f, near.c, near.d])
    e = reduced.errors(start)
    return None if e @ e > hopeless else _optimum_at(reduced, minimise(reduced, start))


def _optimum_at(reduced: ReducedPredictionError, minimum: GaussNewtonMinimum) -> Optimum:
    """Return the model at a minimum."""
    problem = reduced.problem
    parts = problem.coefficients(reduced.theta(minimum.theta))
    return Optimum(problem.orders, parts, minimum.cost, minimum.converged)


def _lowest_minima(
    reduced: ReducedPredictionError, points: Sequence[Array], known: float
) -> list[GaussNewtonMinimum]:
    """Return the minima of the best starting points, the lowest first.

    All points are followed for a few iterations, the best of them for more, and to the end those
    that come near the lowest cost so far, at first `known`.
    """
    follow = partial(minimise, reduced, enough=_ROUGH)
    short = [follow(x, _SHORT) for x in points]
    short.sort(key=lambda minimum: minimum.cost)
    ends = []
    for candidate in short[:_FOLLOWED]:
        end = follow(candidate.theta, _LONGER)
        if end.cost <= (1.0 + _NEAR) * known:
            end = follow(end.theta, _LONG)
        known = min(known, end.cost)
        ends.append(end)
    return sorted(ends, key=lambda minimum: minimum.cost)


def _first_minima(
    reduced: ReducedPredictionError, contained: Sequence[Optimum]
) -> list[GaussNewtonMinimum]:
    """Return the lowest minima from starting points of the data and of nested models."""
    known = [*contained, *_search_nested(reduced.problem, contained)]
    return _lowest_minima(reduced, list(_starting_points(reduced, known)), np.inf)


def _search_nested(problem: PredictionError, contained: Sequence[Optimum]) -> Iterator[Optimum]:
    """Search the largest nested models of simpler structures that are not known, and yield them.

    As starting points the lowest of their first minima are enough.
    """
    known = list(contained)
    for orders in problem.orders.nested_structures():
        if all(other.orders != orders for other in known):
            smaller = ReducedPredictionError(
                PredictionError(
                    problem.inputs, problem.output, orders, problem.first, problem.offset
                )
            )
            nested = [other for other in known if orders.contains(other.orders)]
            known.append(_optimum_at(smaller, _first_minima(smaller, nested)[0]))
            yield known[-1]


def _starting_points(reduced: ReducedPredictionError, known: Sequence[Optimum]) -> Iterator[Array]:
    """Yield starting points from data and from nested models: the best, and those without noise."""
    problem = reduced.problem
    if not reduced.size:
        yield np.empty(0)
        return
    paths = [_ONE for _ in problem.orders.nf]
    if problem.orders.na:
        yield reduced.coordinates([*paths, noise_numerator(problem), _ONE])
        yield reduced.coordinates([*paths, _ONE, _ONE])
    else:
        for f in denominators(problem):
            yield _with_noise(reduced, reduced.coordinates([*f, _ONE, _ONE]))
    lifted = [(other.cost, reduced.coordinates(lift(other, problem.orders))) for other in known]
    lifted.sort(key=lambda pair: pair[0])
    for _, x in lifted[:_CONTAINED]:
        yield x
    for other in known:
        if not other.orders.has_noise_model:
            yield _with_noise(reduced, reduced.coordinates(lift(other, problem.orders)))


def lift(contained: Optimum, orders: Orders) -> list[Array]:
    """Return F of every input, C and D of a model of larger orders that equals a nested model.

    ``A y = B/F u + C/D e`` is ``y = B/(A F) u + C/(A D) e``, and ``y = B/F u + e`` of one input is
    ``F y = B u + F e``.
    """
    parts = contained.parts
    if orders.na < contained.orders.na:
        f = [np.convolve(parts.a, path) for path in parts.f]
        return [*f, parts.c, np.convolve(parts.a, parts.d)]
    if orders.nf[0] < contained.orders.nf[0]:
        return [_ONE, parts.f[0], _ONE]
    return [*parts.f, parts.c, parts.d]


def _with_noise(reduced: ReducedPredictionError, x: Array) -> Array:
    """Return a point with a noise model estimated from its errors without one."""
    *paths, c, d = reduced.blocks(x)
    white = np.concatenate([*paths, 0.0 * c, 0.0 * d])
    noise = hannan_rissanen(reduced.errors(white), len(c), len(d))
    noise_alone = reduced.coordinates([*(_ONE for _ in paths), *noise])
    return np.concatenate([*paths, *reduced.blocks(noise_alone)[-2:]])


def _random_points(
    reduced: ReducedPredictionError, x: Array, random: np.random.Generator
) -> Iterator[Array]:
    """Yield random points, and points with random roots of one F, or of C and D.

    With every other random F, the noise model is estimated again, too.
    """
    *paths, c, d = reduced.polynomials(x)
    samples = reduced.problem.samples
    for k in range(_DRAWS):
        yield random.choice(_SPREADS) * random.standard_normal(reduced.size)
        for i, f in enumerate(paths):
            if len(f) > 1:
                redrawn = _redraw_roots(f, samples, random)
                point = reduced.coordinates([*paths[:i], redrawn, *paths[i + 1 :], c, d])
                yield _with_noise(reduced, point) if k % 2 else point
        if len(c) + len(d) > 2:
            noise = [_redraw_roots(own, samples, random) for own in (c, d)]
            yield reduced.coordinates([*paths, *noise])


def _redraw_roots(polynomial: Array, samples: int, random: np.random.Generator) -> Array:
    """Return a stable polynomial of which one root, two or a pair are drawn anew.

    Time constants are from one sample to the record's length, alike likely on a logarithmic scale.
    """
    order = len(polynomial) - 1
    nonzero = roots(polynomial)
    # real roots, and conjugate pairs, which are kept or dropped together
    factors = [[z, z.conjugate()] if z.imag > 0.0 else [z] for z in nonzero if z.imag >= 0.0]
    factors += [[0.0] for _ in range(order - len(nonzero))]
    random.shuffle(factors)
    chosen: list[complex] = []
    most_kept = max(order - int(random.integers(1, 3)), 0)
    for factor in factors:
        if len(chosen) + len(factor) <= most_kept:
            chosen += factor
    while len(chosen) < order:
        modulus = np.exp(-(samples ** -random.random()))  # exp(-1/T), T from 1 to all samples
        if order - len(chosen) > 1 and random.random() < _OSCILLATING:
            angle = np.pi * samples ** -random.random()
            chosen += [modulus * np.exp(1j * angle), modulus * np.exp(-1j * angle)]
        else:
            chosen.append(modulus)
    return np.atleast_1d(np.real(np.poly(chosen)))
