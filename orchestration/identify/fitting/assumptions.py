"""Assumptions of a fit beyond the parameters that it searches, such as bounds and priors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from math import inf
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Interval, Signals
from fmus.kit.units import format_range, format_value
from orchestration.identify.noise import Noise

# Degrees of freedom of Student's t distribution by the name of a loss; None where the residual
# tells them. Four are usual for robust regression (Lange, Little, Taylor: J. Amer. Statist. Assoc.
# 84, 1989); one is the Cauchy distribution, SciPy's loss of that name.
LOSSES: Mapping[str, float | None] = {"auto": None, "squares": inf, "student": 4.0, "cauchy": 1.0}
SCALES = ("logarithmic", "linear")


@dataclass(frozen=True)
class Assumptions:
    """Assumptions of a fit beyond the parameters that it searches.

    Attributes
    ----------
    each : sequence of str
        Searched parameters that differ from record to record, as start values of states always do.
    bounds : Mapping of str to tuple of float
        Ends of the range of a parameter, inside the one that the model declares.
    scales : Mapping of str to str
        ``logarithmic`` or ``linear``: the coordinate in which a parameter is searched.
    priors : Mapping of str to tuple of float
        Mean and standard deviation of what is known of a parameter beforehand (Gaussian).
    ties : Mapping of str to tuple of (float, str)
        Factor, and the searched parameter of which a parameter is that multiple.
    noise : Mapping of str to float
        Known standard deviation of an output; else it is estimated from the residual.
    weights : Mapping of str to ndarray, shape (n,)
        By output, of every sample of the only record: the factor of its residual.
    loss : str
        One of `LOSSES`.
    starts : int or None
        Points at which a search begins; None for more than one only where the residual is not
        white, so that a deeper minimum may exist.
    linear : bool
        Whether inputs go in straight lines between samples, or are held.
    """

    each: Sequence[str] = ()
    bounds: Mapping[str, Interval] = field(default_factory=dict)
    scales: Mapping[str, str] = field(default_factory=dict)
    priors: Mapping[str, Interval] = field(default_factory=dict)
    ties: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    weights: Mapping[str, Array] = field(default_factory=dict)
    loss: str = "auto"
    starts: int | None = 1
    linear: bool = False

    @property
    def freedom(self) -> float | None:
        """Degrees of freedom of the noise; None if they are estimated."""
        return LOSSES[self.loss]

    @property
    def given(self) -> dict[str, Noise]:
        """The noise that is not estimated: of outputs where it is known, and of priors."""
        freedom = self.freedom or inf
        known = {output: Noise(deviation, freedom) for output, deviation in self.noise.items()}
        return known | {prior_row(name): Noise(1.0) for name in self.priors}

    def check(self, names: Sequence[str], measured: Signals) -> None:
        """Refuse names that are not searched or not measured, and values without a meaning.

        Parameters
        ----------
        names : sequence of str
            Parameters that are searched.
        measured : Mapping of str to ndarray, shape (n,)
            By output.

        Raises
        ------
        UserError
        """
        fitted = names, "it is not fitted; fitted are"
        outputs = measured, "it was not measured; there are"
        for option, given, (known, fault) in (
            ("each", self.each, fitted),
            ("bounds", self.bounds, fitted),
            ("scale", self.scales, fitted),
            ("prior", self.priors, fitted),
            ("tie", [source for _, source in self.ties.values()], fitted),
            ("noise", self.noise, outputs),
            ("weights", self.weights, outputs),
        ):
            for name in given:
                if name not in known:
                    raise UserError(f"{option} {name}: {fault} {', '.join(known)}")
        for name in self.ties:
            if name in names:
                raise UserError(f"tie {name}: it is fitted, too; leave out one of the two")
        for output, weights in self.weights.items():
            if np.shape(weights) != np.shape(measured[output]):
                raise UserError(
                    f"weights of {output}: there are {np.size(weights)}, of"
                    f" {len(measured[output])} samples"
                )
        self._check_deviations()

    def _check_deviations(self) -> None:
        deviations = {f"prior {name}": deviation for name, (_, deviation) in self.priors.items()}
        deviations |= {f"noise {output}": deviation for output, deviation in self.noise.items()}
        for what, deviation in deviations.items():
            if not 0.0 < deviation < inf:
                raise UserError(f"{what}: the deviation is {deviation:g}; it must be above zero")

    def bounded(self, declared: Mapping[str, Any]) -> dict[str, Any]:
        """Return declarations with the bounds as their ranges, those of ties' sources narrowed.

        Raises
        ------
        UserError
            If bounds are not ascending, or not inside the range that is declared.
        """
        narrowed = dict(declared)
        for name, (low, high) in self.bounds.items():
            known = declared[name]
            if not known.min <= low < high <= known.max:
                ends = f"{format_value(low, known)} … {format_value(high, known)}"
                raise UserError(
                    f"bounds {name}: {ends} is no range inside the one that is allowed,"
                    f" {format_range(known)}"
                )
            narrowed[name] = _within(known, low, high)
        for name, (factor, source) in self.ties.items():
            one, other = declared[name].min / factor, declared[name].max / factor
            narrowed[source] = _within(narrowed[source], min(one, other), max(one, other))
        return narrowed


def prior_row(name: str) -> str:
    """Return the name of the residual that the prior of a parameter is."""
    return f"prior of {name}"


def _within(declaration: Any, low: float, high: float) -> Any:
    """Return a declaration with the part of its range that lies between two values."""
    part = copy(declaration)
    part.min = max(declaration.min, low)
    part.max = min(declaration.max, high)
    return part


NO_ASSUMPTIONS = Assumptions()
