"""Data that no fit has seen: what a model says of them is what it is worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.selection.search import Data, Evidence
from orchestration.identify.levenberg_marquardt import minimise
from orchestration.identify.metrics import normalised_rms
from orchestration.identify.noise import Noise
from orchestration.identify.problem import Problem
from orchestration.records.clock import evenly_sampled

Array = NDArray[np.float64]
HELD_OUT = 1.0 / 3.0  # of a record, its end
_RIDGE = 1e-9  # relative, to what is known of a parameter
_RUN_IN = 1.0 / 6.0  # of a record of its own: there the states at its start are estimated, and nothing is judged


@dataclass(frozen=True)
class Prediction:
    """What a fitted model says of unseen data.

    Attributes
    ----------
    evidence : Evidence
    simulated : dict of str to ndarray, shape (n,)
        Outputs over the whole of the data, SI.
    slopes : dict of str to ndarray, shape (n, p)
        Their derivatives by the searched coordinates.
    errors : dict of str to float
        Normalised RMS error of every output, where nothing was fitted.
    """

    evidence: Evidence
    simulated: dict[str, Array]
    slopes: dict[str, Array]
    errors: dict[str, float]


@dataclass(frozen=True)
class Unseen:
    """The part of a record that is judged, and what a simulation of it begins with.

    Attributes
    ----------
    data : Data
        Simulated from its first sample on.
    first : int
        The sample from which on nothing was fitted to.
    continued : bool
        Whether it continues the record that was fitted to, or is one of its own, whose starting states are estimated on
        the samples before ``first``.
    """

    data: Data
    first: int
    continued: bool

    @classmethod
    def part_of(cls, data: Data) -> tuple[Data, Unseen]:
        """Divide a record into what is fitted to and what is held out.

        That is its end, or where it is sampled unevenly, and no stretch of it is like another, every third sample.
        """
        if evenly_sampled(data.time):
            unseen = cls.end_of(data)
            return data.part(0, unseen.first), unseen
        out = np.arange(len(data.time)) % round(1.0 / HELD_OUT) == 1
        fitted, judged = ({o: np.where(which, y, np.nan) for o, y in data.measured.items()} for which in (~out, out))
        return replace(data, measured=fitted), cls(replace(data, measured=judged), 0, True)

    @classmethod
    def end_of(cls, data: Data) -> Unseen:
        """Hold out the end of a record, as far as every output was measured."""
        last = min(int(np.flatnonzero(np.isfinite(y))[-1]) for y in data.measured.values())
        return cls(data, round((last + 1) * (1.0 - HELD_OUT)), True)

    @classmethod
    def another(cls, data: Data) -> Unseen:
        """Hold out a record of its own."""
        return cls(data, round(len(data.time) * _RUN_IN), False)

    def values(self, evidence: Evidence) -> dict[str, float]:
        """Parameters with which a fitted model is simulated here, start values included, SI."""
        values = evidence.problem.start | evidence.fitted.values
        if self.continued:
            return values
        layout, before = evidence.candidate.cls.layout, self.data.part(0, self.first)
        starts = [f"{state.name}_start" for state in layout.states]
        if not starts:
            return values
        problem = Problem(
            evidence.candidate.cls, before.time, before.inputs, before.measured, starts, values, before.linear
        )
        low, high = problem.bounds()

        def weighed(which: int, q: Array) -> Array:
            parts = problem.evaluate(q)[which]
            return np.concatenate([parts[o] / evidence.fitted.noise[o].deviation for o in parts])

        q = minimise(lambda q: weighed(0, q), lambda q: weighed(1, q), problem.position(problem.start), low, high)
        return values | problem.values(q)

    def simulated(self, evidence: Evidence) -> dict[str, Array]:
        """Outputs of a fitted model over the whole of the data, SI."""
        return self.predicted(evidence).simulated

    def predicted(self, evidence: Evidence) -> Prediction:
        """Simulate a fitted model."""
        problem = evidence.problem
        ran = problem.model.run(self.data.time, self.data.inputs, self.values(evidence))
        by = np.array([scale.slope(q) for scale, q in zip(problem.scales, evidence.fitted.q, strict=True)])
        signals = {o: ran.signals[o] for o in self.data.measured}
        return Prediction(evidence, signals, {o: ran.sensitivities[o] * by for o in signals}, self.errors(signals))

    def errors(self, simulated: Mapping[str, Array]) -> dict[str, float]:
        """Normalised RMS error of every output, where nothing was fitted."""
        return {o: normalised_rms(y[self.first :], simulated[o][self.first :]) for o, y in self.data.measured.items()}

    def misfit(self, prediction: Prediction, noise: Mapping[str, Noise]) -> float:
        """Minus twice the logarithm of how likely a model makes the unseen data, in noise that is given.

        What the fit left open in the parameters is granted: with their covariance P and the derivatives J of the
        innovations r, the innovations have the covariance I + J P J'. In a record of its own nothing is granted to
        where the states start, which was estimated on its first samples.
        """
        evidence, left, slopes = prediction.evidence, [], []
        moved = np.array([self.continued or not name.endswith("_start") for name in evidence.problem.names])
        for output, y in self.data.measured.items():
            present = np.isfinite(y)
            present[: self.first] = False
            left.append(noise[output].whiten((prediction.simulated[output] - y)[present], present))
            slopes.append(noise[output].whiten(prediction.slopes[output][present] * moved, present))
        fitted, problem = evidence.fitted, evidence.problem
        seen = np.vstack([noise[o].whiten(j, problem.present[o]) for o, j in problem.evaluate(fitted.q)[1].items()])
        r, j = np.concatenate(left), np.concatenate(slopes)
        return float(r @ r) - _granted(seen.T @ seen + np.diag(fitted.belief), j.T @ j, j.T @ r)


def _granted(information: Array, more: Array, pull: Array) -> float:
    """How much less the deviance is because parameters are uncertain: less misfit, more spread."""
    scale = np.sqrt(np.diag(information + more))
    seen = scale > 0.0
    outer = np.outer(scale[seen], scale[seen])
    ridge = _RIDGE * np.eye(seen.sum())
    before = information[np.ix_(seen, seen)] / outer + ridge
    after = before + more[np.ix_(seen, seen)] / outer
    p = pull[seen] / scale[seen]
    return float(p @ np.linalg.solve(after, p) - np.linalg.slogdet(after)[1] + np.linalg.slogdet(before)[1])
