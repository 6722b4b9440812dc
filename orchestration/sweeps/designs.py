"""Designs of sweeps: the combinations of parameter values that are run."""

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

GIVEN = ("grid", "list", bands.BANDS)  # the user gives the values
SAMPLED = ("latin-hypercube", "sobol", indices.SOBOL_INDICES)  # the design chooses the values
DESIGNS = (*GIVEN, *SAMPLED, tornado.TORNADO)
MOST = 100_000_000  # cases
FEWEST = 16  # samples for Sobol indices; fewer give only noise


@dataclass(frozen=True)
class Design:
    """The cases of a sweep.

    Attributes
    ----------
    kind : {"grid", "list", "draws", "latin-hypercube", "sobol", "sobol-indices", "tornado"}
    ranges : tuple of Range
        A range for each of p parameters.
    cases : ndarray, shape (n, p)
        In the units of the ranges; in a grid the last parameter changes fastest.
    """

    kind: str
    ranges: tuple[Range, ...]
    cases: Array

    @property
    def names(self) -> list[str]:
        """Names of the parameters."""
        return [parameter.name for parameter in self.ranges]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values per parameter of a grid; the number of cases of another design."""
        if self.kind == "grid":
            return tuple(len(parameter.values) for parameter in self.ranges)
        return (len(self.cases),)


def design(
    ranges: Sequence[Range],
    kind: str = "grid",
    samples: int | None = None,
    seed: int = 0,
    starts: Mapping[str, float] | None = None,
) -> Design:
    """Return the cases of a sweep.

    Parameters
    ----------
    ranges : sequence of Range
    kind : {"grid", "list", "draws", "latin-hypercube", "sobol", "sobol-indices", "tornado"}
        ``grid``: all combinations of values. ``list``, ``draws``: the first values of all
        parameters, then the second ones, and so on, given or drawn at random.
        ``latin-hypercube``: points between the ends of the ranges, one in each of as many equal
        parts of every parameter (McKay, Beckman, Conover, Technometrics 21, 1979). ``sobol``:
        points of low discrepancy (Sobol, with Owen's scrambling). ``sobol-indices``: points for
        the estimation of Sobol indices. ``tornado``: one parameter at a time at the ends of its
        range, the others at their start values.
    samples : int, optional
        Number N of points of ``latin-hypercube``, ``sobol`` and ``sobol-indices``, a power of two
        for the last two; ``sobol-indices`` of p parameters need 16 or more and have N (p + 2)
        cases.
    seed : int
        Seed of these points.
    starts : Mapping of str to float, optional
        Start values of the parameters, for a tornado.

    Returns
    -------
    Design

    Raises
    ------
    UserError
        If the ranges, the kind of design and the number of samples do not match.
    """
    if kind not in DESIGNS:
        raise UserError(f"{option('kind', kind)}: it is one of {', '.join(DESIGNS)}")
    if not ranges:
        raise UserError(
            f"nothing to sweep: name a parameter, such as {option('over', {'R1': '0.3..0.7:41'})}"
        )
    names = [parameter.name for parameter in ranges]
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"{option('over')} names {name} twice")
    if kind in GIVEN:
        return _design_of_values(tuple(ranges), kind, samples)
    for parameter in ranges:
        if parameter.counted:
            raise UserError(
                f"{parameter.name} has a list of values, but {option('kind', kind)} chooses them:"
                " write from..to"
            )
    if kind == tornado.TORNADO:
        _refuse_samples(kind, samples)
        return Design(kind, tuple(ranges), tornado.one_at_a_time(ranges, starts or {}))
    return _design_of_samples(tuple(ranges), kind, samples, seed)


def _refuse_samples(kind: str, samples: int | None) -> None:
    if samples is not None:
        raise UserError(
            f"{option('samples', samples)} is for {option('kind')} {', '.join(SAMPLED)}; a {kind}"
            " has its own values"
        )


def _design_of_values(ranges: tuple[Range, ...], kind: str, samples: int | None) -> Design:
    """Return a design of the values in the ranges."""
    _refuse_samples(kind, samples)
    for parameter in ranges:
        if not parameter.counted:
            raise UserError(
                f"{parameter.name}: a {kind} needs the number of values, as in 0.3..0.7:41"
            )
    return _grid(ranges) if kind == "grid" else _one_by_one(ranges, kind)


def _grid(ranges: tuple[Range, ...]) -> Design:
    """Return all combinations of values; the last parameter changes fastest."""
    for parameter in ranges:
        distinct, counts = np.unique(parameter.values, return_counts=True)
        if len(distinct) < len(parameter.values):
            raise UserError(f"{parameter.name}: {distinct[counts > 1][0]:g} stands there twice")
    lengths = [len(parameter.values) for parameter in ranges]
    check_count(float(np.prod(np.array(lengths, dtype=float))))
    grid = np.meshgrid(*(parameter.values for parameter in ranges), indexing="ij")
    return Design("grid", ranges, np.column_stack([column.ravel() for column in grid]))


def _one_by_one(ranges: tuple[Range, ...], kind: str) -> Design:
    """Return a design whose k-th case has the k-th values of all parameters."""
    lengths = [len(parameter.values) for parameter in ranges]
    if len(set(lengths)) > 1:
        listed = ", ".join(f"{parameter.name} {len(parameter.values)}" for parameter in ranges)
        raise UserError(
            f"{option('kind', kind)} needs equal numbers of values for all parameters, not {listed}"
        )
    check_count(lengths[0])
    return Design(kind, ranges, np.column_stack([parameter.values.ravel() for parameter in ranges]))


def check_count(count: float) -> None:
    """Raise if there are more than `MOST` cases."""
    if count > MOST:
        raise UserError(f"{count:.3g} cases (allowed: at most {MOST:,})")


def _design_of_samples(
    ranges: tuple[Range, ...], kind: str, samples: int | None, seed: int
) -> Design:
    """Return a design of points between the ends of the ranges."""
    if samples is None or not 1 <= samples <= MOST:
        raise UserError(f"{option('kind', kind)} needs {option('samples')}, from 1 to {MOST:,}")
    is_power_of_two = not samples & (samples - 1)
    if kind != "latin-hypercube" and not is_power_of_two:
        raise UserError(
            f"{option('samples', samples)}: Sobol points are balanced only for powers of two, such"
            " as 128 and 256"
        )
    if kind == indices.SOBOL_INDICES:
        if samples < FEWEST:
            raise UserError(
                f"{option('samples', samples)}: {option('kind', kind)} needs {FEWEST} or more"
                " to estimate a variance"
            )
        check_count(samples * (len(ranges) + 2))
        shares = indices.saltelli_points(len(ranges), samples, seed)
    else:
        from scipy.stats import qmc  # loading takes half a second, so only where it is needed

        sampler = qmc.Sobol if kind == "sobol" else qmc.LatinHypercube
        shares = sampler(len(ranges), rng=np.random.default_rng(seed)).random(samples)
    columns = [parameter.between(shares[:, k]) for k, parameter in enumerate(ranges)]
    return Design(kind, ranges, np.column_stack(columns))
