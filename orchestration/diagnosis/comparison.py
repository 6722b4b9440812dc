"""The comparison of two fitted models on the same samples.

A comparison is a handful of features with their errors, and one score of them by the numbers in
`WEIGHTS`; the conclusion is drawn from these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis.fitting import Fit, effective_samples
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.terms import Memory, NamedTerm, SensorTerm, Shape, Term


@dataclass(frozen=True)
class Weights:
    """The numbers that decide; in nats unless said otherwise.

    Attributes
    ----------
    fitted, left_out : float
        Weights of the gains in log likelihood. What is fitted counts half: it gains by any column.
    term : float
        Of each term. Two thirds of a column's cost in a record of 10,000 independent samples.
    share_of_words, share_of_terms : float
        Of the inexact part of the gain, for each nat of words and for each term after the first:
        nats weigh nothing beside a gain of hundreds, in which no model of a few laws is exact.
    shape, curve : float
        Prior of a shape that is neither linear nor a square, and of a curve.
    constant, fading, count : float
        Prior of each constant of a memory, of one that sees changes only, and of one that counts.
    factor : float
        Prior of a change in proportion to a law.
    law_as_signal, foreign, time : float
        Prior of a law as the signal of another, of a signal that the law does not depend on, and of
        the time, which is no cause.
    misread, shifted : float
        Prior of a file that is misread, or of a fault of a sensor: a wrong sign or unit is no rare
        fault and does nothing else, while an offset or a delay is a size, and like a law.
    nominal : float
        Weight of the distance from nominal parameters between two readings of a file: the prior
        of a fit, a factor of ten, lets a search run, while a model that is worth a diagnosis is
        within a factor of three.
    behind : float
        Errors of the difference on what is left out, by which a fit may be behind the best there:
        the rule of one standard error (Breiman et al.: Classification and Regression Trees, 1984);
        of two where the best leave white noise, and nothing is behind by more than chance.
    share_behind : float
        Share of the mean square that is removed, by which it may be behind at least: less is no
        matter of causes.
    gaining : float
        Share of the best score, from which on a fit is a measure of the lowest error.
    alone : float
        Share of the gain of a set that its first term must have alone.
    least : float
        Score and gain on what is left out, above which something is missing at all: strong evidence
        (Kass and Raftery: Bayes factors, J. Am. Stat. Assoc. 90, 1995).
    temper, temper_of_gain : float
        Scale of scores that a probability is made of: of nats, and as a share of the inexact part
        of the largest gain.
    confidence : Mapping of str to float
        Log odds that the true cause is among some, by their `features.features_of`: fitted to
        records of five plants, half of them with truths outside of what can be searched (decision
        111).
    fed : float
        By which errors count more of a model that is fed what was measured, and so knows more.
    no_better : float
        Error on what is left out, over the RMS of the outputs there about their means, from which
        on nothing is predicted.
    explained : float
        Share of what neighbouring errors of the model have in common, by the mean square, that a
        cause explains at least.
    sure, group : float
        Probability from which a cause is named, and which a group reaches.
    most : int
        Causes in a group.
    same : float
        Relative difference of errors, up to which two models say the same of the fitted samples.
    """

    fitted: float = 0.5
    left_out: float = 1.0
    term: float = 3.0
    share_of_words: float = 0.02
    share_of_terms: float = 0.04
    shape: float = 0.5
    curve: float = 1.0
    constant: float = 2.0
    fading: float = 1.0
    count: float = 2.0
    factor: float = 1.0
    law_as_signal: float = 2.0
    foreign: float = 1.5
    time: float = 8.0
    misread: float = 2.0
    shifted: float = 6.0
    nominal: float = 4.0
    behind: float = 1.0
    share_behind: float = 0.02
    gaining: float = 0.5
    alone: float = 0.5
    least: float = 3.0
    temper: float = 3.0
    temper_of_gain: float = 0.05
    confidence: Mapping[str, float] = field(
        default_factory=lambda: {
            "constant": -0.8,
            "margin": 4.5,
            "share": 3.7,
            "words": -0.3,
            "rise": -1.0,
        }
    )
    fed: float = 2.0
    no_better: float = 0.7
    explained: float = 2.0 / 3.0
    sure: float = 0.9
    group: float = 0.9
    most: int = 3
    same: float = 0.05


WEIGHTS = Weights()
_LEAST = 1e-12  # mean square of errors, in squared spreads
_NEAREST = 3  # fits whose residuals say how many samples are independent


def words(model: LawModel, term: Term, depends: bool) -> float:
    """Return the prior of a term, nats: what is plain comes first.

    Parameters
    ----------
    model : LawModel
    term : Term
    depends : bool
        Whether its law depends on its signal already.
    """
    if isinstance(term, NamedTerm):
        return 0.0
    if isinstance(term, SensorTerm):
        # where the output is a law that may lack a term, a fault of its sensor is a plain one
        is_plain = term.law in model.targets
        return _words_of_shape(term.shape) + (0.0 if is_plain else WEIGHTS.misread)
    total = _words_of_shape(term.shape) + _words_of_memory(term.memory)
    # what a model receives of an input, over that input, is a misread column in other words
    if term.law in model.received and depends:
        total += WEIGHTS.misread
    if not term.signal:
        return total
    if term.factor:
        total += WEIGHTS.factor
    if not depends:
        total += WEIGHTS.foreign
    if term.is_trend:
        total += WEIGHTS.time
    # what a law calls is as plain a signal of it as a state
    plain = model.plain_laws | model.reads(term.law)
    if term.signal in model.laws and term.signal not in plain:
        total += WEIGHTS.law_as_signal
    return total


def _words_of_memory(memory: Memory) -> float:
    total = WEIGHTS.constant * memory.constants
    if memory is Memory.FADING:
        total += WEIGHTS.fading
    return total + WEIGHTS.count if memory.counts else total


def _words_of_shape(shape: Shape) -> float:
    if shape in (Shape.CONSTANT, Shape.LINEAR, Shape.SQUARE, Shape.ODD_SQUARE):
        return 0.0
    return WEIGHTS.curve if shape in (Shape.CURVE, Shape.STEP) else WEIGHTS.shape


@dataclass(frozen=True, eq=False)
class Judged:
    """A fit with its errors on samples that it was not fitted to.

    Attributes
    ----------
    fit : Fit
    choosing, measuring : ndarray, shape (m, ny)
        Errors in spreads, on what is left out: of the samples that take part in the choice, and of
        those by which nothing is chosen.
    beyond : ndarray, shape (m, ny)
        Those of the choice beyond what parameters leave uncertain, by which a prediction is as
        likely; see `Prediction.beyond_uncertainty`.
    words : float
        Prior of its terms and of its reading, nats.
    reading : Reading or None
        Of the file.
    """

    fit: Fit
    choosing: Array
    beyond: Array
    measuring: Array
    words: float
    reading: Reading | None = None

    @property
    def terms(self) -> tuple[Term, ...]:
        """The terms of the fit."""
        return self.fit.terms

    @property
    def parts(self) -> tuple[Reading | Term, ...]:
        """All that may be a cause: the reading and the terms."""
        return self.fit.terms if self.reading is None else (self.reading, *self.fit.terms)

    @property
    def freedom(self) -> int:
        """Degrees of freedom that the terms and the reading add."""
        if self.reading is None:
            return self.fit.freedom
        return self.fit.freedom + len(self.reading.values)

    @cached_property
    def left_out(self) -> float:
        """Root mean square of the errors by which nothing is chosen, in spreads."""
        errors = self.measuring if np.isfinite(self.measuring).any() else self.choosing
        return float(np.sqrt(np.nanmean(errors**2)))

    @property
    def filed(self) -> list[Array]:
        """Errors (n, ny) of each fitted record, in spreads, in the rows of its file."""
        if self.reading is None:
            return list(self.fit.errors)
        problem = self.fit.problem
        pairs = zip(self.fit.errors, problem.records, strict=True)
        return [self.reading.as_filed(problem.model, e, r.time) for e, r in pairs]

    @cached_property
    def effective(self) -> list[Array]:
        """Effective samples (ny,) of each fitted record."""
        pairs = zip(self.fit.errors, self.fit.problem.records, strict=True)
        return [np.array([effective_samples(c, r.phases) for c in e.T]) for e, r in pairs]


@dataclass(frozen=True)
class Comparison:
    """A fitted model against another on the same samples.

    Attributes
    ----------
    fitted, left_out : float
        Gain in log likelihood, nats: ``n_eff / 2 log`` of the ratio of mean squares.
    rise, error : float
        By which the mean square rises on what is left out, and the standard error of that, by a
        bootstrap of blocks (Kuensch: The jackknife and the bootstrap for general stationary
        observations, Annals of Statistics 17, 1989).
    columns : float
        Cost of the columns that it has more, ``1/2 log n_eff`` each (Schwarz).
    terms : int
        Terms, and changes in a later record, that it has more.
    distance : float
        By which its parameters are farther from nominal, nats.
    words : float
        Prior of its words, nats.
    rereads : bool
        Whether the files are read in another way.
    """

    fitted: float
    left_out: float
    rise: float
    error: float
    columns: float
    terms: int
    distance: float
    words: float
    rereads: bool = False

    @property
    def gain(self) -> float:
        """Weighed gain, nats."""
        return WEIGHTS.fitted * self.fitted + WEIGHTS.left_out * self.left_out

    @property
    def evidence(self) -> float:
        """Gain that fitted samples, less the columns, and what is left out agree on, nats.

        With another reading of the files, plausible parameters are a part of it.
        """
        implausible = self.distance if self.rereads else 0.0
        return min(self.fitted - self.columns, self.left_out) - implausible

    @property
    def is_worse(self) -> bool:
        """True if the error on what is left out rises beyond its own error."""
        return self.rise > self.error

    @property
    def cost(self) -> float:
        """Cost of its terms, of its parameters' distance from nominal, and of its words, nats."""
        return self.columns + WEIGHTS.term * self.terms + self.distance + self.words

    def score(self, inexact: float) -> float:
        """Return the score, nats.

        Parameters
        ----------
        inexact : float
            Part of the largest gain of all that are compared, by which none is exact; see
            `inexact`.
        """
        share = WEIGHTS.share_of_words * self.words
        share += WEIGHTS.share_of_terms * max(self.terms - 1, 0)
        return self.gain - self.cost - share * inexact


# features of a comparison by name, as `--explain` prints them
FEATURES = {
    "fitted": "gain on fitted samples [nat]",
    "left_out": "gain on unseen samples [nat]",
    "rise": "rise of the mean square error on unseen samples",
    "error": "its standard error",
    "columns": "cost of further coefficients [nat]",
    "terms": "further terms",
    "distance": "distance from nominal parameters [nat]",
    "words": "prior against it [nat]",
}


@dataclass(frozen=True, eq=False)
class Common:
    """Effective samples, the same in all comparisons of a diagnosis.

    Attributes
    ----------
    fitted : list of ndarray, shape (ny,)
        Of each fitted record.
    left_out : ndarray, shape (ny,)
        Of what is left out.
    structure : float
        Share of the fitted samples that are not independent, the mean over the outputs: 0 if the
        best leave white noise.
    """

    fitted: list[Array]
    left_out: Array
    structure: float


@dataclass(frozen=True, eq=False)
class Contrast:
    """Ratios of the errors of two models, which do not depend on the effective samples.

    Attributes
    ----------
    fitted : list of ndarray, shape (ny,)
        Logarithm of the ratio of root mean squares in each fitted record.
    left_out : ndarray, shape (ny,)
        The same on what is left out.
    rise, error : float
        See `Comparison`.
    """

    fitted: list[Array]
    left_out: Array
    rise: float
    error: float


def contrast(one: Judged, base: Judged) -> Contrast:
    """Return the errors of a fitted model beside those of another on the same samples."""
    pairs = zip(one.fit.errors, base.fit.errors, strict=True)
    fitted = [_log_ratio(ours, theirs) for ours, theirs in pairs]
    return Contrast(fitted, _log_ratio(one.beyond, base.beyond), *difference(one, base))


def compare(
    one: Judged, base: Judged, common: Common, between: Contrast | None = None
) -> Comparison:
    """Compare a fitted model with another on the same samples.

    Parameters
    ----------
    one, base : Judged
    common : Common
    between : Contrast, optional
        Of these two, if it is known.
    """
    between = between or contrast(one, base)
    fitted = sum(float(n @ r) for n, r in zip(common.fitted, between.fitted, strict=True))
    samples = sum(float(n.sum()) for n in common.fitted)
    freedom = one.freedom - base.freedom
    rereads = one.reading != base.reading
    return Comparison(
        fitted,
        float(common.left_out @ between.left_out),
        between.rise,
        between.error,
        0.5 * freedom * float(np.log(max(samples, 3.0))),
        one.fit.explanations - base.fit.explanations,
        (one.fit.distance - base.fit.distance) * (WEIGHTS.nominal if rereads else 1.0),
        one.words - base.words,
        rereads,
    )


def inexact(comparisons: Sequence[Comparison], structure: float) -> float:
    """Return the part of the largest gain, nats, by which no model of a few laws is exact.

    Zero if the best leave white noise: then scores are those of a likelihood.

    Parameters
    ----------
    comparisons : sequence of Comparison
    structure : float
        See `Common`.
    """
    gains = [c.gain for c in comparisons if np.isfinite(c.gain)]
    return structure * max([0.0, *gains])


def difference(one: Judged, base: Judged) -> tuple[float, float]:
    """Return the rise of the mean square on what is left out, and its standard error.

    Beyond what parameters leave uncertain: a drift by one of them is no matter of the terms.
    """
    return _rise(one.beyond, base.beyond, _resolution(one, base))


def shortfall(one: Judged, likeliest: Judged, noise: Array) -> tuple[float, float]:
    """Return by how much a prediction is less likely than another, and its standard error.

    As a rise of the mean square beyond uncertain parameters, in widths of the noise (ny,).
    """
    errors = one.beyond / noise, likeliest.beyond / noise
    return _rise(*errors, _resolution(one, likeliest))


def rises(one: Judged, base: Judged) -> bool:
    """Return whether the error rises beyond its own error where nothing is chosen by it."""
    rise, error = _rise(one.measuring, base.measuring, _resolution(one, base))
    return rise > error


def are_same(one: Judged, other: Judged) -> bool:
    """Return whether two fits leave the same errors in the same rows, but for their sign."""
    ours, theirs = (np.abs(np.concatenate(judged.filed)) for judged in (one, other))
    known = np.isfinite(ours) & np.isfinite(theirs)
    difference = np.linalg.norm((ours - theirs)[known])
    return bool(difference < WEIGHTS.same * np.linalg.norm(theirs[known]))


def _resolution(one: Judged, base: Judged) -> float:
    """Return the share of a mean square that makes no difference: two readings may be the same."""
    return 0.0 if one.reading == base.reading else WEIGHTS.share_behind


def _rise(ours: Array, theirs: Array, least: float) -> tuple[float, float]:
    """Return the rise of the mean square of errors (n, ny) over others, and its standard error.

    This is so large a share of the others' mean square at least.
    """
    known = np.isfinite(ours).any(axis=1) & np.isfinite(theirs).any(axis=1)
    if known.sum() < 4:
        return 0.0, np.inf
    rise = np.nanmean(ours[known] ** 2, axis=1) - np.nanmean(theirs[known] ** 2, axis=1)
    blocks = np.array([b.mean() for b in np.array_split(rise, min(12, len(rise) // 2))])
    draws = np.random.default_rng(0).choice(blocks, (400, len(blocks))).mean(axis=1)
    error = max(float(draws.std()), least * float(np.nanmean(theirs[known] ** 2)))
    return float(rise.mean()), error


def _log_ratio(ours: Array, theirs: Array) -> Array:
    """Return log ratios (ny,) of root mean squares of errors (n, ny), where both are known.

    Zero of an output of which nothing is known.
    """
    known = np.isfinite(ours) & np.isfinite(theirs)
    count = np.maximum(known.sum(axis=0), 1)
    one, other = (np.where(known, e, 0.0) for e in (ours, theirs))
    squares = [np.maximum((e**2).sum(axis=0) / count, _LEAST) for e in (one, other)]
    return np.asarray(0.5 * np.log(squares[1] / squares[0]))


def common_of(judged: Sequence[Judged]) -> Common:
    """Return what comparisons of these fits share: medians over the fits nearest to the records.

    What is left out has the same share of independent samples; its own residuals do not tell, which
    are slow where a model fails there.
    """
    nearest = sorted(judged, key=lambda one: one.fit.misfit)[:_NEAREST]
    errors = nearest[0].fit.errors
    fitted = [np.median([one.effective[r] for one in nearest], axis=0) for r in range(len(errors))]
    samples = sum(np.isfinite(e).sum(axis=0) for e in errors)
    share = np.sum(fitted, axis=0) / np.maximum(samples, 1)
    left_out = share * np.isfinite(nearest[0].choosing).sum(axis=0)
    return Common(fitted, left_out, 1.0 - float(share[samples > 0].mean()))
