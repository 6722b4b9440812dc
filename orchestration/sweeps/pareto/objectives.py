"""Objectives of an optimisation: outputs at the end of a run of a compiled component.

Their derivatives with respect to the parameters are exact, from the equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit import Component
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from fmus.kit.record import CompiledModel
from fmus.kit.symbolic import trace
from orchestration.fmu.model import declared_model_of
from orchestration.journal import digest
from orchestration.reporting import option
from orchestration.sweeps.ranges import Range

_AND = "&"


@dataclass(frozen=True)
class Objective:
    """An output, or the worst of several outputs, that is maximised or minimised.

    Attributes
    ----------
    outputs : tuple of str
        One output, or several, of which the worst counts.
    unit : str
    sign : float
        1 if it is maximised, -1 if it is minimised.
    """

    outputs: tuple[str, ...]
    unit: str
    sign: float

    @property
    def name(self) -> str:
        """Name in the notation of options, ``OUTPUT & OUTPUT``."""
        return f" {_AND} ".join(self.outputs)


def read_objective(text: str, sign: float, outputs: Mapping[str, str], argument: str) -> Objective:
    """Read an objective.

    Parameters
    ----------
    text : str
        ``OUTPUT``, or ``OUTPUT & OUTPUT`` for the worst of several.
    sign : float
        1 if it is maximised, -1 if it is minimised.
    outputs : Mapping of str to str
        Unit by output of the model.
    argument : str
        Name of the argument, for messages.

    Returns
    -------
    Objective

    Raises
    ------
    UserError
        If there is no such output, or units differ.
    """
    names = tuple(part.strip() for part in text.split(_AND))
    for name in names:
        if name not in outputs:
            raise UserError(
                f"{option(argument, [text])}: no output named {name!r}{suggestion(name, outputs)}"
            )
    units = list(dict.fromkeys(outputs[name] for name in names))
    if len(units) > 1:
        raise UserError(
            f"{option(argument, [text])}: the worst of several outputs needs equal"
            f" units, not {' and '.join(units)}"
        )
    return Objective(names, units[0], sign)


class Objectives:
    """Values and derivatives of objectives as functions of shares of the ranges of parameters.

    Parameters
    ----------
    cls : type[Component]
    ranges : sequence of Range
        Both ends of the ranges of p parameters.
    objectives : sequence of Objective
        m objectives.
    time : ndarray, shape (n,)
        Communication points, s.
    inputs : Mapping of str to ndarray, shape (n,)
        SI.
    settings : Mapping of str to float
        Values of other parameters that differ from their defaults, SI.

    Attributes
    ----------
    ranges, objectives : list
    model_name : str
    display : dict of str to str
        Display unit by parameter and objective.
    evaluations : int
        Number of simulations so far.
    """

    def __init__(
        self,
        cls: type[Component],
        ranges: Sequence[Range],
        objectives: Sequence[Objective],
        time: Array,
        inputs: Mapping[str, Array],
        settings: Mapping[str, float],
    ):
        self.ranges = list(ranges)
        self.objectives = list(objectives)
        self.model_name = cls.name
        self._cls = cls
        model = declared_model_of(cls)
        signals = {one.name: model.parameters[one.name] for one in ranges}
        signals |= {one.name: model.outputs[one.outputs[0]] for one in objectives}
        self.display = {name: signal.display for name, signal in signals.items()}
        self.evaluations = 0
        self._model = CompiledModel(cls, [one.name for one in ranges])
        self._conditions = time, dict(inputs), dict(settings)
        self._last: tuple[bytes, tuple[list[Array], list[Array]]] | None = None

    def digests(self) -> dict[str, str]:
        """Return digests of model, ranges, objectives, settings and inputs, by name."""
        graph = trace(self._cls)
        start = [parameter.start for parameter in graph.layout.parameters]
        time, inputs, settings = self._conditions
        ranges = [(one.name, one.logarithmic, *one.values.tolist()) for one in self.ranges]
        return {
            "the model": digest(graph.digest, start),
            "the ranges": digest(ranges),
            "the objectives": digest(self.objectives),
            "settings and inputs": digest(
                sorted(settings.items()), time, sorted(inputs), *inputs.values()
            ),
        }

    def parameters(self, shares: Array) -> dict[str, float]:
        """Return the values of the parameters by name, at shares of their ranges, shape (p,)."""
        pairs = zip(self.ranges, shares, strict=True)
        return {one.name: float(one.between(share)) for one, share in pairs}

    def nominal(self) -> Array:
        """Return the objectives, shape (m,), at nominal parameters, with signs as in `evaluate`."""
        time, inputs, settings = self._conditions
        signals = self._model.run(time, inputs, settings).signals
        return np.array(
            [min(one.sign * signals[name][-1] for name in one.outputs) for one in self.objectives]
        )

    def evaluate(self, shares: Array) -> tuple[list[Array], list[Array]]:
        """Return the outputs of each objective and their derivatives with respect to the shares.

        Outputs that are minimised change their sign, so that more is always better.

        Parameters
        ----------
        shares : ndarray, shape (p,)

        Returns
        -------
        values : list of ndarray, shape (k,)
            The k outputs of each objective.
        slopes : list of ndarray, shape (k, p)
            Their derivatives.

        Raises
        ------
        UserError
            If the simulation fails.
        """
        key = np.asarray(shares, dtype=float).tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1]
        time, inputs, settings = self._conditions
        run = self._model.run(time, inputs, settings | self.parameters(shares))
        self.evaluations += 1
        # chain rule: derivatives by parameters times those of parameters by their shares
        by_share = np.array(
            [_slope_by_share(one, share) for one, share in zip(self.ranges, shares, strict=True)]
        )
        values = []
        slopes = []
        for objective in self.objectives:
            ends = [run.signals[name][-1] for name in objective.outputs]
            by_parameter = [run.sensitivities[name][-1] for name in objective.outputs]
            values.append(objective.sign * np.array(ends))
            slopes.append(objective.sign * np.array(by_parameter) * by_share)
        self._last = key, (values, slopes)
        return values, slopes

    def forget(self) -> None:
        """Forget the last run, so that the next one counts as an evaluation in any case."""
        self._last = None

    def worst(self, shares: Array) -> Array:
        """Return the worst output of each objective, shape (m,); -inf if the run fails."""
        try:
            values, _ = self.evaluate(shares)
        except UserError:
            return np.full(len(self.objectives), -np.inf)
        return np.nan_to_num(np.array([one.min() for one in values]), nan=-np.inf, posinf=-np.inf)


def _slope_by_share(one: Range, share: float) -> float:
    """Return the derivative of a parameter with respect to its share of the range.

    It is ``high - low``, or ``p ln(high / low)`` of a logarithmic range, ``p = low (high/low)^s``.
    """
    low, high = one.values
    if one.logarithmic:
        return float(one.between(np.array(share))) * float(np.log(high / low))
    return float(high - low)
