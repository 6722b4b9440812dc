"""The output-error problem: residuals of a model's free run over a record, with derivatives.

A residual is measured minus simulated (Ljung: System Identification, section 3.2). Parameters that
are positive by nature are searched in their logarithm, others in units of their size.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtri

from fmus.kit import Component, UserError
from fmus.kit.arrays import Array
from fmus.kit.record import Trajectory
from orchestration.identify.fitting.any_fmu import FmuWithDifferences
from orchestration.identify.fitting.delay import DelayedModel
from orchestration.identify.fitting.least_squares import SearchEndedError
from orchestration.identify.fitting.simulation_input import SimulationInput
from orchestration.identify.noise import ORDER, Noise, estimate_noise, noise_samples
from orchestration.records.runs import MeasuredRun, base_name, join_records, sampled_alike
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
_PATIENCE = 10.0  # times as many in a single simulation, which is no step of a search
_EDGE = 1e-3  # of a sample, how close a delay comes to where it would show another sample's input
# searched coordinate from which a search goes on where another took a positive value to zero
_SMALLEST = float(np.log(np.finfo(float).tiny))
# of a logarithm, short of where its number is infinite, and products with it too
_HIGHEST = 0.5 * float(np.log(np.finfo(float).max))
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
            return min(float(np.log(value)), _HIGHEST) if value > 0.0 else -np.inf
        return value / self.size

    def slope(self, q: float) -> float:
        """Return d value / d q."""
        return float(np.exp(q)) if self.logarithmic else self.size


def usual_effort(samples: int) -> float:
    """Return the internal steps per sample that a simulation of `samples` samples may take."""
    return max(_STEPS_PER_SAMPLE, _STEPS / samples)


class ModelOverRuns:
    """A model that starts anew in every run of a record, with the values of that run.

    Parameters
    ----------
    cls : type[Component] or FmuWithDifferences
        A component is compiled; an FMU has its derivatives by these names.
    names : sequence of str
        Parameters by which derivatives are taken, those of single runs among them.
    linear : bool or collection of str
        Inputs that are smooth (`smooth_inputs`), all or those named; others are held until the next
        sample.
    runs : sequence of MeasuredRun
        Runs of the record. A stimulus without runs is simulated as the first of them.
    measured : collection of str, optional
        Outputs and states of which a long simulation has derivatives; all unless given.

    Attributes
    ----------
    layout : Layout
    delays : dict of str to str
        Names of the delays of measurements by output.
    """

    def __init__(
        self,
        cls: Subject,
        names: Sequence[str],
        linear: bool | Collection[str],
        runs: Sequence[MeasuredRun],
        measured: Collection[str] | None = None,
    ):
        self._names = list(names)
        self._runs = tuple(runs)
        self._plain = list(dict.fromkeys(map(base_name, names)))
        self._model = (
            cls
            if isinstance(cls, FmuWithDifferences)
            else DelayedModel(cls, self._plain, linear, measured)
        )
        self.layout = self._model.layout
        self.delays = self._model.delays
        self.fitted_tolerance = 0.0

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        parameters: Mapping[str, float],
        effort: float | None = None,
        runs: Sequence[MeasuredRun] = (),
        tolerance: float = 0.0,
    ) -> Trajectory:
        """Simulate one run after the other.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        inputs : Mapping of str to ndarray, shape (n,)
            SI.
        parameters : Mapping of str to float
            SI, by names of all runs and of single ones.
        effort : float, optional
            Internal steps per sample, beyond which the model has become too stiff; several times as
            many as in a fit unless given.
        runs : sequence of MeasuredRun
            They may be others than those that were fitted, whose own values then have no effect.
        tolerance : float
            Accuracy of an internal step, if the model's own need not be reached.

        Returns
        -------
        Trajectory
            Between two runs it has the first values of the second one, and derivatives of zero.

        Raises
        ------
        UserError
            If the simulation fails.
        """
        n = len(time)
        most = _PATIENCE * usual_effort(n) if effort is None else effort
        given = SimulationInput(time, inputs, parameters, most, tolerance)
        chosen = runs or [MeasuredRun(self._runs[0].label, 0, n)]
        done = [self._simulated(given, run) for run in chosen]
        if len(chosen) == 1 and chosen[0].last - chosen[0].first == n:
            return done[0]
        signals = {
            name: join_records(n, chosen, [trajectory.signals[name] for trajectory in done])
            for name in done[0].signals
        }
        slopes = {}
        for name in done[0].sensitivities:
            slopes[name] = np.zeros((n, len(self._names)))
            for run, trajectory in zip(chosen, done, strict=True):
                slopes[name][run.samples] = trajectory.sensitivities[name]
        return Trajectory(signals, slopes, sum(trajectory.steps for trajectory in done))

    def _simulated(self, whole: SimulationInput, run: MeasuredRun) -> Trajectory:
        """Simulate one run; if that fails, with the tolerance of the fit where that is larger."""
        given = whole.over(run.samples)
        given = replace(given, time=given.time - run.ahead, parameters=run.values(whole.parameters))
        try:
            ran = self._model.run(given)
        except UserError as failure:
            if not given.tolerance < self.fitted_tolerance:
                raise
            try:
                ran = self._model.run(replace(given, tolerance=self.fitted_tolerance))
            except UserError:
                raise failure from None
        return self._with_all_slopes(run, ran)

    def _with_all_slopes(self, run: MeasuredRun, trajectory: Trajectory) -> Trajectory:
        """Return the simulation of one run with derivatives by the parameters of all runs."""
        if self._names == self._plain:
            return trajectory
        columns = [self._plain.index(base_name(name)) for name in self._names]
        has_effect = [self._has_effect(name, run) for name in self._names]
        slopes = {name: s[:, columns] * has_effect for name, s in trajectory.sensitivities.items()}
        return replace(trajectory, sensitivities=slopes)

    def _has_effect(self, name: str, run: MeasuredRun) -> bool:
        """Return whether a parameter has an effect in a run.

        A run's own value acts there in place of the common one, and in no other run.
        """
        common = base_name(name)
        own = run.own(common)
        return name == (own if own in self._names else common)


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
        Parameters to search, start values of states included; one that is a run's own has its label
        in its name.
    fixed : Mapping[str, float]
        Values of others, and starting points of those to search.
    linear : bool or collection of str
        Inputs that are smooth (`smooth_inputs`), all or those named; others are held until the next
        sample.
    order : int
        Highest order of the autoregression that the noise of an output may be; 0 for white noise.
    runs : sequence of MeasuredRun
        Runs of the record, with gaps in all outputs between them; by default a single one without a
        label.

    Attributes
    ----------
    declared : dict of str to Declaration
        Declarations of all parameters, and of the searched ones by their names.
    start : dict of str to float
        Value of every parameter where the search starts.
    measured, present : dict of str to ndarray
        Outputs of which anything was measured, and the samples (n,) that were.
    noise_samples : dict of str to ndarray of bool, shape (m,)
        Measured samples of every output at which noise dominates the error of an incomplete model;
        see `noise_samples`.
    even : bool
        True if samples are equally spaced.
    order : int
        As given; 0 where samples are not equally spaced, because an autoregression is over equal
        steps.
    scales : list of Scale
    evaluations : int
        Simulations made.
    effort : float
        Internal steps per sample, on average, beyond which a simulation is abandoned.
    out_of_time : callable
        Returns whether there is no time left to search on; False, unless replaced.
    freedom : Mapping of str to float
        Degrees of freedom of the noise of outputs, where they are to be the same for all models, so
        that likelihoods are comparable.
    colour : Mapping of str to ndarray
        Coefficients of the noise's autoregression, likewise.
    held : list of int
        Coordinates that are not searched.
    smallest, largest : Mapping of str to float
        Values of parameters, SI, beyond which they are not searched though they are declared wider.
    tolerance : float
        Accuracy of an internal step of simulations, if the model's own need not be reached.
    error_scales : dict of str to float
        Of outputs, once they are known; see `simulation_error.error_scales`.
    least : dict of str to float
        Values of searched parameters, SI, below which a search steps back, as a simulation there
        would take long and tell nothing.

    Raises
    ------
    UserError
        If a name is unknown or its parameter is not real.
    """

    def __init__(
        self,
        cls: Subject,
        time: Array,
        inputs: Mapping[str, Array],
        measured: Mapping[str, Array],
        names: Sequence[str],
        fixed: Mapping[str, float],
        *,
        linear: bool | Collection[str] = False,
        order: int = ORDER,
        runs: Sequence[MeasuredRun] = (),
    ):
        self.runs = tuple(runs) or (MeasuredRun("", 0, len(time)),)
        self.model = ModelOverRuns(cls, names, linear, self.runs, measured)
        self.declared: dict[str, Any] = {p.name: p for p in self.model.layout.parameters}
        self.declared |= {name: self.declared[base_name(name)] for name in names}
        for name in names:
            if self.declared[name].type != "real":
                raise UserError(
                    f"{name} is {self.declared[name].type}; only real parameters can be fitted"
                )
        self.time = time
        self.inputs = inputs
        self.names = list(names)
        self.even = sampled_alike(time, self.runs)
        self.order = order if self.even else 0
        self.start = {name: float(p.start) for name, p in self.declared.items()} | dict(fixed)
        self.start |= {name: self.start[base_name(name)] for name in names if name not in fixed}
        self.measured = {output: y for output, y in measured.items() if np.isfinite(y).any()}
        self.present = {output: np.isfinite(y) for output, y in self.measured.items()}
        # indexing with a mask copies; a slice does not
        self._where = {output: slice(None) if p.all() else p for output, p in self.present.items()}
        has_step = input_steps(inputs, len(time))
        self.noise_samples = {
            output: noise_samples(has_step, y)[self.present[output]]
            for output, y in self.measured.items()
        }
        self.scales = [scale_of(self.declared[name], self.start[name]) for name in names]
        self.evaluations = 0
        self.effort = usual_effort(len(time))
        self._most_steps = 0.0
        self._step = float(np.median(np.diff(time)))
        self.out_of_time: Callable[[], bool] = lambda: False
        self.freedom: Mapping[str, float] = {}
        self.colour: Mapping[str, Array] = {}
        self.held: list[int] = []
        self.smallest: Mapping[str, float] = {}
        self.largest: Mapping[str, float] = {}
        self.tolerance = 0.0
        self.error_scales: dict[str, float] = {}
        self.least: dict[str, float] = {}
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
            self.forget_simulation()
            values = self.start | self.values(q)
            self._check_least(values)
            trajectory = self.model.run(
                self.time, self.inputs, values, self._step_limit, self.runs, self.tolerance
            )
            self._most_steps = max(self._most_steps, trajectory.steps)
            slopes = np.array([s.slope(x) for s, x in zip(self.scales, q, strict=True)])
            residual = {}
            jacobian = {}
            for output, y in self.measured.items():
                where = self._where[output]
                residual[output] = (y - trajectory.signals[output])[where]
                # taken out, as both at once are much memory for a long record
                jacobian[output] = trajectory.sensitivities.pop(output)[where] * -slopes
            self._at = (q.tobytes(), residual, jacobian)
        return self._at[1:]

    @property
    def _step_limit(self) -> float:
        """Internal steps per sample that the next simulation may take."""
        if not self._most_steps:
            return self.effort
        usual = _STRAYED * self._most_steps / len(self.time)
        return min(self.effort, max(usual, _STEPS_PER_SAMPLE))

    def _check_least(self, values: Mapping[str, float]) -> None:
        """Refuse values below those in `least`."""
        for name, least in self.least.items():
            if values[name] < least:
                raise UserError(f"{name} is less than {least:g}, below which it tells nothing")

    def time_limited(self, residual: Callable[[Array], Array]) -> Callable[[Array], Array]:
        """Return residuals that end a search when time is up, but never at its first point.

        The search then ends at its best point.
        """
        begun = False

        def limited(q: Array) -> Array:
            nonlocal begun
            if begun and self.out_of_time():
                raise SearchEndedError("there is no time left to search on")
            begun = True
            return residual(q)

        return limited

    def noise(self, residual: Mapping[str, Array]) -> dict[str, Noise]:
        """Return the noise that is estimated from residuals, (m,) by output."""
        return {
            output: estimate_noise(
                e,
                self.present[output],
                self.order,
                self.noise_samples[output],
                self.freedom.get(output),
                self.colour.get(output),
            )
            for output, e in residual.items()
        }

    def deviance(self, noise: Mapping[str, Noise], residual: Mapping[str, Array]) -> float:
        """Return minus twice the log likelihood of residuals, (m,) by output, in noise."""
        present = self.present
        return sum(
            model.deviance(model.whiten(residual[output], present[output]), present[output])
            for output, model in noise.items()
        )

    def forget_simulation(self) -> None:
        """Free the memory of the last simulation."""
        self._at = None

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

    def intervals(self, q: Array, standard_errors: Array) -> dict[str, tuple[float, float]]:
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
            smallest = max(declared.min, self.smallest.get(name, -np.inf))
            largest = min(declared.max, self.largest.get(name, np.inf))
            ends.append((scale.position(smallest), scale.position(largest)))
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
            if base_name(name) in self.model.delays.values() and i not in self.held:
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


def scale_of(declaration: Any, value: float) -> Scale:
    """Choose the scale in which a parameter is searched that starts from a value."""
    positive = declaration.min >= 0.0 and value > 0.0
    if declaration.starts:
        # the start value of a state may be small by chance
        return Scale(positive, max(abs(value), declaration.nominal))
    return Scale(positive, abs(value) or declaration.nominal)
