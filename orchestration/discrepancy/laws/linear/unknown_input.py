"""Unknown input to a law, estimated so that the model follows the record.

A model that lacks much runs elsewhere than the plant did, and its signals there are of no use. With
an unknown input added to one of its laws it runs where the plant ran, as far as that law can take
it there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from fmus.kit import Component, Effect, Input, UserError
from fmus.kit.arrays import Array
from fmus.kit.effects import make_effect
from fmus.kit.symbolic import PerturbedLaws
from orchestration.discrepancy.candidates import Candidate, FittedCandidate
from orchestration.discrepancy.laws.linear.response import (
    LinearResponse,
    Sides,
    SimulatedCourse,
    responses_of_runs,
)
from orchestration.discrepancy.laws.linear.smoothing import Smoother, TrackingTarget
from orchestration.discrepancy.selection import Search
from orchestration.identify.noise import noise_std
from orchestration.records.runs import MeasuredRun

_ROUNDS = 6
_SETTLED = 0.01  # fall of the cost, relative, that ends the rounds
_HALVINGS = 5
_DIFFERENCE_ORDERS = 2, 3
_KNOWN = 0.01  # precision of a coordinate without a prior, in its sizes
_LEAST = 1e-6  # of the residual of a model, which noise is taken to be at least
_NEIGHBOURS = 5  # samples
_FAR = 6.0  # deviations from their median, beyond which one of them is an outlier


def disturbed(cls: type[Component], laws: Iterable[str]) -> type[Effect]:
    """Return an effect that adds an input to each of several laws."""

    def with_addition(law: str) -> Callable[..., Any]:
        def more(self: Any, *arguments: Any) -> Any:
            return getattr(super(effect, self), law)(*arguments) + getattr(self, _input_of(law))

        return more

    body: dict[str, Any] = {"__module__": cls.__module__}
    for law in laws:
        body[law] = with_addition(law)
        body[_input_of(law)] = Input("1", doc=f"added to {law}")
    effect = make_effect("Addition", body, id="addition")
    return effect


def _input_of(law: str) -> str:
    return f"{law}_addition"


@dataclass(frozen=True)
class UnknownInput:
    """An unknown input to one law, and the model that follows a record by it, linearised.

    Attributes
    ----------
    law : str
    residual : dict of str to ndarray, shape (m,)
        Measured minus simulated without the input, to first order.
    unexplained : dict of str to ndarray, shape (m,)
        Measured minus simulated with it.
    slopes : dict of str to ndarray, shape (m, p)
        Derivatives of the residual by the model's own parameters.
    parts : list of tuple of MeasuredRun, Course and LinearResponse
    values : dict of str to float
        The model's own parameters beside the input, SI.
    """

    law: str
    residual: dict[str, Array]
    unexplained: dict[str, Array]
    slopes: dict[str, Array]
    parts: list[tuple[MeasuredRun, SimulatedCourse, LinearResponse]]
    values: dict[str, float]


def estimate_unknown_input(
    search: Search, base: FittedCandidate, laws: PerturbedLaws, law: str, driven: Candidate
) -> UnknownInput:
    """Estimate the unknown input to one law with which a fitted model follows the record.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
    laws : PerturbedLaws
        Of the model.
    law : str
    driven : Candidate
        The model with an input to every law (`disturbed`), which is compiled once for all.

    Returns
    -------
    UnknownInput

    Raises
    ------
    UserError
        If the model cannot be simulated with it.
    """
    plant = _DrivenModel(search, base, laws, law, driven)
    course = np.zeros(len(search.data.time))
    here = plant.at(course, plant.q)
    if not any(r.moves(law) for _, _, r in here.parts):
        return plant.result(course, here)
    smoother = plant.smoother(course, here)
    reach = smoother.smoothest()
    for _ in range(_ROUNDS):
        target = np.zeros_like(course)
        courses, step, _ = smoother(reach)
        for (run, _, _), one in zip(here.parts, courses, strict=True):
            target[run.samples] = one
        q = plant.within(here.q + step)
        following = plant.towards(course, here, target, q)
        if following is None:
            break
        fallen = here.cost - following[1].cost
        course, here = following
        if fallen < _SETTLED * here.cost:
            break
        smoother = plant.smoother(course, here)
    return plant.result(course, here)


@dataclass(frozen=True)
class _DrivenRun:
    """A simulation with an input added to a law, and its responses to more of it."""

    q: Array
    error: dict[str, Array]
    slopes: dict[str, Array]
    cost: float
    linearise: Callable[[], list[tuple[MeasuredRun, SimulatedCourse, LinearResponse]]]

    @cached_property
    def parts(self) -> list[tuple[MeasuredRun, SimulatedCourse, LinearResponse]]:
        """Responses of every run; of a run that costs too much none is asked for."""
        return self.linearise()


class _DrivenModel:
    """Simulations of a model with an input added to one of its laws."""

    def __init__(
        self,
        search: Search,
        base: FittedCandidate,
        laws: PerturbedLaws,
        law: str,
        driven: Candidate,
    ):
        data = search.data
        name = _input_of(law)
        self._laws = laws
        self._law = law
        self._data = data
        self._name = name
        moving = True if data.linear is True else {*(data.linear or ()), name}
        fed = {**data.inputs, name: np.zeros(len(data.time))}
        here = replace(search, data=replace(data, inputs=fed, linear=moving))
        names = [*search.parameters, *base.candidate.parameters, *base.candidate.starts]
        self._problem = here.problem(driven, names, {**search.fixed, **base.fit.values})
        self.q = self._problem.position(self._problem.start | base.fit.values)
        # a coordinate without a prior is known to some of its sizes
        self.precision = np.where(base.fit.prior_precision > 0.0, base.fit.prior_precision, _KNOWN)
        self._outputs = list(self._problem.measured)
        residual, _ = self._problem.evaluate(self.q)
        self.noise = noise_floor(residual)

    def within(self, q: Array) -> Array:
        """Return coordinates within their ranges."""
        return np.clip(q, *self._problem.bounds())

    def at(self, course: Array, q: Array) -> _DrivenRun:
        """Simulate with an input (n,), at coordinates (p,)."""
        problem = self._problem
        problem.inputs = {**self._data.inputs, self._name: course}
        problem.forget_simulation()
        error, slopes = problem.evaluate(q)
        cost = sum(float(np.sum((e / self.noise[o]) ** 2)) for o, e in error.items())

        def linearise() -> list[tuple[MeasuredRun, SimulatedCourse, LinearResponse]]:
            values = problem.start | problem.values(q)
            fed = {**self._data.inputs, self._name: course}
            ran = problem.model.run(problem.time, fed, values, problem.effort, problem.runs)
            return responses_of_runs(
                self._laws,
                problem.time,
                self._data.inputs,
                ran.signals,
                values,
                linear=self._data.linear or (),
                runs=problem.runs,
                outputs=self._outputs,
            )

        return _DrivenRun(q, dict(error), dict(slopes), cost, linearise)

    def towards(
        self, course: Array, here: _DrivenRun, target: Array, q: Array
    ) -> tuple[Array, _DrivenRun] | None:
        """Go as far towards a target input as costs less; None if nothing does."""
        for halving in range(_HALVINGS):
            share = 0.5**halving
            tried = course + share * (target - course)
            try:
                run = self.at(tried, here.q + share * (q - here.q))
            except UserError:
                continue
            if run.cost < here.cost:
                return tried, run
        return None

    def smoother(self, course: Array, here: _DrivenRun) -> Smoother:
        """Return the smoother of the residual without the input; outliers are not known."""
        whole = {
            o: self._full(_without_outliers(e, self.noise[o]), o) for o, e in here.error.items()
        }
        shown = self._response(course, here)
        slopes = {o: self._full(j, o) for o, j in here.slopes.items()}
        targets = [
            TrackingTarget(
                response,
                {o: (whole[o] + shown[o])[run.samples] for o in whole},
                {o: np.nan_to_num(j[run.samples]) for o, j in slopes.items()},
            )
            for run, _, response in here.parts
        ]
        return Smoother(targets, self._law, self.noise, self.precision)

    def result(self, course: Array, here: _DrivenRun) -> UnknownInput:
        """Return the residual with the input and without it."""
        present = self._problem.present
        shown = self._response(course, here)
        residual = {o: e + shown[o][present[o]] for o, e in here.error.items()}
        self._problem.forget_simulation()
        return UnknownInput(
            self._law, residual, here.error, here.slopes, here.parts, self._problem.values(here.q)
        )

    def _response(self, course: Array, here: _DrivenRun) -> dict[str, Array]:
        """Return the response (n,) of the outputs to an input."""
        responses = {o: np.zeros(len(course)) for o in self._outputs}
        for run, _, response in here.parts:
            begin = course[run.samples, None]
            end = np.append(begin[1:], begin[-1:], axis=0)
            for o, rows in response(self._law, Sides(begin, end)).items():
                responses[o][run.samples] = rows[:, 0]
        return responses

    def _full(self, values: Array, output: str) -> Array:
        """Return values (n, ...) with NaN where nothing was measured."""
        whole = np.full((len(self._data.time), *values.shape[1:]), np.nan)
        whole[self._problem.present[output]] = values
        return whole


def noise_floor(residual: Mapping[str, Array]) -> dict[str, float]:
    """Estimate the standard deviation of the noise of outputs by differences of residuals."""
    floor = {}
    for o, e in residual.items():
        rms = float(np.sqrt(np.mean(e**2)))
        # differences remove what a model lacks, for it is smooth; whatever is left of it only adds,
        # so that the least estimate is the nearest to the noise
        floor[o] = (
            max(min(rms, *(noise_std(e, order) for order in _DIFFERENCE_ORDERS)), _LEAST * rms)
            or 1.0
        )
    return floor


def _without_outliers(error: Array, deviation: float) -> Array:
    """Return a residual with NaN for samples that are far from their neighbours."""
    far = np.abs(error - median_filter(error, _NEIGHBOURS, mode="nearest")) > _FAR * deviation
    return np.where(far, np.nan, error)
