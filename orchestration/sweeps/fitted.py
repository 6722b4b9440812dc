"""Parameters drawn from a fit that ``ppy identify --json`` wrote."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from fmus.kit.errors import UserError
from fmus.kit.units import allowed
from orchestration.experiment.model import checked
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Value, show
from orchestration.identify.estimate import Distribution, Estimate, distribution
from orchestration.sweeps.design import MOST

Array = NDArray[np.float64]


class _Figures(BaseModel):
    """A table of the file; it says more than is needed here."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class _Parameter(_Figures):
    value: float
    ci95: tuple[float | None, float | None]
    unit: str
    logarithmic: bool


class _Correlation(_Figures):
    between: tuple[str, str]
    value: Annotated[float, Field(ge=-1.0, le=1.0)]


class _Fitted(_Figures):
    parameters: Annotated[dict[str, _Parameter], Field(min_length=1)]
    correlations: list[_Correlation]


class _Answer(_Figures):
    set: dict[str, float | str] = {}
    fitted: _Fitted


@dataclass(frozen=True)
class Fitted:
    """A fit as a file has it, for a model.

    Attributes
    ----------
    path : Path
    model : Model
    distribution : Distribution
        Of its parameters.
    settings : dict of str to float or str
        That it was made with.
    """

    path: Path
    model: Model
    distribution: Distribution
    settings: dict[str, Value]

    def draws(self, samples: int | None, seed: int) -> dict[str, Array]:
        """Draw parameters; UserError if it is not said how many, or one is drawn that the model does not allow."""
        if samples is None:
            raise UserError(
                f"{self.path}: how many cases are drawn from it is said by --samples, such as 200"
            )
        if samples < 1:
            raise UserError(f"--samples {samples}: one or more are drawn from {self.path}")
        if samples > MOST:
            raise UserError(f"{samples:.3g} cases; at most {MOST:,} are made")
        drawn = self.distribution.draws(samples, seed)
        for name, values in drawn.items():
            signal = self.model.parameters[name]
            beyond = values[(values < signal.min) | (values > signal.max)]
            if beyond.size:
                raise UserError(
                    f"{self.path}: {name} is determined so loosely that {beyond.size} of {samples:,} draws are out of "
                    f"range, such as {show(float(beyond[0]), signal)}; allowed is {allowed(signal)}"
                )
        return drawn

    def differences(self, settings: Mapping[str, Value]) -> list[str]:
        """Lines on parameters that are set otherwise than they were in the fit."""
        known, lines = {**self.model.parameters, **self.model.inputs}, []
        for name in sorted(
            {*self.settings, *settings} & {*self.model.parameters} - {*self.distribution.names}
        ):
            usual = known[name].default
            one, other = self.settings.get(name, usual), settings.get(name, usual)
            if one != other:
                then, now = show(one, known[name]), show(other, known[name])
                lines.append(f"{self.path} was fitted with {name} = {then}; here it is {now}")
        return lines


def read_fitted(path: Path, model: Model) -> Fitted:
    """Read a fit, to draw parameters from.

    Parameters
    ----------
    path : Path
        What ``ppy identify --json`` or ``ppy compare --fit --json`` wrote.
    model : Model
        Whose parameters they are.

    Raises
    ------
    UserError
        If it cannot be read, is no fit, or of parameters that the model has not or has in another unit.
    """
    try:
        given = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: no JSON, as ppy identify --json writes it ({error})") from error
    if not isinstance(given, dict) or "fitted" not in given:
        raise UserError(f"{path}: holds no fit, as ppy identify --json writes it")
    answer = checked(_Answer, given, str(path))
    fitted = answer.fitted
    estimates = {}
    for name, p in fitted.parameters.items():
        if name not in model.parameters:
            raise UserError(
                f"{path}: {model.name} has no parameter {name}; it is a fit of another model"
            )
        unit = model.parameters[name].unit
        if p.unit != unit:
            raise UserError(f"{path}: {name} is in {p.unit}, and of {model.name} in {unit}")
        low, high = p.ci95
        interval = (-np.inf if low is None else low, np.inf if high is None else high)
        estimates[name] = Estimate(p.value, p.value, interval, p.unit)
    between = _correlations(path, fitted)
    logarithmic = [name for name, p in fitted.parameters.items() if p.logarithmic]
    try:
        return Fitted(path, model, distribution(estimates, between, logarithmic), dict(answer.set))
    except UserError as error:
        raise UserError(f"{path}: {error}") from error


def _correlations(path: Path, fitted: _Fitted) -> dict[tuple[str, str], float]:
    """Correlations, which have to be of every pair of parameters, once: none is taken to be zero."""
    left = {frozenset(pair) for pair in combinations(fitted.parameters, 2)}
    for one, other in (correlation.between for correlation in fitted.correlations):
        stranger = next((name for name in (one, other) if name not in fitted.parameters), None)
        if stranger is not None:
            raise UserError(f"{path}: a correlation with {stranger}, which was not fitted")
        if one == other:
            raise UserError(
                f"{path}: a correlation of {one} with itself; there is one for every pair of parameters"
            )
        if frozenset((one, other)) not in left:
            raise UserError(f"{path}: the correlation of {one} and {other} is there twice")
        left.remove(frozenset((one, other)))
    missing = next(
        (
            f"{a} and {b}"
            for a, b in combinations(fitted.parameters, 2)
            if frozenset((a, b)) in left
        ),
        None,
    )
    if missing is not None:
        raise UserError(
            f"{path}: the correlation of {missing} is missing; without it nothing can be drawn"
        )
    return {one.between: one.value for one in fitted.correlations}
