"""What a residual goes along with, and where in the record and in which operating region it is largest.

Both the residual and the signals are filtered by what makes the residual white before they are correlated: two slow
signals that have nothing to do with each other look alike, two white ones do not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import f, norm, t

from orchestration.discrepancy.noise import Noise, estimate
from orchestration.discrepancy.wandering import Slow, slow

if TYPE_CHECKING:
    from orchestration.discrepancy.evidence import Data, Evidence

Array = NDArray[np.float64]
SIGNIFICANCE = 0.01  # false alarms of all lags of all signals, or of all bins of all signals, together
LAGS = 25  # samples, either way
BINS = 8
_FEWEST = 20  # samples in a bin that says something
_DRAWS, _FEW_DRAWS = 40, 8  # of noise, to see what a regression explains of it
_EFFORT = 200_000  # samples in all draws, beyond the fewest
_LEAD = 1000  # samples until drawn noise has forgotten its start
_COLOURED = 4  # passes of regression and of estimating the colour of what it leaves
_FLAT = 1e-9  # relative curvature below which a direction counts as undetermined
_STILL = 1e-9  # of a signal's size; what varies less does not vary


@dataclass(frozen=True)
class Explaining:
    """A signal that a residual may go along with.

    Attributes
    ----------
    name : str
        For people, like ``"rate of charge"``.
    values : ndarray, shape (n,)
        At every sample of the record.
    unit : str
    """

    name: str
    values: Array
    unit: str


@dataclass(frozen=True)
class Association:
    """Cross-correlation of the innovations of an output with a signal.

    Attributes
    ----------
    output, signal : str
    lags : ndarray, shape (l,)
        Seconds by which the signal comes before the residual.
    correlation : ndarray, shape (l,)
    band : float
        99 % of the correlations of one lag lie within it, either way, where there is nothing.
    lag, strength : float
        Where the correlation is strongest, and the correlation there, with its sign.
    p_value : float
        Of so strong a correlation at any lag of any of the signals.
    """

    output: str
    signal: str
    lags: Array
    correlation: Array
    band: float
    lag: float
    strength: float
    p_value: float

    @property
    def significant(self) -> bool:
        """Whether it is more than chance among so many."""
        return self.p_value < SIGNIFICANCE

    @property
    def text(self) -> str:
        """It in one line."""
        when = f"{abs(self.lag):.3g} s {'later' if self.lag > 0 else 'earlier'}" if self.lag else "at once"
        what = f"{self.output} goes along with {self.signal}"
        return f"{what}: correlation {self.strength:+.2f} {when} (99 % band ±{self.band:.2f})"


@dataclass(frozen=True)
class Region:
    """A range of a signal, and how large the residual is there.

    Attributes
    ----------
    output, signal : str
    low, high : float
        Ends of the range; infinite where it is open.
    unit : str
        Of the signal.
    samples : int
        Of the residual, in the range.
    rms : float
        Of the residual in the range.
    band : tuple of float
        Where 99 % of such figures lie if the residual is no different there.
    times : float
        That rms over the rms everywhere else.
    p_value : float
        Of so large a residual in any of the ranges of any signal.
    """

    output: str
    signal: str
    low: float
    high: float
    unit: str
    samples: int
    rms: float
    band: tuple[float, float]
    times: float
    p_value: float

    @property
    def significant(self) -> bool:
        """Whether the residual is larger there than by chance among so many ranges."""
        return self.p_value < SIGNIFICANCE

    @property
    def text(self) -> str:
        """It in one line."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        low, high = (f"{end:.3g}{unit}" for end in (self.low, self.high))
        where = f"is above {low}" if np.isinf(self.high) else f"is below {high}"
        if np.isfinite([self.low, self.high]).all():
            where = f"is between {low} and {high}"
        return f"{self.output} is {self.times:.1f}× worse where {self.signal} {where}"


@dataclass(frozen=True)
class Shown:
    """What the residual of one output is like.

    Attributes
    ----------
    associations : list of Association
        The strongest first.
    regions : list of Region
        The most telling first.
    slow : Slow
    """

    associations: list[Association]
    regions: list[Region]
    slow: Slow


def show(evidence: Evidence, data: Data) -> dict[str, Shown]:
    """Look at what a fitted model leaves of a record, by output.

    Parameters
    ----------
    evidence : Evidence
    data : Data
        What it was fitted to.
    """
    signals, step = of_model(evidence, data), float(np.median(np.diff(data.time)))
    shown = {}
    for output, residual in evidence.fitted.residual.items():
        present = evidence.problem.present[output]
        noise = evidence.fitted.noise[output]
        shown[output] = Shown(
            associations(output, residual, present, noise, signals, step),
            regions(output, residual, present, signals),
            slow(residual),
        )
    return shown


def of_model(evidence: Evidence, data: Data) -> list[Explaining]:
    """Signals of a fitted model over a record: its inputs, its states and how fast its outputs move."""
    layout = evidence.candidate.cls.layout
    run = evidence.problem.model.run(data.time, data.inputs, evidence.problem.start | evidence.fitted.values).signals
    states, outputs = ({v.name: run[v.name] for v in group} for group in (layout.states, layout.outputs))
    units = {v.name: v.unit for v in (*layout.inputs, *layout.states, *layout.outputs)}
    return explaining(data.time, data.inputs, states, outputs, units)


def explaining(
    time: Array, inputs: Mapping[str, Array], states: Mapping[str, Array], outputs: Mapping[str, Array],
    units: Mapping[str, str],
) -> list[Explaining]:  # fmt: skip
    """Gather what a residual may go along with.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    inputs, states, outputs : Mapping of str to ndarray, shape (n,)
        Of the model, not measured: what a sensor adds to an output would go along with its own residual.
    units : Mapping of str to str
        Of all of them.

    Returns
    -------
    list of Explaining
        Inputs, the size of what has gone through them, states, their squares and rates, the size of the rates of
        outputs, and time; without those that do not vary.
    """
    found = []
    for name, values in inputs.items():
        through = np.concatenate([[0.0], np.cumsum(np.abs(values[:-1]) * np.diff(time))])
        found += [
            Explaining(name, values, units[name]),
            Explaining(f"throughput of {name}", through, _times(units[name], "s")),
        ]
    for name, values in states.items():
        found += [
            Explaining(name, values, units[name]),
            Explaining(f"square of {name}", values**2, "" if units[name] == "1" else f"{units[name]}²"),
            Explaining(f"rate of {name}", np.gradient(values, time), _times(units[name], "1/s")),
        ]
    for name, values in outputs.items():
        speed = np.abs(np.gradient(values, time))
        found.append(Explaining(f"speed of {name}", speed, _times(units[name], "1/s")))
    found.append(Explaining("time", time, "s"))
    return [s for s in found if np.ptp(s.values) > _STILL * np.max(np.abs(s.values))]


def _times(unit: str, by: str) -> str:
    plain = "" if unit == "1" else unit
    if by == "1/s":
        return f"{plain}/s" if plain else by
    return f"{plain}·{by}".removeprefix("·")


def associations(
    output: str, residual: Array, present: NDArray[np.bool_], noise: Noise, signals: Sequence[Explaining],
    step: float, lags: int = LAGS,
) -> list[Association]:  # fmt: skip
    """Correlate the innovations of an output with signals.

    Parameters
    ----------
    output : str
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
        Where there is one.
    noise : Noise
        Of the residual.
    signals : sequence of Explaining
    step : float
        Seconds between samples.
    lags : int
        Samples that are looked at, either way.

    Returns
    -------
    list of Association
        The strongest first.
    """
    n, kept = present.size, noise.kept(present)
    reach = min(lags, n // 20)
    if kept.size < _FEWEST or reach < 1:
        return []
    everywhere = np.ones(n, dtype=bool)
    innovation, seen = np.zeros(n), np.zeros(n)
    innovation[kept], seen[kept] = noise.whiten(residual, present), 1.0
    power = float(innovation @ innovation) / kept.size
    shifts = np.arange(-reach, reach + 1)
    found = []
    for signal in signals:
        white = noise.whiten(signal.values, everywhere)
        white = np.concatenate([np.zeros(noise.memory), white - white.mean()])
        # sums over the samples at which there are both, for every shift
        together = np.array([_overlap(innovation, white, int(k)) for k in shifts])
        energy = np.array([_overlap(seen, white**2, int(k)) for k in shifts])
        pairs = np.maximum(np.array([_overlap(seen, everywhere.astype(float), int(k)) for k in shifts]), 1.0)
        size = np.sqrt(power * energy)
        score = np.divide(together, size, out=np.zeros(size.size), where=size > 0.0)  # normal where there is nothing
        at = int(np.argmax(np.abs(score)))
        p = min(1.0, 2.0 * float(norm.sf(np.abs(score[at]))) * shifts.size * len(signals))
        r, band = np.asarray(score / np.sqrt(pairs)), float(norm.ppf(0.995) / np.sqrt(kept.size))
        found.append(
            Association(
                output,
                signal.name,
                np.asarray(shifts * step, dtype=np.float64),
                r,
                band,
                float(shifts[at] * step),
                float(r[at]),
                p,
            )
        )
    return sorted(found, key=lambda a: -abs(a.strength))


def _overlap(residual: Array, signal: Array, shift: int) -> float:
    """Sum of ``residual[k] * signal[k - shift]``."""
    n = residual.size
    return float(residual[max(shift, 0) : n + min(shift, 0)] @ signal[max(-shift, 0) : n - max(shift, 0)])


@dataclass(frozen=True)
class Explained:
    """What all signals together explain of a residual.

    Attributes
    ----------
    rms : float
        Of what they take off the residual, in its unit.
    p_value : float
        Of so much in a residual that has nothing to do with them.
    path : ndarray, shape (n,)
        What they explain, at every sample of the record.
    """

    rms: float
    p_value: float
    path: Array

    @property
    def significant(self) -> bool:
        """Whether it is more than chance."""
        return self.p_value < SIGNIFICANCE


def explained(residual: Array, present: NDArray[np.bool_], signals: Sequence[Explaining]) -> Explained:
    """Regress a residual on signals, their squares and cubes.

    Both are whitened by the colour of what the regression leaves: estimated from the residual itself the colour would
    swallow what there is to explain. A regression takes some of slow noise with it, so how much it explains of noise
    is seen on noise of the colour of the residual, drawn some times.

    Parameters
    ----------
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
    signals : sequence of Explaining

    Returns
    -------
    Explained
    """
    columns = _powers([s.values for s in signals])
    n = residual.size
    if n < 5 * columns.shape[1] or not np.any(residual):
        return Explained(0.0, 1.0, np.zeros(present.size))
    rows = columns[present]
    score, weights = _regressed(residual, rows, present)
    noise, random = estimate(residual, present), np.random.default_rng(0)
    drawn = []
    for _ in range(max(_FEW_DRAWS, min(_DRAWS, _EFFORT // n))):
        white = random.standard_normal(n + _LEAD)
        drawn.append(_regressed(lfilter([1.0], [1.0, *-noise.coefficients], white)[_LEAD:], rows, present)[0])
    surprise = (score - float(np.mean(drawn))) / float(np.std(drawn, ddof=1))
    path = columns @ weights
    # a regression of innovations may follow every move and yet be far from the level
    taken = float(np.mean(residual**2) - np.mean((residual - path[present]) ** 2))
    return Explained(float(np.sqrt(max(taken, 0.0))), float(t.sf(surprise, len(drawn) - 1)), path)


def _regressed(residual: Array, rows: Array, present: NDArray[np.bool_]) -> tuple[float, Array]:
    """Logarithm of how much more of the innovations' power a regression explains than it leaves, and its weights."""
    weights = np.zeros(rows.shape[1])
    for _ in range(_COLOURED):
        noise = estimate(residual - rows @ weights, present)
        white, left = noise.whiten(rows, present), noise.whiten(residual, present)
        values, directions = np.linalg.eigh(white.T @ white)
        seen = values > _FLAT * values[-1]
        inverse = (directions[:, seen] / values[seen]) @ directions[:, seen].T
        weights = inverse @ (white.T @ left)
    whole, rest = float(left @ left), float(((left - white @ weights) ** 2).sum())
    return float(np.log(max(whole - rest, 1e-300) / max(rest, 1e-300))), weights


def _powers(signals: Sequence[Array]) -> Array:
    """A constant, and signals of unit size to the powers one to three."""
    columns = [np.ones_like(signals[0])] if signals else []
    for values in signals:
        centred = (values - values.mean()) / values.std()
        columns += [centred, centred**2, centred**3]
    return np.column_stack(columns) if columns else np.empty((0, 0))


def regions(
    output: str, residual: Array, present: NDArray[np.bool_], signals: Sequence[Explaining], bins: int = BINS
) -> list[Region]:
    """Compare the residual in ranges of every signal, of equally many samples each, with the rest of the record.

    A coloured residual tells less than as many independent samples would: its square is correlated by the square of
    its own correlation, and counts for so many fewer.

    Parameters
    ----------
    output : str
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
    signals : sequence of Explaining
        Squares are passed over: what they would tell, the signals tell.
    bins : int

    Returns
    -------
    list of Region
        The most telling first.
    """
    if residual.size < 2 * _FEWEST:
        return []
    wanted = [s for s in signals if not s.name.startswith("square of ")]
    square, worth = residual**2, 1.0 / _repetition(residual)
    total, n = float(square.sum()), residual.size
    ranges = [(s, *part) for s in wanted for part in _ranges(s.values[present], bins)]
    found: list[tuple[float, Region]] = []
    for signal, low, high, inside in ranges:
        count = int(inside.sum())
        if not _FEWEST <= count <= n - _FEWEST:
            continue
        within = float(square[inside].sum())
        rest = (total - within) / (n - count)
        if not rest > 0.0:
            continue
        ratio = within / count / rest
        freedom = max(count * worth, 1.0), max((n - count) * worth, 1.0)
        surprise = float(f.logsf(ratio, *freedom)) + float(np.log(len(ranges)))
        ends = np.sqrt(rest * f.ppf([0.005, 0.995], *freedom))
        p = min(1.0, float(np.exp(surprise)))
        rms, band = float(np.sqrt(within / count)), (float(ends[0]), float(ends[1]))
        times = float(np.sqrt(ratio))
        found.append(
            (surprise, Region(output, signal.name, low, high, signal.unit, count, rms, band, times, p))
        )  # fmt: skip
    return [region for _, region in sorted(found, key=lambda pair: (pair[0], -pair[1].times))]


def told(found: Sequence[Region]) -> list[str]:
    """Lines for people: of every signal the region that tells most, if it is more than chance."""
    first: dict[str, Region] = {}
    for region in found:
        if region.significant:
            first.setdefault(region.signal, region)
    return [region.text for region in first.values()]


def _ranges(values: Array, bins: int) -> list[tuple[float, float, NDArray[np.bool_]]]:
    """Ends of ranges that hold about equally many of the values, and which values lie in each."""
    inner = np.unique(np.quantile(values, np.linspace(0.0, 1.0, bins + 1)[1:-1]))
    inner = inner[inner > values.min()]
    which = np.searchsorted(inner, values, side="right")
    ends = np.concatenate([[-np.inf], inner, [np.inf]])
    return [(float(ends[k]), float(ends[k + 1]), which == k) for k in range(ends.size - 1)]


def _repetition(residual: Array) -> float:
    """How many samples say as much about the size of a residual as an independent one would."""
    centred, n = residual - residual.mean(), residual.size
    power = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: n // 4]
    if not correlation[0] > 0.0:
        return 1.0
    correlation /= correlation[0]
    faded = np.flatnonzero(np.abs(correlation) < 2.0 / np.sqrt(n))
    reach = int(faded[0]) if faded.size else correlation.size
    return 1.0 + 2.0 * float((correlation[1:reach] ** 2).sum())
