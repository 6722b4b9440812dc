"""The output-error problem: residuals of a model's free run over a record, with derivatives.

A residual is measured minus simulated (Ljung: System Identification, section 3.2). Parameters that
are positive by nature are searched in their logarithm, others in units of their size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log
from typing import Any

import numpy as np
from scipy.special import ndtri

from fmus.kit import Component, UserError
from fmus.kit.arrays import Array, Interval, Signals
from fmus.kit.interrupt import Interrupt
from fmus.kit.units import format_range
from orchestration.identify.fitting.any_fmu import FmuWithDifferences
from orchestration.identify.fitting.assumptions import NO_ASSUMPTIONS, Assumptions, prior_row
from orchestration.identify.fitting.delay import DelayedModel
from orchestration.identify.fitting.simulation_input import SimulationInput
from orchestration.identify.noise import Noise, estimate_noise, noise_samples
from orchestration.records.sampling import input_steps

Subject = type[Component] | FmuWithDifferences
# Internal steps of a simulation, per sample and in all: beyond both, a search has strayed to
# parameters that make the model stiff.
_STEPS_PER_SAMPLE = 50.0
_STEPS = 3e5
# Times the internal steps of the costliest simulation so far, beyond which, and beyond as many per
# sample as above, a search has strayed, too: in a short record it would cost as much as thousands
# of other simulations.
_STRAYED = 30.0
_EDGE = 1e-3  # of a sample, how close a delay comes to where it would show another sample's input
# searched coordinate from which a search goes on where another took a positive value to zero
_SMALLEST = log(np.finfo(float).tiny)
# of a logarithm, short of where its number is infinite, and products with it too
_HIGHEST = 0.5 * log(np.finfo(float).max)
# distance, in searched coordinates, from the ends of a range at which a search starts
_NUDGE = 0.1


@dataclass(frozen=True)
class Scale:
    """The map between a parameter and its searched coordinate q.

    A parameter that is positive by nature is searched in its logarithm, q = log(value); others in
    units of their size, q = value / size.
    """

    logarithmic: bool
    size: float

    def value(self, q: float) -> float:
        """Return the value at a searched coordinate."""
        with np.errstate(over="ignore"):  # the end of an interval may lie beyond every number
            return float(np.exp(q)) if self.logarithmic else float(q * self.size)

    def position(self, value: float) -> float:
        """Return the searched coordinate of a value."""
        if self.logarithmic:
            return min(log(value), _HIGHEST) if value > 0.0 else -np.inf
        return value / self.size

    def slope(self, q: float) -> float:
        """Return d value / d q."""
        return float(np.exp(q)) if self.logarithmic else self.size


class Problem:
    """A model, a record, and the parameters to search.

    One simulation gives both residuals and derivatives.

    Parameters
    ----------
    cls : type[Component] or FmuWithDifferences
    time : ndarray, shape (n,)
        Seconds.
    inputs, measured : Mapping[str, ndarray]
        Inputs and measured outputs (n,), SI; NaN in an output is a gap.
    names : sequence of str
        Parameters to search, start values of states included.
    fixed : Mapping[str, float]
        Values of others, and starting points of those to search.
    assumptions : Assumptions

    Attributes
    ----------
    declared : dict of str to Declaration
        Declarations of all parameters.
    start : dict of str to float
        Value of every parameter where the search starts.
    measured, present : dict of str to ndarray
        Outputs of which anything was measured, and the samples (n,) that were.
    noise_samples : dict of str to ndarray of bool, shape (m,)
        Measured samples of every output at which noise dominates the error of an incomplete model;
        see `noise_samples`.
    scales : list of Scale
    evaluations : int
        Simulations made.
    held : list of int
        Coordinates that are not searched.
    interrupt : Interrupt
        When it is pressed, a search ends with the best point so far.
    given : dict of str to Noise
        Noise that is not estimated: of outputs by `Assumptions.noise`, and of priors.

    Raises
    ------
    UserError
        If a name is unknown or its parameter is not real, or an assumption cannot be made.
    """

    def __init__(
        self,
        cls: Subject,
        time: Array,
        inputs: Signals,
        measured: Signals,
        names: Sequence[str],
        fixed: Mapping[str, float],
        *,
        assumptions: Assumptions = NO_ASSUMPTIONS,
    ):
        assumptions.check(names, measured)
        self.assumptions = assumptions
        moved = [*names, *assumptions.ties]
        self.model = (
            cls if isinstance(cls, FmuWithDifferences) else DelayedModel(cls, moved, measured)
        )
        self.declared: dict[str, Any] = {p.name: p for p in self.model.layout.parameters}
        for name in moved:
            if self.declared[name].type != "real":
                raise UserError(
                    f"{name} is {self.declared[name].type}; only real parameters can be fitted"
                )
        self.time = time
        self.inputs = inputs
        self.names = list(names)
        self.declared = assumptions.bounded(self.declared)
        defaults = {name: float(p.start) for name, p in self.declared.items()}
        for name, ends in assumptions.bounds.items():
            defaults[name] = float(np.clip(defaults[name], *ends))
        self.start = defaults | dict(fixed)
        self.measured = {output: y for output, y in measured.items() if np.isfinite(y).any()}
        self.present = {output: np.isfinite(y) for output, y in self.measured.items()}
        # indexing with a mask copies; a slice does not
        self._where = {output: slice(None) if p.all() else p for output, p in self.present.items()}
        has_step = input_steps(inputs, len(time))
        self.noise_samples = {
            output: noise_samples(has_step, y)[self.present[output]]
            for output, y in self.measured.items()
        }
        self.scales = [
            scale_of(self.declared[name], self.start[name], assumptions.scales.get(name))
            for name in names
        ]
        self.given = assumptions.given
        self.evaluations = 0
        self._most_steps = 0.0
        self._step = float(np.median(np.diff(time)))
        self.held: list[int] = []
        self.interrupt = Interrupt()
        self._at: tuple[bytes, dict[str, Array], dict[str, Array]] | None = None

    def evaluate(self, q: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return residuals (m,), measured minus simulated, and Jacobians (m, p) by output.

        They are over the samples that were measured.

        Raises
        ------
        UserError
            If the simulation fails there.
        """
        if self._at is None or self._at[0] != q.tobytes():
            self.evaluations += 1
            self._at = None  # frees the memory of the last simulation
            values = self.values(q)
            residual, sensitivities = self.simulate(values)
            slopes = np.array([s.slope(x) for s, x in zip(self.scales, q, strict=True)])
            # taken out one by one, as all at once are much memory for a long record
            jacobian = {output: sensitivities.pop(output) * -slopes for output in residual}
            for name, (mean, deviation) in self.assumptions.priors.items():
                row = prior_row(name)
                residual[row] = np.array([(mean - values[name]) / deviation])
                jacobian[row] = np.where(np.equal(self.names, name), -slopes / deviation, 0.0)[None]
            self._at = (q.tobytes(), residual, jacobian)
        return self._at[1:]

    def simulate(self, values: Mapping[str, float]) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return residuals (m,) at values, and derivatives (m, p) of the simulation by these.

        Raises
        ------
        UserError
            If the simulation fails there.
        """
        ties = self.assumptions.ties
        trajectory = self.model.run(self._input_at(values))
        self._most_steps = max(self._most_steps, trajectory.steps)
        residual = {}
        sensitivities = {}
        for output, y in self.measured.items():
            where = self._where[output]
            residual[output] = (y - trajectory.signals[output])[where]
            by_value = trajectory.sensitivities.pop(output)[where]
            if ties:
                by_value = by_value @ self._chain
            weights = self.assumptions.weights.get(output)
            if weights is not None:
                residual[output] = residual[output] * weights[where]
                by_value = by_value * weights[where][:, np.newaxis]
            sensitivities[output] = by_value
        return residual, sensitivities

    def _input_at(self, values: Mapping[str, float]) -> SimulationInput:
        """Return what a simulation starts from at values of the searched parameters."""
        ties = self.assumptions.ties
        tied = {name: factor * values[source] for name, (factor, source) in ties.items()}
        parameters = {**self.start, **values, **tied}
        linear = self.assumptions.linear
        return SimulationInput(self.time, self.inputs, parameters, self._step_limit, linear)

    @property
    def _chain(self) -> Array:
        """Derivatives (p + t, p) of searched parameters and t tied ones by the searched ones."""
        rows = [*np.eye(len(self.names))]
        for factor, source in self.assumptions.ties.values():
            rows.append(factor * rows[self.names.index(source)])
        return np.array(rows)

    @property
    def _step_limit(self) -> float:
        """Internal steps per sample that the next simulation may take."""
        most = max(_STEPS_PER_SAMPLE, _STEPS / len(self.time))
        if not self._most_steps:
            return most
        usual = _STRAYED * self._most_steps / len(self.time)
        return min(most, max(usual, _STEPS_PER_SAMPLE))

    def noise(self, residual: Signals) -> dict[str, Noise]:
        """Return the noise that is estimated from residuals, (m,) by output."""
        freedom = self.assumptions.freedom
        return {
            output: self.given.get(output)
            or estimate_noise(error, self.noise_samples[output], freedom)
            for output, error in residual.items()
        }

    def deviance(self, noise: Mapping[str, Noise], residual: Signals) -> float:
        """Return minus twice the log likelihood of residuals, (m,) by output, in noise."""
        return sum(
            model.deviance(residual[output] / model.deviation) for output, model in noise.items()
        )

    @property
    def samples(self) -> int:
        """The number of measured values."""
        return sum(int(p.sum()) for p in self.present.values())

    def values(self, q: Array) -> dict[str, float]:
        """Return the parameters by name at searched coordinates.

        They are clipped to their ranges, which the rounding of a logarithm may leave.
        """
        values = {}
        for name, scale, x in zip(self.names, self.scales, q, strict=True):
            declared = self.declared[name]
            values[name] = min(max(scale.value(x), declared.min), declared.max)
        return values

    def intervals(self, q: Array, standard_errors: Array) -> dict[str, Interval]:
        """Return 95 % confidence intervals by name; infinite where a standard error is."""
        half = float(ndtri(0.975)) * standard_errors
        ends = zip(self.names, self.scales, q - half, q + half, strict=True)
        return {name: (scale.value(low), scale.value(high)) for name, scale, low, high in ends}

    def position(self, values: Mapping[str, float]) -> Array:
        """Return the searched coordinates (p,) of values by name.

        They are finite: a search may have taken a positive value to zero, and no other one begins
        at minus infinity.
        """
        coordinates = [
            scale.position(values[name])
            for name, scale in zip(self.names, self.scales, strict=True)
        ]
        return np.where(np.isneginf(coordinates), _SMALLEST, coordinates)

    def bounds(self) -> tuple[Array, Array]:
        """Return both ends of the ranges in searched coordinates, each of shape (p,)."""
        ends = []
        for name, scale in zip(self.names, self.scales, strict=True):
            declared = self.declared[name]
            ends.append((scale.position(declared.min), scale.position(declared.max)))
        low, high = np.array(ends, dtype=float).reshape(-1, 2).T
        return low, high

    def smooth_bounds(self, q: Array) -> tuple[Array, Array]:
        """Return bounds about a point, (p,) each, within which the residuals are smooth.

        With a delay they jump at every sample.
        """
        low, high = self.bounds()
        for i, samples in self._delays(q):
            ends = np.floor(samples) + np.array([_EDGE, 1.0 - _EDGE])
            low[i], high[i] = np.clip(
                [self._delay_position(i, end) for end in ends], low[i], high[i]
            )
        low[self.held] = q[self.held]
        high[self.held] = q[self.held]
        return low, high

    def other_delays(self, q: Array) -> Iterator[Array]:
        """Yield points with other delays, which may fit better than where a search has ended.

        First those at which each output, simulated once without a delay, follows the record best;
        then the next samples.
        """
        costs = self.delay_costs(self.values(q)) if self._delays(q) else {}
        best = q.copy()
        for i, samples in self._delays(q):
            squares = costs.get(self.names[i], np.zeros(0))
            cell = int(np.argmin(squares)) if squares.size else int(samples)
            if cell != int(samples):
                best[i] = self._delay_position(i, cell + 0.5)
        across = self.across_sample(q)
        for other in (np.clip(best, *self.bounds()), across):
            if other is not None and not np.array_equal(other, q):
                yield other

    def delay_costs(self, values: Mapping[str, float]) -> dict[str, Array]:
        """Return the squared error (k,) of each output by the name of its delay.

        At delays of 0.5, 1.5 ... samples, to the longest that is allowed. A delay moves its own
        output only, so that one simulation is enough for all.
        """
        given = self._input_at(values)
        none = dict.fromkeys(self.model.delays.values(), 0.0)
        undelayed = replace(given, parameters={**given.parameters, **none})
        simulated = self.model.run(undelayed).signals
        costs = {}
        for output, name in self.model.delays.items():
            if output not in self.measured:
                continue
            longest = min(self.declared[name].max, np.ptp(self.time)) / self._step
            delays = self._step * (np.arange(max(1, int(longest))) + 0.5)
            late = (np.interp(self.time - d, self.time, simulated[output]) for d in delays)
            y = self.measured[output]
            costs[name] = np.array([np.nansum((y - one) ** 2) for one in late])
        return costs

    def across_sample(self, q: Array) -> Array | None:
        """Return a point with delays moved past the whole number of samples that they end at.

        None if no delay is at one. A search that ended at its `smooth_bounds` continues from there.
        """
        other = q.copy()
        for i, samples in self._delays(q):
            nearest = round(samples)
            if nearest > 0 and abs(samples - nearest) < 2.0 * _EDGE:
                beyond = nearest + (_NUDGE if samples < nearest else -_NUDGE)
                other[i] = self._delay_position(i, beyond)
        return None if np.array_equal(other, q) else np.clip(other, *self.bounds())

    def _delays(self, q: Array) -> list[tuple[int, float]]:
        """Return the coordinates that are delays, and the length of each delay in samples."""
        delays = []
        for i, name in enumerate(self.names):
            if name in self.model.delays.values() and i not in self.held:
                delays.append((i, self.scales[i].value(q[i]) / self._step))
        return delays

    def _delay_position(self, i: int, samples: float) -> float:
        """Return the value of searched coordinate `i`, a delay, for a length in samples."""
        return self.scales[i].position(samples * self._step)

    def inside(self, q: Array) -> Array:
        """Move a starting point off the ends of the ranges, where steps would be very small."""
        low, high = self.bounds()
        nudge = np.minimum(_NUDGE, _NUDGE * (high - low))
        return np.clip(q, low + nudge, high - nudge)


def scale_of(declaration: Any, value: float, wanted: str | None = None) -> Scale:
    """Choose the scale in which a parameter is searched that starts from a value.

    Raises
    ------
    UserError
        If a logarithm is wanted of a parameter that may be zero or below.
    """
    positive = declaration.min >= 0.0 and value > 0.0
    if wanted == "logarithmic" and not positive:
        raise UserError(
            f"scale {declaration.name}: a logarithm needs a start above zero and a range from zero"
            f" on; it starts at {value:g}, with {format_range(declaration)}"
        )
    positive = positive and wanted != "linear"
    if declaration.starts:
        # the start value of a state may be small by chance
        return Scale(positive, max(abs(value), declaration.nominal))
    return Scale(positive, abs(value) or declaration.nominal)
