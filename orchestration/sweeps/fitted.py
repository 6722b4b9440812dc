"""Fit in a file of ``ppy identify --json``, from which parameters of a sweep are drawn."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.units import format_range
from orchestration.experiment.values import checked
from orchestration.fmu import Model, Value
from orchestration.fmu.signal import show
from orchestration.identify.uncertainty import Distribution, Estimate, joint_distribution
from orchestration.reporting import option
from orchestration.sweeps.designs import check_count


class _Figures(BaseModel):
    """A table of the file; unknown keys are ignored."""

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
class SweepFit:
    """A fit from a file, for a model.

    Attributes
    ----------
    path : Path
    model : Model
    distribution : Distribution
        Distribution of its parameters.
    settings : dict of str to float or str
        Settings of the model in the fit.
    """

    path: Path
    model: Model
    distribution: Distribution
    settings: dict[str, Value]

    @property
    def values(self) -> dict[str, Value]:
        """Settings and estimates of parameters, in the units of the model."""
        centre = self.distribution.centre
        estimates = np.where(self.distribution.logarithmic, np.exp(centre), centre)
        settings = {k: x for k, x in self.settings.items() if k in self.model.parameters}
        return settings | dict(zip(self.distribution.names, estimates.tolist(), strict=True))

    def draws(self, samples: int | None, seed: int) -> dict[str, Array]:
        """Return random values of the parameters.

        Parameters
        ----------
        samples : int or None
            Number of draws.
        seed : int
            Seed of the random numbers.

        Returns
        -------
        dict of str to ndarray, shape (samples,)
            In the units of the model.

        Raises
        ------
        UserError
            If the number is missing or out of range, or a draw is out of range of the model.
        """
        if samples is None:
            raise UserError(
                f"{self.path}: state how many cases are drawn from it: {option('samples', 200)}"
            )
        if samples < 1:
            raise UserError(f"{option('samples', samples)}: one or more are drawn from {self.path}")
        check_count(samples)
        draws = self.distribution.draws(samples, seed)
        for name, values in draws.items():
            signal = self.model.parameters[name]
            beyond = values[(values < signal.min) | (values > signal.max)]
            if beyond.size:
                raise UserError(
                    f"{self.path}: {name} is determined so loosely that {beyond.size} of"
                    f" {samples:,} draws are out of range, such as"
                    f" {show(float(beyond[0]), signal)}; allowed is {format_range(signal)}"
                )
        return draws

    def differences(self, settings: Mapping[str, Value]) -> list[str]:
        """Return a line for each parameter whose setting differs from that in the fit."""
        lines = []
        names = {*self.settings, *settings} & {*self.model.parameters} - {*self.distribution.names}
        for name in sorted(names):
            signal = self.model.parameters[name]
            then = self.settings.get(name, signal.default)
            now = settings.get(name, signal.default)
            if then != now:
                lines.append(
                    f"{self.path} was fitted with {name} = {show(then, signal)}; here it is"
                    f" {show(now, signal)}"
                )
        return lines


def read_fitted(path: Path, model: Model) -> SweepFit:
    """Read the fit of a model from a file.

    Parameters
    ----------
    path : Path
        Output of ``ppy identify --json`` or ``ppy compare --fit --json``.
    model : Model
        Model with the parameters of the fit.

    Returns
    -------
    SweepFit

    Raises
    ------
    UserError
        If the file cannot be read or is no fit, or the model does not have its parameters in the
        same units.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: no JSON, as ppy identify --json writes it ({error})") from error
    if not isinstance(content, dict) or "fitted" not in content:
        raise UserError(f"{path}: holds no fit, as ppy identify --json writes it")
    answer = checked(_Answer, content, str(path))
    fitted = answer.fitted
    estimates = {name: _estimate(path, name, one, model) for name, one in fitted.parameters.items()}
    between = _correlations(path, fitted)
    logarithmic = [name for name, p in fitted.parameters.items() if p.logarithmic]
    try:
        return SweepFit(
            path, model, joint_distribution(estimates, between, logarithmic), dict(answer.set)
        )
    except UserError as error:
        raise UserError(f"{path}: {error}") from error


def _estimate(path: Path, name: str, parameter: _Parameter, model: Model) -> Estimate:
    """Return the estimate of a parameter; raise if the model does not have it in the same unit."""
    if name not in model.parameters:
        raise UserError(
            f"{path}: {model.name} has no parameter {name}; it is a fit of another model"
        )
    unit = model.parameters[name].unit
    if parameter.unit != unit:
        raise UserError(f"{path}: {name} is in {parameter.unit}, but {model.name} has it in {unit}")
    low, high = parameter.ci95
    interval = (-np.inf if low is None else low, np.inf if high is None else high)
    return Estimate(parameter.value, parameter.value, interval, parameter.unit)


def _correlations(path: Path, fitted: _Fitted) -> dict[tuple[str, str], float]:
    """Return the correlations by pair; raise if a pair of parameters does not have exactly one."""
    missing = {frozenset(pair) for pair in combinations(fitted.parameters, 2)}
    for correlation in fitted.correlations:
        one, other = correlation.between
        for name in (one, other):
            if name not in fitted.parameters:
                raise UserError(f"{path}: a correlation with {name}, which was not fitted")
        if one == other:
            raise UserError(
                f"{path}: a correlation of {one} with itself; there is one for every pair of"
                " parameters"
            )
        if frozenset((one, other)) not in missing:
            raise UserError(f"{path}: the correlation of {one} and {other} is there twice")
        missing.remove(frozenset((one, other)))
    for one, other in combinations(fitted.parameters, 2):
        if frozenset((one, other)) in missing:
            raise UserError(
                f"{path}: the correlation of {one} and {other} is missing, so that no case can"
                " be drawn"
            )
    return {correlation.between: correlation.value for correlation in fitted.correlations}
