"""Designs of sweeps: the combinations of values that are run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.reporting import option
from orchestration.sweeps.ranges import Range
from orchestration.sweeps.sensitivity import indices
from orchestration.sweeps.sensitivity import one_at_a_time as tornado
from orchestration.sweeps.sensitivity import prediction_bands as bands

GIVEN = ("grid", "list", bands.BANDS)  # of values that are given
SAMPLED = ("latin-hypercube", "sobol", indices.SOBOL_INDICES)  # of values that are chosen
DESIGNS = (*GIVEN, *SAMPLED, tornado.TORNADO)
MOST = 100_000_000  # cases
FEWEST = 16  # samples of Sobol indices; with fewer, index and bootstrap are mere noise


@dataclass(frozen=True)
class Design:
    """The cases of a sweep.

    Attributes
    ----------
    kind : {"grid", "list", "draws", "latin-hypercube", "sobol", "sobol-indices", "tornado"}
    ranges : tuple of Range
        One for each of p parameters.
    cases : ndarray, shape (n, p)
        In the units of the ranges; of a grid the last parameter changes fastest.
    """

    kind: str
    ranges: tuple[Range, ...]
    cases: Array

    @property
    def names(self) -> list[str]:
        """Names of the parameters."""
        return [one.name for one in self.ranges]

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of values of the parameters of a grid; of another design the number of cases."""
        if self.kind == "grid":
            return tuple(len(one.values) for one in self.ranges)
        return (len(self.cases),)


def design(
    ranges: Sequence[Range],
    kind: str = "grid",
    samples: int | None = None,
    seed: int = 0,
    starts: Mapping[str, float] | None = None,
) -> Design:
    """Choose the cases of a sweep.

    Parameters
    ----------
    ranges : sequence of Range
    kind : {"grid", "list", "draws", "latin-hypercube", "sobol", "sobol-indices", "tornado"}
        ``grid``: every value with every other. ``list``, ``draws``: the first values of all
        parameters, then the second ones, and so on, where they were chosen or drawn at random.
        ``latin-hypercube``: points between the ends of the ranges, one in each of as many equal
        parts of every parameter (McKay, Beckman, Conover, Technometrics 21, 1979). ``sobol``:
        points of low discrepancy (Sobol, with Owen's scrambling). ``sobol-indices``: points from
        which Sobol indices are estimated. ``tornado``: each parameter by itself at the ends of its
        range, the others at their start value.
    samples : int, optional
        Points of ``latin-hypercube``, ``sobol`` and ``sobol-indices``, a power of two for the last
        two; of ``sobol-indices`` 16 or more, and as many cases for each parameter, and twice as
        many besides.
    seed : int
        Of these points.
    starts : Mapping of str to float, optional
        Start values, for a tornado.

    Raises
    ------
    UserError
        If the ranges, the kind of design and the number of samples do not go together.
    """
    if kind not in DESIGNS:
        raise UserError(f"{option('kind', kind)}: it is one of {', '.join(DESIGNS)}")
    if not ranges:
        raise UserError(
            f"nothing to sweep: name a parameter, such as {option('over', {'R1': '0.3..0.7:41'})}"
        )
    names = [one.name for one in ranges]
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"{option('over')} names {name} twice")
    chosen = tuple(ranges)
    if kind in GIVEN:
        return _given(chosen, kind, samples)
    for one in chosen:
        if one.counted:
            raise UserError(
                f"{one.name} has its values, which {option('kind', kind)} chooses: write from..to"
            )
    if kind == tornado.TORNADO:
        _refuse_samples(kind, samples)
        return Design(kind, chosen, tornado.one_at_a_time(chosen, starts or {}))
    return _sampled(chosen, kind, samples, seed)


def _refuse_samples(kind: str, samples: int | None) -> None:
    if samples is not None:
        raise UserError(
            f"{option('samples', samples)} is of {option('kind')} {', '.join(SAMPLED)}; a {kind}"
            " has its own values"
        )


def _given(ranges: tuple[Range, ...], kind: str, samples: int | None) -> Design:
    """Return a design of values that are given."""
    _refuse_samples(kind, samples)
    for one in ranges:
        if not one.counted:
            raise UserError(
                f"{one.name} names no count of values, as in 0.3..0.7:41, which a {kind} needs"
            )
    return _grid(ranges) if kind == "grid" else _one_by_one(ranges, kind)


def _grid(ranges: tuple[Range, ...]) -> Design:
    """Return all combinations of the values of ranges, the last of which changes fastest."""
    for one in ranges:
        distinct, counts = np.unique(one.values, return_counts=True)
        if len(distinct) < len(one.values):
            raise UserError(f"{one.name}: {distinct[counts > 1][0]:g} stands there twice")
    lengths = [len(one.values) for one in ranges]
    _refuse_too_many(float(np.prod(np.array(lengths, dtype=float))))
    grid = np.meshgrid(*(one.values for one in ranges), indexing="ij")
    return Design("grid", ranges, np.column_stack([column.ravel() for column in grid]))


def _one_by_one(ranges: tuple[Range, ...], kind: str) -> Design:
    """Return the first values of all parameters as the first case, the second as the second, ..."""
    lengths = [len(one.values) for one in ranges]
    if len(set(lengths)) > 1:
        listed = ", ".join(f"{one.name} {len(one.values)}" for one in ranges)
        raise UserError(
            f"{option('kind', kind)} takes as many values of every parameter, not {listed}"
        )
    _refuse_too_many(lengths[0])
    return Design(kind, ranges, np.column_stack([one.values.ravel() for one in ranges]))


def _refuse_too_many(count: float) -> None:
    if count > MOST:
        raise UserError(f"{count:.3g} cases; at most {MOST:,} are made")


def _sampled(ranges: tuple[Range, ...], kind: str, samples: int | None, seed: int) -> Design:
    """Return a design of values that are chosen between the ends of the ranges."""
    if samples is None or not 1 <= samples <= MOST:
        raise UserError(f"{option('kind', kind)} needs {option('samples')}, from 1 to {MOST:,}")
    if kind != "latin-hypercube" and samples & (samples - 1):
        raise UserError(
            f"{option('samples', samples)}: points of Sobol are even for powers of two only, such"
            " as 128 and 256"
        )
    if kind == indices.SOBOL_INDICES:
        if samples < FEWEST:
            raise UserError(
                f"{option('samples', samples)}: {option('kind', kind)} takes {FEWEST} or more;"
                " fewer say nothing of a variance"
            )
        _refuse_too_many(samples * (len(ranges) + 2))
        unit = indices.sampled(len(ranges), samples, seed)
    else:
        from scipy.stats import qmc  # half a second to load, which a grid does without

        sampler = qmc.Sobol if kind == "sobol" else qmc.LatinHypercube
        unit = sampler(len(ranges), rng=np.random.default_rng(seed)).random(samples)
    columns = [one.between(unit[:, k]) for k, one in enumerate(ranges)]
    return Design(kind, ranges, np.column_stack(columns))
