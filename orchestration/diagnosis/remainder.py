"""Errors that a model leaves of the outputs on samples that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array, Indices
from orchestration.diagnosis.comparison import Judged
from orchestration.diagnosis.fitting import effective_samples, repeats
from orchestration.records.quality import noise_of, resolution_of

_SLOW = 0.5  # correlation of neighbouring samples from which on most of a remainder is slow
_CHANCE = 3.0  # standard errors, up to which noise is white, and does not recur
_LARGE = 0.15  # of the spread, from which on what is left is no noise of a usual instrument
_COMMON = 0.1  # the same of the part that neighbouring samples have in common
_WIDTHS = 1.5  # of the noise, from which on what is left is more than noise
_MOVES = 0.5  # of what is left, by which a model moves from sample to sample at most


@dataclass(frozen=True)
class Remainder:
    """The error of one output where nothing was fitted.

    Attributes
    ----------
    output : str
    share : float
        Root mean square over that of the output about its mean.
    noise_widths : float or None
        Root mean square over the standard deviation of the noise; None for an output without noise.
    tests : Mapping of str to float
        Results of `TESTS` by name.
    pairs : int
        Neighbouring samples by which their correlation is known.
    """

    output: str
    share: float
    noise_widths: float | None
    tests: Mapping[str, float]
    pairs: int

    @property
    def correlation(self) -> float:
        """Correlation of neighbouring samples."""
        return self.tests["correlation"]

    @property
    def pace(self) -> str:
        """``slow`` if most of its square is common to neighbouring samples, else ``fast``.

        ``unknown`` if as much may be so by chance.
        """
        if self.correlation > _SLOW and not self.is_white:
            return "slow"
        return "unknown" if _is_white(_SLOW, self.pairs) else "fast"

    @property
    def is_white(self) -> bool:
        """True if neighbouring samples correlate no more than those of white noise by chance."""
        return _is_white(self.correlation, self.pairs)

    @property
    def structure(self) -> float:
        """Share of the output of what is common to neighbouring samples: their covariance's root.

        Zero if it may be white noise.
        """
        return 0.0 if self.is_white else self.share * float(np.sqrt(self.correlation))

    @property
    def is_more_than_noise(self) -> bool:
        """True if it is not white, and clearly larger than what is independent in each sample."""
        return not self.is_white and (self.noise_widths is None or self.noise_widths > _WIDTHS)


def remainders(judged: Judged, sizes: Array | None = None) -> tuple[Remainder, ...]:
    """Return the remainder of every output that is measured where nothing was chosen by.

    Parameters
    ----------
    judged : Judged
    sizes : ndarray, shape (ny,), optional
        RMS of the outputs about their means, in their spreads; NaN of one that does not move. By
        default the spreads.
    """
    result = []
    problem = judged.fit.problem
    sizes = np.ones(len(problem.spread)) if sizes is None else sizes
    every = with_gaps([*judged.fit.errors, judged.measuring])
    for j, output in enumerate(problem.model.outputs):
        if not np.isfinite(sizes[j]):
            continue
        error = judged.measuring[:, j]
        if np.isfinite(error).sum() < 4:
            continue
        size = float(np.sqrt(np.nanmean(error**2)))
        rounding = _rounding([record.outputs[:, j] for record in problem.records])
        noise = max(noise_of(every[:, j]), rounding / float(problem.spread[j]))
        widths = size / noise if noise > 1e-6 * size else None
        share = size / float(sizes[j])
        tests = {name: test(error) for name, test in TESTS.items()}
        pairs = int(np.isfinite(error[:-1] * error[1:]).sum())
        result.append(Remainder(output.name, share, widths, tests, pairs))
    return tuple(result)


def drifts(judged: Judged) -> bool:
    """Return whether a model leaves a large slow error where nothing was fitted."""
    left = remainders(judged)
    return any(one.share > _LARGE and one.structure > _COMMON for one in left)


def structures(judged: Judged) -> tuple[float, float]:
    """Return the mean square, in spreads, of what neighbouring samples have in common.

    Of all outputs, where a model was fitted and where nothing was.
    """
    every = with_gaps(judged.fit.errors), judged.measuring
    fitted, measured = (sum(map(_structure, errors.T)) for errors in every)
    return fitted, measured


def _structure(error: Array) -> float:
    """Return the mean product of neighbours in an error (n,); zero if it may be white noise."""
    products = error[:-1] * error[1:]
    pairs = int(np.isfinite(products).sum())
    correlation = _neighbours(error)
    return 0.0 if _is_white(correlation, pairs) else correlation * float(np.nanmean(error**2))


def _is_white(correlation: float, pairs: int) -> bool:
    """Return whether neighbours correlate no more than those of white noise by chance.

    Their correlation has a standard error of ``1 / sqrt(n)`` (Bartlett: On the theoretical
    specification and sampling properties of autocorrelated time-series, 1946).
    """
    return correlation <= _CHANCE / np.sqrt(max(pairs, 1))


def leaves_more(judged: Judged) -> bool:
    """Return whether a model leaves more than noise of an output where nothing was chosen by."""
    return any(one.is_more_than_noise for one in remainders(judged))


def recurs(judged: Judged) -> bool:
    """Return whether more than noise is left that comes again in each period of the inputs.

    Noise does not (Pintelon, Schoukens: System Identification, 2012, section 4.3), but by chance
    as far as a mean square of so few independent samples is uncertain.
    """
    outputs = [output.name for output in judged.fit.problem.model.outputs]
    more = [outputs.index(one.output) for one in remainders(judged) if one.is_more_than_noise]
    pairs = list(zip(judged.fit.errors, judged.fit.problem.records, strict=True))
    return any(_recurs(errors[:, j], record.phases) for errors, record in pairs for j in more)


def _recurs(error: Array, phases: Indices | None) -> bool:
    known = np.isfinite(error)
    if phases is None or not known.any():
        return False
    e, at = error[known] - error[known].mean(), phases[known]
    independent = effective_samples(e) * len(np.unique(at)) / len(e)
    return repeats(e, at) > 1.0 + _CHANCE * np.sqrt(2.0 / independent)


def undersampled(judged: Judged) -> list[str]:
    """Return outputs that were sampled too coarsely to tell noise from what a law may do.

    What is left of them is large and white, and from sample to sample the model moves by as much,
    so that what it lacks would be white as well.
    """
    problem = judged.fit.problem
    pairs = zip(judged.fit.errors, problem.records, strict=True)
    simulated = with_gaps([record.outputs / problem.spread - e for e, record in pairs])
    names = [output.name for output in problem.model.outputs]
    moves = dict(zip(names, map(noise_of, simulated.T), strict=True))
    return [
        one.output
        for one in remainders(judged)
        if one.share > _LARGE and one.is_white and moves[one.output] > _MOVES * one.share
    ]


def with_gaps(pieces: Sequence[Array]) -> Array:
    """Return pieces (n, ny) one after the other, each with a gap behind it."""
    return np.concatenate([np.pad(p, ((0, 1), (0, 0)), constant_values=np.nan) for p in pieces])


def _rounding(pieces: Sequence[Array]) -> float:
    """Return the standard deviation of what a converter rounds off, of the finest record (n,).

    Of steps of a slow signal second differences tell nothing: most are zero. It is the step over
    the root of 12 (Widrow: Statistical analysis of amplitude-quantized sampled-data systems, 1961).
    """
    return min((resolution_of(piece) for piece in pieces), default=0.0) / np.sqrt(12.0)


def _neighbours(error: Array) -> float:
    """Return the correlation about zero of an error (n,) with itself one sample later."""
    products = error[:-1] * error[1:]
    square = np.nanmean(error**2)
    if not np.isfinite(products).any() or not square > 0.0:
        return 0.0
    return float(np.clip(np.nanmean(products) / square, -1.0, 1.0))


# residual tests: functions of the error (n,) of an output, by name in tables and in JSON
TESTS: dict[str, Callable[[Array], float]] = {"correlation": _neighbours}
