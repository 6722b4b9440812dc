"""Linear response of outputs to additions to a law, along a simulated trajectory.

With w the addition, dS/dt = A S + b w and dy = C S + d w. Within a step between two samples A is
constant, and b and w are straight lines.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.symbolic import Jacobians, PerturbedLaws
from orchestration.discrepancy.candidates import StepMatrices
from orchestration.records.runs import MeasuredRun


@dataclass(frozen=True)
class Sides:
    """Values at both ends of every step between samples.

    The end is just before the next sample, where inputs are still held.

    Attributes
    ----------
    begin, end : ndarray, shape (n, ...)
        SI; ``end[k]`` is of the step that begins at sample k; the last one is not used.
    """

    begin: Array
    end: Array


def continuous(values: Array) -> Sides:
    """Return values (n, ...) as straight lines from one sample to the next."""
    return Sides(values, np.append(values[1:], values[-1:], axis=0))


@dataclass(frozen=True)
class SimulatedCourse:
    """Inputs and states of a run as they were simulated.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds.
    inputs, states : dict of str to Sides, of shape (n,)
        SI; discrete states among the states.
    """

    time: Array
    inputs: dict[str, Sides]
    states: dict[str, Sides]

    @classmethod
    def of(
        cls,
        time: Array,
        inputs: Mapping[str, Array],
        states: Mapping[str, Array],
        linear: bool | Collection[str],
    ) -> SimulatedCourse:
        """Return a run with inputs held until the next sample, or linear.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        inputs, states : Mapping of str to ndarray, shape (n,) or ()
            SI, at the samples; states go straight from one to the next.
        linear : bool or collection of str
            Inputs that do so too: all, none, or those named.

        Returns
        -------
        SimulatedCourse
        """

        def sides(values: Array, moving: bool) -> Sides:
            full = np.broadcast_to(np.asarray(values, dtype=float), len(time))
            return continuous(full) if moving else Sides(full, full)

        def moves(name: str) -> bool:
            return linear if isinstance(linear, bool) else name in linear

        return cls(
            time,
            {name: sides(values, moves(name)) for name, values in inputs.items()},
            {name: sides(values, True) for name, values in states.items()},
        )


class LinearResponse:
    """Responses of a run's outputs to additions to laws.

    What is added starts from nothing: at the first sample no state has been moved. Discrete states
    are as they were.

    Parameters
    ----------
    laws : PerturbedLaws
    course : SimulatedCourse
    parameters : Mapping of str to float
        SI; those that are not given have their defaults.
    outputs : sequence of str
        Of which responses are wanted; outputs or states.

    Attributes
    ----------
    steps : ndarray, shape (n - 1,)
        Seconds between samples.
    values : dict of str to Sides, of shape (n,)
        Of the laws, SI.

    Raises
    ------
    ValueError
        If one of the outputs is neither an output nor a state.
    """

    def __init__(
        self,
        laws: PerturbedLaws,
        course: SimulatedCourse,
        parameters: Mapping[str, float],
        outputs: Sequence[str],
    ):
        def along(side: str) -> Jacobians:
            time = getattr(continuous(course.time), side)
            inputs, states = (
                {n: getattr(s, side) for n, s in group.items()}
                for group in (course.inputs, course.states)
            )
            return laws.along(time, parameters, inputs, states)

        begin = along("begin")
        end = along("end")
        self._laws = laws
        self._outputs = list(outputs)
        self.values = {
            n: Sides(begin.values[:, i], end.values[:, i]) for i, n in enumerate(laws.names)
        }
        self._b = Sides(begin.b, end.b)
        self._read_by(begin)
        self.steps = np.diff(course.time)
        self._matrices = StepMatrices(begin.a, end.a, self.steps)

    def _read_by(self, at: Jacobians) -> None:
        """Keep the rows of the outputs that are wanted; a state is its own output."""
        layout = self._laws.graph.layout
        outputs = [o.name for o in layout.outputs]
        states = [s.name for s in layout.states]
        n = len(at.c)
        self._c = np.zeros((n, len(self._outputs), len(states)))
        self._d = np.zeros((n, len(self._outputs), len(self._laws.names)))
        for row, name in enumerate(self._outputs):
            if name in outputs:
                self._c[:, row] = at.c[:, outputs.index(name)]
                self._d[:, row] = at.d[:, outputs.index(name)]
            else:
                self._c[:, row, states.index(name)] = 1.0

    def effect_of(self, law: str) -> tuple[Array, Array]:
        """Return the effect of one unit that is added to a law, at each sample.

        Returns
        -------
        drives : ndarray, shape (n, states)
            Added to the rates, SI per unit of the law.
        shows : ndarray, shape (n, outputs)
            Added to the outputs at once.
        """
        i = self._laws.names.index(law)
        return self._b.begin[:, :, i], self._d[:, :, i]

    def moves(self, law: str) -> bool:
        """Return whether an addition to a law acts on any state."""
        i = self._laws.names.index(law)
        return bool(self._b.begin[:, :, i].any())

    def step(self, law: str) -> tuple[Array, Array, Array]:
        """Return the recursion of the states S under an addition w to a law.

        Returns
        -------
        transition : ndarray, shape (n - 1, states, states)
        left, right : ndarray, shape (n - 1, states)
            ``S[k + 1] = transition[k] @ S[k] + left[k] * w.begin[k] + right[k] * w.end[k]``.
        """
        i = self._laws.names.index(law)
        matrices = self._matrices
        at_begin = self._b.begin[:-1, :, i, np.newaxis]
        at_end = self._b.end[:-1, :, i, np.newaxis]
        left = (matrices.first - matrices.second) @ at_begin
        right = matrices.second @ at_end
        return matrices.transition, left[:, :, 0], right[:, :, 0]

    def row(self, law: str, output: str) -> Array:
        """Return how an output depends on states and addition, last, shape (n, states + 1)."""
        o = self._outputs.index(output)
        i = self._laws.names.index(law)
        return np.column_stack([self._c[:, o], self._d[:, o, i]])

    def size(self, law: str, units: Mapping[str, float]) -> float:
        """Return the norm of the response of the outputs to one unit, added all the time.

        Parameters
        ----------
        law : str
        units : Mapping of str to float
            In which each output is counted, SI.
        """
        n = len(self._c)
        shown = self(law, Sides(np.ones((n, 1)), np.ones((n, 1))))
        return float(np.sqrt(sum(np.sum((y / units[o]) ** 2) for o, y in shown.items())))

    def __call__(self, law: str, added: Sides) -> dict[str, Array]:
        """Return the response to functions of time that are added to a law.

        Parameters
        ----------
        law : str
        added : Sides
            Of shape (n, m), in the unit of the law.

        Returns
        -------
        dict of str to ndarray, shape (n, m)
            Change of every output.
        """
        i = self._laws.names.index(law)
        shown = self._d[:, :, i, np.newaxis] * added.begin[:, np.newaxis]
        if self.moves(law) and len(added.begin) > 1:
            _, left, right = self.step(law)
            drive = left[:, :, np.newaxis] * added.begin[:-1, np.newaxis]
            drive += right[:, :, np.newaxis] * added.end[:-1, np.newaxis]
            shown += self._c @ self._matrices.driven(drive)
        return {o: shown[:, row] for row, o in enumerate(self._outputs)}


def responses_of_runs(
    laws: PerturbedLaws,
    time: Array,
    inputs: Mapping[str, Array],
    signals: Mapping[str, Array],
    parameters: Mapping[str, float],
    *,
    linear: bool | Collection[str],
    runs: Sequence[MeasuredRun],
    outputs: Sequence[str],
) -> list[tuple[MeasuredRun, SimulatedCourse, LinearResponse]]:
    """Linearise every run of a record by itself; an addition in one has no effect in another.

    Parameters
    ----------
    laws : PerturbedLaws
    time : ndarray, shape (n,)
        Of all runs, s.
    inputs, signals : Mapping of str to ndarray, shape (n,)
        Inputs, and simulated states and discrete states, SI; an input may be one number.
    parameters : Mapping of str to float
        SI, with values of single runs by their names there.
    linear : bool or collection of str
        Inputs that are interpolated between samples instead of held: all, none, or those named.
    runs : sequence of MeasuredRun
    outputs : sequence of str
        Of which responses are wanted.

    Returns
    -------
    list of tuple of MeasuredRun, Course and LinearResponse
        On each run's own clock.
    """
    layout = laws.graph.layout
    names = [v.name for v in (*layout.states, *layout.discretes)]
    responses = []
    for run in runs:
        at = run.samples
        inputs_of_run = {
            name: np.broadcast_to(np.asarray(values, dtype=float), len(time))[at]
            for name, values in inputs.items()
        }
        states = {name: signals[name][at] for name in names}
        course = SimulatedCourse.of(time[at] - run.ahead, inputs_of_run, states, linear)
        response = LinearResponse(laws, course, run.values(parameters), outputs)
        responses.append((run, course, response))
    return responses
