"""Search for the parameters with the least prediction errors, from several starting points.

The criterion of a model with denominators has many minima (Ljung, section 10.5; Söderström and
Stoica: Automatica 18, 1982). A search begins at estimates from a long ARX model, at the optima of
the models that are contained in the one searched for, and at its own lowest minimum with the roots
of one polynomial drawn anew. All starts are followed a few steps, the best of them to the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.black_box.gauss_newton import GaussNewtonMinimum, minimise
from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.prediction_error import Coefficients, PredictionError
from orchestration.identify.black_box.start_values import (
    denominators,
    hannan_rissanen,
    noise_numerator,
)
from orchestration.identify.black_box.variable_projection import ReducedPredictionError

_ONE = np.ones(1)
_SHORT = 4  # iterations after which starts are compared
_FOLLOWED = 2  # starts that are followed to the end, of each set
_LONGEST = 2.0  # change of a coordinate in a step: a pole from 0 to 0.96, or from 0.9 to 0.998
_ROUNDS = 2  # of drawing anew, at least
_MOST_ROUNDS = 4
_DRAWS = 4  # of the roots of each polynomial, in a round
_OSCILLATING = 0.5  # share of pairs of roots that are drawn complex
_NEGLIGIBLE = 1e-4  # relative fall of the cost, for which no further round is made


class Optimum(NamedTuple):
    """The model of some orders with the least prediction errors.

    Attributes
    ----------
    orders : Orders
    parts : Coefficients
    cost : float
        Sum of squared prediction errors.
    samples : int
        How many errors.
    converged : bool
    """

    orders: Orders
    parts: Coefficients
    cost: float
    samples: int
    converged: bool


def optimum(problem: PredictionError, contained: Sequence[Optimum] = ()) -> Optimum:
    """Search for the model with the least prediction errors.

    Parameters
    ----------
    problem : PredictionError
    contained : sequence of Optimum
        Optima of models that this one contains.

    Returns
    -------
    Optimum
        Its cost is above that of none that is contained, from the same samples.
    """
    reduced = ReducedPredictionError(problem)
    if not reduced.size:
        return _end(reduced, np.empty(0))
    known = [*contained, *_missing(problem, contained)]
    best = _lowest(reduced, list(_begin(reduced, known)))
    random = np.random.default_rng(0)
    for k in range(_MOST_ROUNDS):
        again = _lowest(reduced, list(_redrawn(reduced, best.theta, random)))
        gained = again.cost < (1.0 - _NEGLIGIBLE) * best.cost
        best = min(best, again, key=lambda minimum: minimum.cost)
        if k + 1 >= _ROUNDS and not gained:
            break
    return _as_optimum(reduced, best)


def evaluated(problem: PredictionError, near: Coefficients) -> float:
    """Return the cost with F, C and D of one model, and all other parameters at their optimum."""
    reduced = ReducedPredictionError(problem)
    e = reduced.errors(reduced.coordinates([*near.f, near.c, near.d]))
    return float(e @ e)


def refined(problem: PredictionError, near: Coefficients) -> Optimum:
    """Return the minimum that a search from F, C and D of one model ends at."""
    reduced = ReducedPredictionError(problem)
    return _end(reduced, reduced.coordinates([*near.f, near.c, near.d]))


def _end(reduced: ReducedPredictionError, x: Array) -> Optimum:
    """Return the minimum that a search from one point ends at."""
    return _as_optimum(reduced, minimise(reduced, x, longest=_LONGEST))


def _as_optimum(reduced: ReducedPredictionError, minimum: GaussNewtonMinimum) -> Optimum:
    """Return the model at a minimum."""
    problem = reduced.problem
    parts = problem.coefficients(reduced.theta(minimum.theta))
    return Optimum(problem.orders, parts, minimum.cost, problem.samples, minimum.converged)


def _lowest(reduced: ReducedPredictionError, points: Sequence[Array]) -> GaussNewtonMinimum:
    """Return the lowest minimum from some starting points."""
    short = [minimise(reduced, x, _SHORT, _LONGEST) for x in points]
    short.sort(key=lambda minimum: minimum.cost)
    ends = [minimise(reduced, begun.theta, longest=_LONGEST) for begun in short[:_FOLLOWED]]
    return min(ends, key=lambda minimum: minimum.cost)


def _missing(problem: PredictionError, contained: Sequence[Optimum]) -> Iterator[Optimum]:
    """Search for the largest contained models of simpler structures, where they are not known."""
    known = list(contained)
    for beneath in problem.orders.beneath():
        if all(other.orders != beneath for other in known):
            smaller = PredictionError(
                problem.inputs, problem.output, beneath, problem.first, problem.offset
            )
            known.append(optimum(smaller, [o for o in known if beneath.contains(o.orders)]))
            yield known[-1]


def _begin(reduced: ReducedPredictionError, known: Sequence[Optimum]) -> Iterator[Array]:
    """Yield starting points from data, and the best of those that contained models give."""
    problem = reduced.problem
    paths = [_ONE for _ in problem.orders.nf]
    if problem.orders.na:
        yield reduced.coordinates([*paths, noise_numerator(problem), _ONE])
        yield reduced.coordinates([*paths, _ONE, _ONE])
    else:
        for f in denominators(problem):
            yield _with_noise(reduced, reduced.coordinates([*f, _ONE, _ONE]))
    lifted = [(other.cost, reduced.coordinates(lift(other, problem.orders))) for other in known]
    lifted.sort(key=lambda pair: pair[0])
    for _, x in lifted[:_FOLLOWED]:
        yield x
    for other in known:
        if not other.orders.has_noise_model:
            yield _with_noise(reduced, reduced.coordinates(lift(other, problem.orders)))


def lift(contained: Optimum, orders: Orders) -> list[Array]:
    """Return F of every input, C and D with which a model of some orders is a contained one.

    ``A y = B/F u + C/D e`` is ``y = B/(A F) u + C/(A D) e``, and ``y = B/F u + e`` of one input is
    ``F y = B u + F e``.
    """
    parts = contained.parts
    if orders.na < contained.orders.na:
        f = [np.convolve(parts.a, own) for own in parts.f]
        return [*f, parts.c, np.convolve(parts.a, parts.d)]
    if orders.nf[0] < contained.orders.nf[0]:
        return [_ONE, parts.f[0], _ONE]
    return [*parts.f, parts.c, parts.d]


def _with_noise(reduced: ReducedPredictionError, x: Array) -> Array:
    """Return a point with a noise model of the errors that it leaves without one."""
    *paths, c, d = reduced.blocks(x)
    white = np.concatenate([*paths, 0.0 * c, 0.0 * d])
    noise = hannan_rissanen(reduced.errors(white), len(c), len(d))
    noise_alone = reduced.coordinates([*(_ONE for _ in paths), *noise])
    return np.concatenate([*paths, *reduced.blocks(noise_alone)[-2:]])


def _redrawn(
    reduced: ReducedPredictionError, x: Array, random: np.random.Generator
) -> Iterator[Array]:
    """Yield points with the roots of one F, or of C and D, drawn anew.

    With every other F that is drawn, the noise model is estimated anew, too.
    """
    *paths, c, d = reduced.blocks(x)
    samples = reduced.problem.samples
    for k in range(_DRAWS):
        for i, path in enumerate(paths):
            if len(path):
                drawn = [_ONE for _ in reduced.blocks(x)]
                drawn[i] = _drawn(len(path), samples, random)
                new = reduced.blocks(reduced.coordinates(drawn))[i]
                point = np.concatenate([*paths[:i], new, *paths[i + 1 :], c, d])
                yield _with_noise(reduced, point) if k % 2 else point
        if len(c) + len(d):
            drawn = [_drawn(len(block), samples, random) for block in (c, d)]
            noise = reduced.coordinates([*(_ONE for _ in paths), *drawn])
            yield np.concatenate([*paths, *reduced.blocks(noise)[-2:]])


def _drawn(order: int, samples: int, random: np.random.Generator) -> Array:
    """Draw a stable polynomial, with time constants from one sample to the record's length."""
    drawn: list[complex] = []
    while len(drawn) < order:
        modulus = np.exp(-(samples ** -random.random()))
        if order - len(drawn) > 1 and random.random() < _OSCILLATING:
            angle = np.pi * samples ** -random.random()
            drawn += [modulus * np.exp(1j * angle), modulus * np.exp(-1j * angle)]
        else:
            drawn.append(modulus)
    return np.atleast_1d(np.real(np.poly(drawn)))
