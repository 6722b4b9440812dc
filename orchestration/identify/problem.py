"""Output-error problem: residuals of a component's free run over a record, with exact derivatives.

A residual is measured minus simulated (Ljung: System Identification, section 3.2). Parameters that are positive by
nature are searched in their logarithm, others in units of their size.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from fmus.kit import Component
from fmus.kit.errors import UserError
from fmus.kit.record.compiled import Trajectory
from orchestration.identify.any_fmu import FmuWithDifferences
from orchestration.identify.delay import DelayedModel
from orchestration.identify.least_squares import SearchEndedError
from orchestration.identify.noise.autoregression import ORDER
from orchestration.identify.noise.model import Noise, calm, estimate
from orchestration.records.input_steps import input_steps
from orchestration.records.joined import Run, base_name, joined, sampled_alike

Array = NDArray[np.float64]
Subject = type[Component] | FmuWithDifferences
# Internal steps, per sample and in all: beyond both, a search has strayed to parameters that make the model stiff.
_EFFORT, _EFFORTS = 50.0, 3e5
_EDGE = 1e-3  # of a sample, how close a delay comes to where it would show another sample's input
_SMALLEST = float(
    np.log(np.finfo(float).tiny)
)  # where a search goes on from a value that another took to zero
_NUDGE = (
    0.1  # a search that starts at an end of a range starts this far inside, in searched coordinates
)


@dataclass(frozen=True)
class Scale:
    """How a parameter is searched: q = log(value) where it is positive by nature, else value / size."""

    logarithmic: bool
    size: float

    def value(self, q: float) -> float:
        """Value at a searched coordinate."""
        with np.errstate(over="ignore"):  # the end of an interval may lie beyond every number
            return float(np.exp(q)) if self.logarithmic else float(q * self.size)

    def position(self, value: float) -> float:
        """Searched coordinate of a value."""
        if self.logarithmic:
            return float(np.log(value)) if value > 0.0 else -np.inf
        return value / self.size

    def slope(self, q: float) -> float:
        """Return d value / d q."""
        return float(np.exp(q)) if self.logarithmic else self.size


class ModelOverRuns:
    """A model that starts anew in every run, with the values that are that run's own.

    Parameters
    ----------
    cls : type[Component] or FmuWithDifferences
        A component is compiled; an FMU has its derivatives by these names.
    names : sequence of str
        Parameters with respect to which derivatives are wanted, those of single runs among them.
    linear : bool or collection of str
        Inputs that are smooth (`smooth_inputs`), all or those named; others are held until the next sample.
    runs : sequence of Run
        What the names are of. A stimulus without runs is simulated as the first of them.

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
        runs: Sequence[Run],
    ):
        self._names, self._runs = list(names), tuple(runs)
        self._plain = list(dict.fromkeys(map(base_name, names)))
        self._model = (
            cls if isinstance(cls, FmuWithDifferences) else DelayedModel(cls, self._plain, linear)
        )
        self.layout, self.delays = self._model.layout, self._model.delays

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        parameters: Mapping[str, float],
        effort: float = 1e6,
        runs: Sequence[Run] = (),
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
        effort : float
            Internal steps per sample, beyond which the model has become too stiff.
        runs : sequence of Run
            They may be others than those that were fitted: nothing in them hangs on the values of single runs fitted.

        Returns
        -------
        Trajectory
            Between two runs the first values of the second one; there the derivatives are zero.

        Raises
        ------
        UserError
            If the simulation fails.
        """
        chosen = runs or [Run(self._runs[0].label, 0, len(time))]
        done = [self._one(run, time, inputs, parameters, effort) for run in chosen]
        if len(chosen) == 1 and chosen[0].last - chosen[0].first == len(time):
            return done[0]
        signals = {
            name: joined(len(time), chosen, [t.signals[name] for t in done])
            for name in done[0].signals
        }
        slopes = {name: np.zeros((len(time), len(self._names))) for name in done[0].sensitivities}
        for name, matrix in slopes.items():
            for run, trajectory in zip(chosen, done, strict=True):
                matrix[run.samples] = trajectory.sensitivities[name]
        return Trajectory(signals, slopes)

    def _one(
        self,
        run: Run,
        time: Array,
        inputs: Mapping[str, Array],
        parameters: Mapping[str, float],
        effort: float,
    ) -> Trajectory:
        """Simulate one run by its own clock."""
        fed = {
            name: np.broadcast_to(values, len(time))[run.samples] for name, values in inputs.items()
        }
        ran = self._model.run(time[run.samples] - run.ahead, fed, run.values(parameters), effort)
        if self._names == self._plain:
            return ran
        # what is another run's own does nothing here, and what is this run's own does it instead of the common value
        bases, own = [base_name(name) for name in self._names], {*self._names}
        acting = [
            name == (run.own(b) if run.own(b) in own else b)
            for name, b in zip(self._names, bases, strict=True)
        ]
        places = [self._plain.index(b) for b in bases]
        return Trajectory(
            ran.signals, {name: s[:, places] * acting for name, s in ran.sensitivities.items()}
        )


class Problem:
    """A model, a record, and the parameters to search; one simulation serves residuals and derivatives.

    Parameters
    ----------
    cls : type[Component] or FmuWithDifferences
    time : ndarray, shape (n,)
        Seconds.
    inputs, measured : Mapping[str, ndarray]
        Inputs and measured outputs (n,), SI; NaN in an output is a gap.
    names : sequence of str
        Parameters to search, start values of states included; one that is a run's own by the name it has there.
    fixed : Mapping[str, float]
        Values of others, and starting points of those to search.
    linear : bool or collection of str
        Inputs that are smooth (`smooth_inputs`), all or those named; others are held until the next sample.
    order : int
        Highest order of the autoregression that the noise of an output may be; 0 for white noise.
    runs : sequence of Run
        Of the record, with gaps in all outputs between them; a single one without a name unless given.

    Attributes
    ----------
    declared : dict of str to Declaration
        Of every parameter, and of what is searched.
    start : dict of str to float
        Value of every parameter where the search starts.
    measured, present : dict of str to ndarray
        Outputs of which anything was measured, and where.
    calm : dict of str to ndarray of bool, shape (m,)
        Measured samples of every output that tell of its noise: it did not stand still, and no step of an input came
        close before.
    even : bool
        Whether samples are equally spaced.
    order : int
        As given; 0 where samples are not equally spaced, because an autoregression is over equal steps.
    scales : list of Scale
    evaluations : int
        Simulations made.
    effort : float
        Internal steps per sample, on average, beyond which a simulation is abandoned.
    out_of_time : callable
        Whether there is no time left to search on; never, unless replaced.
    freedom : Mapping of str to float
        Of the noise of outputs, where it is to be the same whatever a model leaves, so that likelihoods are comparable.
    colour : Mapping of str to ndarray
        Coefficients of the noise's autoregression, likewise.
    held : list of int
        Coordinates that stay where a search starts.

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
        linear: bool | Collection[str] = False,
        order: int = ORDER,
        runs: Sequence[Run] = (),
    ):
        self.runs = tuple(runs) or (Run("", 0, len(time)),)
        self.model = ModelOverRuns(cls, names, linear, self.runs)
        self.declared: dict[str, Any] = {p.name: p for p in self.model.layout.parameters}
        self.declared |= {name: self.declared[base_name(name)] for name in names}
        for name in names:
            if self.declared[name].type != "real":
                raise UserError(
                    f"{name} is {self.declared[name].type}; only real parameters can be fitted"
                )
        self.time, self.inputs, self.names = time, inputs, list(names)
        self.even = sampled_alike(time, self.runs)
        self.order = order if self.even else 0
        self.start = {name: float(p.start) for name, p in self.declared.items()} | dict(fixed)
        self.start |= {name: self.start[base_name(name)] for name in names if name not in fixed}
        self.measured = {o: y for o, y in measured.items() if np.isfinite(y).any()}
        self.present = {o: np.isfinite(y) for o, y in self.measured.items()}
        # a mask copies a record even where it leaves nothing out
        self._where = {o: slice(None) if p.all() else p for o, p in self.present.items()}
        moved = input_steps(inputs, len(time))
        self.calm = {o: calm(moved, y)[self.present[o]] for o, y in self.measured.items()}
        self.scales = [_scale(self.declared[name], self.start[name]) for name in names]
        self.evaluations, self.effort = 0, max(_EFFORT, _EFFORTS / len(time))
        self._step = float(np.median(np.diff(time)))
        self.out_of_time: Callable[[], bool] = lambda: False
        self.freedom: Mapping[str, float] = {}
        self.colour: Mapping[str, Array] = {}
        self.held: list[int] = []
        self._at: tuple[bytes, dict[str, Array], dict[str, Array]] | None = None

    def evaluate(self, q: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return the residual, measured minus simulated, (m,) and its Jacobian (m, p) of every output, where measured.

        Raises
        ------
        UserError
            If the simulation fails there.
        """
        if self._at is None or self._at[0] != q.tobytes():
            self.evaluations += 1
            trajectory = self.model.run(
                self.time, self.inputs, self.start | self.values(q), self.effort, self.runs
            )
            slopes = np.array([s.slope(x) for s, x in zip(self.scales, q, strict=True)])
            residual = {
                o: (y - trajectory.signals[o])[self._where[o]] for o, y in self.measured.items()
            }
            jacobian = {
                o: trajectory.sensitivities[o][self._where[o]] * -slopes for o in self.measured
            }
            self._at = (q.tobytes(), residual, jacobian)
        return self._at[1:]

    def traced(self, q: Array) -> list[str]:
        """Parameters that move anything that was measured, at a point."""
        slopes = self.evaluate(q)[1].values()
        return [
            name for i, name in enumerate(self.names) if any(slope[:, i].any() for slope in slopes)
        ]

    def while_there_is_time(self, residual: Callable[[Array], Array]) -> Callable[[Array], Array]:
        """Residuals for one search: its first point always, others while there is time, so that it ends at its best."""
        begun = False

        def limited(q: Array) -> Array:
            nonlocal begun
            if begun and self.out_of_time():
                raise SearchEndedError("there is no time left to search on")
            begun = True
            return residual(q)

        return limited

    def noise(self, residual: Mapping[str, Array]) -> dict[str, Noise]:
        """Noise that is estimated from a residual, (m,) by output."""
        return {
            o: estimate(
                e,
                self.present[o],
                self.order,
                self.calm[o],
                self.freedom.get(o),
                self.colour.get(o),
            )
            for o, e in residual.items()
        }

    def forget(self) -> None:
        """Let go of the last simulation."""
        self._at = None

    @property
    def samples(self) -> int:
        """Measured values."""
        return sum(int(p.sum()) for p in self.present.values())

    def values(self, q: Array) -> dict[str, float]:
        """Searched parameters by name, none of them beyond its range by the rounding of a logarithm."""
        found = {n: s.value(x) for n, s, x in zip(self.names, self.scales, q, strict=True)}
        return {
            n: min(max(value, self.declared[n].min), self.declared[n].max)
            for n, value in found.items()
        }

    def intervals(self, q: Array, standard_errors: Array) -> dict[str, tuple[float, float]]:
        """95 % confidence intervals of searched parameters by name; their ends are open where an error is infinite."""
        half = float(norm.ppf(0.975)) * standard_errors
        ends = zip(self.names, self.scales, q - half, q + half, strict=True)
        return {n: (s.value(low), s.value(high)) for n, s, low, high in ends}

    def position(self, values: Mapping[str, float]) -> Array:
        """Searched coordinates of values by name."""
        return np.array(
            [s.position(values[n]) for n, s in zip(self.names, self.scales, strict=True)]
        )

    def bounds(self) -> tuple[Array, Array]:
        """Ends of the ranges in searched coordinates, each of shape (p,)."""
        ranges = [(self.declared[n].min, self.declared[n].max) for n in self.names]
        ends = [
            (s.position(low), s.position(high))
            for s, (low, high) in zip(self.scales, ranges, strict=True)
        ]
        low, high = np.array(ends, dtype=float).reshape(-1, 2).T
        return low, high

    def neighbourhood(self, q: Array) -> tuple[Array, Array]:
        """Bounds about a point within which the residuals are smooth: with a delay they jump at every sample."""
        low, high = self.bounds()
        for i, samples in self._delays(q):
            ends = np.floor(samples) + np.array([_EDGE, 1.0 - _EDGE])
            low[i], high[i] = np.clip([self._delay(i, end) for end in ends], low[i], high[i])
        low[self.held] = high[self.held] = q[self.held]
        return low, high

    def beyond(self, q: Array) -> Array | None:
        """Return a point on the other side of the end that a delay has come to; None if none has."""
        other = q.copy()
        for i, samples in self._delays(q):
            wall = round(samples)
            if wall > 0 and abs(samples - wall) < 2.0 * _EDGE:
                other[i] = self._delay(i, wall + (_NUDGE if samples < wall else -_NUDGE))
        return None if np.array_equal(other, q) else np.clip(other, *self.bounds())

    def _delays(self, q: Array) -> list[tuple[int, float]]:
        """Return which coordinates are delays, and how many samples long each is."""
        named = {
            i for i, name in enumerate(self.names) if base_name(name) in self.model.delays.values()
        }
        return [
            (i, self.scales[i].value(q[i]) / self._step)
            for i in sorted(named.difference(self.held))
        ]

    def _delay(self, i: int, samples: float) -> float:
        return self.scales[i].position(samples * self._step)

    def inside(self, q: Array) -> Array:
        """Move a starting point off the ends of the ranges, where the first steps would be very small."""
        low, high = self.bounds()
        nudge = np.minimum(_NUDGE, _NUDGE * (high - low))
        inner = np.clip(q, low + nudge, high - nudge)
        return np.where(np.isneginf(inner), _SMALLEST, inner)


def _scale(declaration: Any, value: float) -> Scale:
    """How to search a parameter: its own size is what changes of it are relative to, unless it is none."""
    positive = declaration.min >= 0.0 and value > 0.0
    # where a state starts is no size of it, which may be anything at another time
    size = (
        max(abs(value), declaration.nominal)
        if declaration.starts
        else abs(value) or declaration.nominal
    )
    return Scale(positive, size)
