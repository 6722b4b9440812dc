"""Pareto front of an optimisation, with its table and JSON."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit.arrays import Array, Mask
from fmus.kit.units import convert
from orchestration.reporting import Displayable, one_line

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType

    from orchestration.sweeps.pareto.objectives import Objectives


@dataclass(frozen=True, repr=False)
class Front(Displayable):
    """Points of which none is dominated by another.

    Attributes
    ----------
    model : str
    objectives : dict of str to str
        Unit by objective, m of them.
    maximised : tuple of bool, shape (m,)
    values : ndarray, shape (k, m)
        Objectives of k points, in their units and in order of the first objective.
    parameters : dict of str to ndarray, shape (k,)
        In the model's units.
    units : dict of str to str
        Unit by parameter.
    display : dict of str to str
        Display unit by objective and parameter.
    nominal : ndarray, shape (m,)
        Objectives of the model with its nominal parameters.
    evaluations : int
        Number of simulations of the search.
    """

    model: str
    objectives: dict[str, str]
    maximised: tuple[bool, ...]
    values: Array
    parameters: dict[str, Array]
    units: dict[str, str]
    display: dict[str, str]
    nominal: Array
    evaluations: int

    @classmethod
    def of(cls, objectives: Objectives, shares: Array) -> Front:
        """Return the front of points, without those that are dominated.

        Parameters
        ----------
        objectives : Objectives
        shares : ndarray, shape (n, p)
            Points as shares of the ranges of the parameters.
        """
        values = np.array([objectives.worst(point) for point in shares])
        members = np.flatnonzero(undominated(values))
        order = members[np.argsort(values[members, 0])]
        signs = np.array([one.sign for one in objectives.objectives])
        points = [objectives.parameters(point) for point in shares[order]]
        names = [one.name for one in objectives.ranges]
        return cls(
            model=objectives.model_name,
            objectives={one.name: one.unit for one in objectives.objectives},
            maximised=tuple((signs > 0.0).tolist()),
            values=signs * values[order],
            parameters={name: np.array([p[name] for p in points]) for name in names},
            units={one.name: one.unit for one in objectives.ranges},
            display=objectives.display,
            nominal=signs * objectives.nominal(),
            evaluations=objectives.evaluations,
        )

    def __repr__(self) -> str:
        return one_line(f"front of {self.model}, {len(self.values)} points: {self.objectives}")

    def overview(self) -> Iterable[RenderableType]:
        """Yield a line on the front and its table."""
        from orchestration.reporting import plain_table

        count = len(self.values)
        points = "1 point" if count == 1 else f"{count} points"
        yield f"{self.model}: {points} by {self.evaluations:,} simulations"
        names = [*self.objectives, *self.parameters]
        table = plain_table(None, *names, right=names)
        nominal = [f"{self.shown(name, v):.5g}" for name, v in self.by_objective(self.nominal)]
        table.add_row(*nominal, *["as it is"] * len(self.parameters))
        columns = [*self.by_objective(self.values.T), *self.parameters.items()]
        for row in zip(*(self.shown(name, column) for name, column in columns), strict=True):
            table.add_row(*(f"{value:.5g}" for value in row))
        yield table
        units = {name: self.display[name] for name in names}
        yield "in " + ", ".join(f"{name} {unit}" for name, unit in units.items() if unit != "1")

    def to_dict(self) -> dict[str, Any]:
        """Return a dictionary for JSON."""
        return {
            "model": self.model,
            "objectives": [
                {"name": name, "unit": unit, "maximised": up}
                for (name, unit), up in zip(self.objectives.items(), self.maximised, strict=True)
            ],
            "parameters": self.units,
            "nominal": self.nominal.tolist(),
            "points": [
                {
                    "objectives": dict(zip(self.objectives, row, strict=True)),
                    "parameters": {name: float(p[k]) for name, p in self.parameters.items()},
                }
                for k, row in enumerate(self.values.tolist())
            ],
            "evaluations": self.evaluations,
        }

    def to_frame(self) -> pandas.DataFrame:
        """Return a DataFrame with a row per point: objectives, then parameters."""
        import pandas

        columns = dict(zip(self.objectives, self.values.T, strict=True))
        return pandas.DataFrame(columns | self.parameters)

    def by_objective(self, values: Array) -> list[tuple[str, Array]]:
        """Return pairs of an objective and its values, from values of shape (m, ...)."""
        return list(zip(self.objectives, values, strict=True))

    def shown(self, name: str, values: Array) -> Array:
        """Return values of an objective or a parameter in its display unit."""
        return convert(values, {**self.objectives, **self.units}[name], self.display[name])


def undominated(values: Array) -> Mask:
    """Return a mask of the points that no other point dominates.

    A point dominates another one if it is as good in all objectives, and better in at least one.

    Parameters
    ----------
    values : ndarray, shape (k, m)
        Objectives, of which more is better.

    Returns
    -------
    ndarray of bool, shape (k,)
        Of equal points only the first is in the mask.
    """
    mask = np.ones(len(values), dtype=bool)
    for k, one in enumerate(values):
        others = np.delete(values, k, axis=0)
        better = (others >= one).all(axis=1) & (others > one).any(axis=1)
        equal = (values[:k] == one).all(axis=1).any()
        mask[k] = not better.any() and not equal
    return mask
