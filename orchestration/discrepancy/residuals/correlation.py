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
from scipy.stats import norm

from orchestration.discrepancy.residuals.operating_regions import FEWEST, SIGNIFICANCE, Region, regions
from orchestration.discrepancy.residuals.random_walk import Slow, slow
from orchestration.identify.noise import Noise

if TYPE_CHECKING:
    from orchestration.discrepancy.selection.search import Data, Evidence

Array = NDArray[np.float64]
LAGS = 25  # samples, either way
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
    if kept.size < FEWEST or reach < 1:
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
