"""The floor: every effect fitted alone from nominal values by plain least squares, the best by BIC.

It knows the list of effects and how a model is simulated, and nothing of how a diagnosis searches.
What it comes to is what a diagnosis must not be worse than. The same fits tell which records
another effect could have made.
"""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from fmus.kit import Component, Effect, UserError, stack
from fmus.kit.arrays import Array
from fmus.kit.effects import effect_name
from orchestration.discrepancy.candidates import (
    catalogue,
    own_parameters,
    sampling_of,
    signal_scales,
)
from orchestration.fmu.model import families, known_effects
from orchestration.identify.fitting import Problem
from studies.clean import CleanRecord, noise_scale
from studies.hidden import effective_samples, widths

EVALUATIONS = 20  # of each fit, at most
EVIDENCE = 10.0  # twice the logarithm of a likelihood ratio: "very strong" after Kass and Raftery

BASE = ""


@dataclass(frozen=True)
class Fitted:
    """One effect alone.

    Attributes
    ----------
    bic : float
    evidence : float
        How much more likely the truth makes the record, as expected by what the fit misses of the
        outputs without noise: twice the logarithm of the likelihood ratio.
    """

    bic: float
    evidence: float


def listed(
    cls: type[Component], drawn: CleanRecord, settings: Mapping[str, float]
) -> dict[str, type[Effect]]:
    """Return effects that a diagnosis with families looks at, by label."""
    sampling = sampling_of(drawn.time)
    known = catalogue(cls, known_effects(cls), drawn.outputs, sampling)
    scales = signal_scales(cls, drawn.time, drawn.inputs, settings)
    known += families(cls, scales, sampling).values()
    return {effect_name(effect): effect for effect in known}


def fitted_alone(
    cls: type[Component],
    drawn: CleanRecord,
    effects: Mapping[str, type[Effect]],
    settings: Mapping[str, float],
) -> tuple[dict[str, Fitted], float]:
    """Fit every effect and the base (`BASE`) alone; return the processor time as well, s."""
    began = clock.process_time()
    found = {}
    for name, effect in {BASE: None, **effects}.items():
        try:
            found[name] = _fit(cls, drawn, effect, settings)
        except (UserError, ValueError, FloatingPointError, np.linalg.LinAlgError):
            continue  # it cannot be fitted from nominal values
    return found, clock.process_time() - began


def _fit(
    cls: type[Component],
    drawn: CleanRecord,
    effect: type[Effect] | None,
    settings: Mapping[str, float],
) -> Fitted:
    plant = drawn.plant
    names = [*plant.nominal, *(f"{state}_start" for state in _own_states(cls, drawn))]
    names += own_parameters(effect) if effect else []
    laid = stack(cls, effect) if effect else cls
    linear = set(drawn.smooth) - set(plant.sampled)
    outputs = {o: np.where(drawn.regular[o], y, np.nan) for o, y in drawn.outputs.items()}
    problem = Problem(
        laid, drawn.time, drawn.inputs, outputs, names, settings, linear=linear, order=0
    )
    weights = {o: 1.0 / noise_scale(y) for o, y in drawn.outputs.items()}

    def residual(q: Array) -> Array:
        try:
            e, _ = problem.evaluate(q)
        except UserError:
            return np.full(problem.samples, 1e9)
        return np.nan_to_num(
            np.clip(np.concatenate([weights[o] * e[o] for o in e]), -1e9, 1e9), nan=1e9
        )

    def jacobian(q: Array) -> Array:
        _, j = problem.evaluate(q)
        return np.nan_to_num(np.concatenate([weights[o] * j[o] for o in j]))

    start = problem.inside(problem.position(problem.start))
    best = least_squares(
        residual, start, jacobian, problem.bounds(), x_scale=1.0, max_nfev=EVALUATIONS
    )
    return _assessed(problem, best.x, drawn)


def _assessed(problem: Problem, q: Array, drawn: CleanRecord) -> Fitted:
    """Return the criteria of a fit by its position."""
    e, _ = problem.evaluate(q)
    bic = sum(row.size * float(np.log(np.mean(row**2))) for row in e.values())
    missed = widths(drawn, {o: np.array(y) for o, y in _simulated(problem, q).items()})
    count = effective_samples(drawn)
    evidence = sum(count[o] * float(np.log1p(missed[o] ** 2)) for o in missed)
    return Fitted(bic + len(q) * float(np.log(problem.samples)), evidence)


def _own_states(cls: type[Component], drawn: CleanRecord) -> list[str]:
    known = {state.name for state in cls.layout.states}
    return [name for name in drawn.plant.states if name in known]


def _simulated(problem: Problem, q: Array) -> dict[str, Array]:
    signals = problem.model.run(
        problem.time, problem.inputs, problem.start | problem.values(q)
    ).signals
    return {o: signals[o] for o in problem.measured}
