"""Which combinations of values are run: a full grid, or a sample that fills the space evenly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.sweeps.ranges import Range
from orchestration.sweeps.sensitivity import bands, indices, tornado

Array = NDArray[np.float64]
GIVEN, SAMPLED = ("grid", "list", bands.KIND), ("latin-hypercube", "sobol", indices.KIND)
DESIGNS = (*GIVEN, *SAMPLED, tornado.KIND)
MOST = 100_000_000  # cases
FEWEST = 16  # samples of Sobol indices: of one, an index and its bootstrap are those of noise


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
        """Of the parameters."""
        return [one.name for one in self.ranges]

    @property
    def shape(self) -> tuple[int, ...]:
        """Values of each parameter of a grid; of another design the number of cases."""
        return (
            tuple(len(one.values) for one in self.ranges)
            if self.kind == "grid"
            else (len(self.cases),)
        )


def design(
    ranges: Sequence[Range],
    kind: str = "grid",
    samples: int | None = None,
    seed: int = 0,
    starts: Mapping[str, float] | None = None,
) -> Design:
    """Choose the cases.

    Parameters
    ----------
    ranges : sequence of Range
    kind : {"grid", "list", "draws", "latin-hypercube", "sobol", "sobol-indices", "tornado"}
        Every value with every other; the first values of all parameters, then the second ones, and so on, where these
        were chosen (``list``) or drawn at random (``draws``); points between the ends of the ranges, one in each of as
        many equal parts of every parameter (McKay, Beckman, Conover, Technometrics 21, 1979), or of low discrepancy
        (Sobol, with Owen's scrambling), or such from which indices of Sobol can be told; or each parameter by itself at
        the ends of its range, the others at their start value.
    samples : int, optional
        Points of ``latin-hypercube``, ``sobol`` and ``sobol-indices``, a power of two for the last two; of
        ``sobol-indices`` 16 or more, and as many cases for each parameter, and twice as many besides.
    seed : int
        Of these.
    starts : Mapping of str to float, optional
        Start values, for a tornado.

    Raises
    ------
    UserError
        If the ranges, their kind and the number of samples do not go together.
    """
    if kind not in DESIGNS:
        raise UserError(f"--design {kind}: it is one of {', '.join(DESIGNS)}")
    if not ranges:
        raise UserError(
            "nothing to sweep: name a parameter with --over, such as --over R1=0.3..0.7:41"
        )
    if seed < 0:
        raise UserError(f"seed {seed}: zero or more")
    names = [one.name for one in ranges]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice:
        raise UserError(f"--over names {twice} twice")
    chosen = tuple(ranges)
    if kind in GIVEN:
        return _given(chosen, kind, samples)
    counted = next((one.name for one in chosen if one.counted), None)
    if counted:
        raise UserError(
            f"--over {counted} has its values, which --design {kind} chooses: write from..to"
        )
    if kind == tornado.KIND:
        _refuse_samples(kind, samples)
        return Design(kind, chosen, tornado.one_at_a_time(chosen, starts or {}))
    return _sampled(chosen, kind, samples, seed)


def _refuse_samples(kind: str, samples: int | None) -> None:
    if samples is not None:
        raise UserError(
            f"--samples {samples} is of --design {', '.join(SAMPLED)}; a {kind} has its own values"
        )


def _given(ranges: tuple[Range, ...], kind: str, samples: int | None) -> Design:
    _refuse_samples(kind, samples)
    open_ended = next((one.name for one in ranges if not one.counted), None)
    if open_ended:
        raise UserError(
            f"--over {open_ended} names no count of values, as in 0.3..0.7:41, which a {kind} needs"
        )
    lengths = [len(one.values) for one in ranges]
    if kind != "grid" and len(set(lengths)) > 1:
        told = ", ".join(f"{one.name} {n}" for one, n in zip(ranges, lengths, strict=True))
        raise UserError(f"--design {kind} takes as many values of every parameter, not {told}")
    for one in ranges if kind == "grid" else ():
        several, counts = np.unique(one.values, return_counts=True)
        if len(several) < len(one.values):
            raise UserError(f"--over {one.name}: {several[counts > 1][0]:g} stands there twice")
    count = float(np.prod(np.array(lengths, dtype=float))) if kind == "grid" else lengths[0]
    if count > MOST:
        raise UserError(f"{count:.3g} cases; at most {MOST:,} are made")
    columns = [one.values for one in ranges]
    grid = np.meshgrid(*columns, indexing="ij") if kind == "grid" else columns
    return Design(kind, ranges, np.column_stack([one.ravel() for one in grid]))


def _sampled(ranges: tuple[Range, ...], kind: str, samples: int | None, seed: int) -> Design:
    if samples is None or not 1 <= samples <= MOST:
        raise UserError(f"--design {kind} needs --samples, from 1 to {MOST:,}")
    if kind != "latin-hypercube" and samples & (samples - 1):
        raise UserError(
            f"--samples {samples}: points of Sobol are even for powers of two only, such as 128 and 256"
        )
    if kind == indices.KIND:
        if samples < FEWEST:
            raise UserError(
                f"--samples {samples}: --design {kind} takes {FEWEST} or more; fewer say nothing of a variance"
            )
        if samples * (len(ranges) + 2) > MOST:
            raise UserError(f"{samples * (len(ranges) + 2):.3g} cases; at most {MOST:,} are made")
        unit = indices.sampled(len(ranges), samples, seed)
    else:
        from scipy.stats import qmc  # half a second to load, which a grid does without

        sampler = (qmc.Sobol if kind == "sobol" else qmc.LatinHypercube)(
            len(ranges), rng=np.random.default_rng(seed)
        )
        unit = sampler.random(samples)
    columns = [one.between(unit[:, k]) for k, one in enumerate(ranges)]
    return Design(kind, ranges, np.column_stack(columns))
