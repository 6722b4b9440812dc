"""What a law lacks as a function of time: a free course that lets the model follow the record.

A model that lacks much runs elsewhere than the plant did, and what its signals tell there is of no use. With a free
course added to one of its laws it runs where the plant ran, as far as that law can take it there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from fmus.kit import Component, Effect, Input
from fmus.kit.errors import UserError
from fmus.kit.symbolic.perturbed import PerturbedLaws
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.laws.linear.response import (
    Course,
    LinearResponse,
    Sides,
    responses_of_runs,
)
from orchestration.discrepancy.laws.linear.smoothing import Wanted, calmest, smoothed
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.noise.model import noise_std
from orchestration.records.joined import Run

Array = NDArray[np.float64]
_ROUNDS = 6
_SETTLED = 0.01  # fall of the cost, relative, that ends the rounds
_HALVINGS = 5
_ORDERS = 2, 3  # of differences
_KNOWN = 0.01  # precision of a coordinate without a prior, in its sizes
_LEAST = 1e-6  # of what a model leaves, which noise is taken to be at least
_NEIGHBOURS, _FAR = 5, 6.0  # samples, and deviations beyond which one of them is an outlier


def disturbed(cls: type[Component], law: str) -> type[Effect]:
    """Let an input be added to a law."""
    name = f"{law}_addition"

    def more(self: Any, *arguments: Any) -> Any:
        return getattr(super(effect, self), law)(*arguments) + getattr(self, name)

    about = {
        "id": "addition",
        law: more,
        name: Input("1", doc=f"added to {law}"),
        "__module__": cls.__module__,
    }
    effect: type[Effect] = type(f"AdditionTo{law.title()}", (Effect,), about)
    return effect


@dataclass(frozen=True)
class FreeCourse:
    """A model that follows a record by a free course of one law, linear about where it runs.

    Attributes
    ----------
    law : str
    residual : dict of str to ndarray, shape (m,)
        Measured minus what the model is without the course, to first order.
    left : dict of str to ndarray, shape (m,)
        Measured minus simulated with it.
    slopes : dict of str to ndarray, shape (m, p)
        Derivatives of the residual by the model's own parameters.
    parts : list of tuple of Run, Course and LinearResponse
    values : dict of str to float
        The model's own parameters beside the course, SI.
    """

    law: str
    residual: dict[str, Array]
    left: dict[str, Array]
    slopes: dict[str, Array]
    parts: list[tuple[Run, Course, LinearResponse]]
    values: dict[str, float]


def follow(search: Search, base: FittedCandidate, laws: PerturbedLaws, law: str) -> FreeCourse:
    """Find the course of one law with which a fitted model follows the record.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
    laws : PerturbedLaws
        Of the model.
    law : str

    Returns
    -------
    FreeCourse

    Raises
    ------
    UserError
        If the model cannot be simulated with it.
    """
    plant = _Followed(search, base, laws, law)
    course = np.zeros(len(search.data.time))
    here = plant.at(course, plant.q)
    if not any(r.moves(law) for _, _, r in here.parts):
        return plant.result(course, here)
    wanted = plant.wanted(course, here)
    stirred = calmest(wanted, law, plant.noise, plant.precision)
    for _ in range(_ROUNDS):
        target = np.zeros_like(course)
        courses, step, _ = smoothed(
            plant.wanted(course, here), law, plant.noise, plant.precision, stirred
        )
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
    return plant.result(course, here)


@dataclass(frozen=True)
class _Run:
    """A simulation with a course, and how it answers to more."""

    q: Array
    error: dict[str, Array]
    slopes: dict[str, Array]
    cost: float
    parts: list[tuple[Run, Course, LinearResponse]]


class _Followed:
    """Simulations of a model with a course added to one of its laws."""

    def __init__(self, search: Search, base: FittedCandidate, laws: PerturbedLaws, law: str):
        self._laws, self._law, self._data = laws, law, search.data
        name, data = f"{law}_addition", search.data
        moving = True if data.linear is True else {*(data.linear or ()), name}
        fed = {**data.inputs, name: np.zeros(len(data.time))}
        here = replace(search, data=replace(data, inputs=fed, linear=moving))
        candidate = base.candidate.with_effect(disturbed(base.candidate.cls, law))
        names = [*search.parameters, *base.candidate.parameters, *base.candidate.starts]
        self._name, self._problem = (
            name,
            here.problem(candidate, names, {**search.fixed, **base.fit.values}),
        )
        self.q = self._problem.position(self._problem.start | base.fit.values)
        # a coordinate without a prior is known to some of its sizes
        self.precision = np.where(base.fit.prior_precision > 0.0, base.fit.prior_precision, _KNOWN)
        self._outputs = list(self._problem.measured)
        self.noise = noise_floor(self._problem.evaluate(self.q)[0])

    def within(self, q: Array) -> Array:
        """Coordinates within their ranges."""
        return np.clip(q, *self._problem.bounds())

    def at(self, course: Array, q: Array) -> _Run:
        """Simulate."""
        problem = self._problem
        problem.inputs = {**self._data.inputs, self._name: course}
        problem.forget()
        error, slopes = problem.evaluate(q)
        cost = sum(float(np.sum((e / self.noise[o]) ** 2)) for o, e in error.items())
        values = problem.start | problem.values(q)
        ran = problem.model.run(problem.time, problem.inputs, values, problem.effort, problem.runs)
        parts = responses_of_runs(
            self._laws,
            problem.time,
            self._data.inputs,
            ran.signals,
            values,
            self._data.linear or (),
            problem.runs,
            self._outputs,
        )
        return _Run(q, dict(error), dict(slopes), cost, parts)

    def towards(
        self, course: Array, here: _Run, target: Array, q: Array
    ) -> tuple[Array, _Run] | None:
        """Go as far towards another course as costs less; None if nothing does."""
        for halving in range(_HALVINGS):
            share = 0.5**halving
            tried = course + share * (target - course)
            try:
                found = self.at(tried, here.q + share * (q - here.q))
            except UserError:
                continue
            if found.cost < here.cost:
                return tried, found
        return None

    def wanted(self, course: Array, here: _Run) -> list[Wanted]:
        """What every run has more than the model without the course; outliers are not known."""
        whole = {o: self._full(_likely(e, self.noise[o]), o) for o, e in here.error.items()}
        shown, slopes = (
            self._shown(course, here),
            {o: self._full(j, o) for o, j in here.slopes.items()},
        )
        return [
            Wanted(
                response,
                {o: (whole[o] + shown[o])[run.samples] for o in whole},
                {o: np.nan_to_num(j[run.samples]) for o, j in slopes.items()},
            )
            for run, _, response in here.parts
        ]

    def result(self, course: Array, here: _Run) -> FreeCourse:
        """What is left, and what is to be explained."""
        present = self._problem.present
        residual = {o: e + self._shown(course, here)[o][present[o]] for o, e in here.error.items()}
        self._problem.forget()
        return FreeCourse(
            self._law, residual, here.error, here.slopes, here.parts, self._problem.values(here.q)
        )

    def _shown(self, course: Array, here: _Run) -> dict[str, Array]:
        """What a course does to the outputs (n,)."""
        found = {o: np.zeros(len(course)) for o in self._outputs}
        for run, _, response in here.parts:
            one = course[run.samples, None]
            for o, rows in response(
                self._law, Sides(one, np.append(one[1:], one[-1:], axis=0))
            ).items():
                found[o][run.samples] = rows[:, 0]
        return found

    def _full(self, values: Array, output: str) -> Array:
        """Values (n, ...) with NaN where nothing was measured."""
        whole = np.full((len(self._data.time), *values.shape[1:]), np.nan)
        whole[self._problem.present[output]] = values
        return whole


def noise_floor(residual: Mapping[str, Array]) -> dict[str, float]:
    """Standard deviation of the noise of outputs, as differences of what a model leaves tell it."""
    floor = {}
    for o, e in residual.items():
        rms = float(np.sqrt(np.mean(e**2)))
        # what a model lacks is smoother than noise, and smoother than the record; its curvature must not count
        floor[o] = max(min(rms, *(noise_std(e, order) for order in _ORDERS)), _LEAST * rms) or 1.0
    return floor


def _likely(error: Array, deviation: float) -> Array:
    """A residual without samples that are far from their neighbours."""
    far = np.abs(error - median_filter(error, _NEIGHBOURS, mode="nearest")) > _FAR * deviation
    return np.where(far, np.nan, error)
