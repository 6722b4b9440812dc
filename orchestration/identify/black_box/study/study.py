"""Black-box models of a record: which structure and orders, and what there is to say of the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fmus.kit import files
from orchestration.identify.black_box.data import InputOutputData
from orchestration.identify.black_box.excitation import pexcit
from orchestration.identify.black_box.models.linear import LinearModel
from orchestration.identify.black_box.order_search import (
    STRUCTURES,
    OrderSearch,
    Row,
    search_orders,
)
from orchestration.identify.black_box.residual_tests import ResidualTests
from orchestration.identify.black_box.study.columns import Columns
from orchestration.identify.black_box.study.component import source
from orchestration.identify.metrics import number
from orchestration.reporting.plain import preformatted


@dataclass(frozen=True)
class BlackBox:
    """What `study` found.

    Attributes
    ----------
    columns : Columns
    search : OrderSearch
        Every model that was tried, identified from the first part of the record.
    estimation, validation : InputOutputData
        The first part, and the rest.
    """

    columns: Columns
    search: OrderSearch
    estimation: InputOutputData
    validation: InputOutputData

    @property
    def chosen(self) -> Row:
        """The model that the criterion prefers."""
        return self.search.chosen

    @property
    def model(self) -> LinearModel:
        """The model that is preferred; its transfer functions are `control` objects."""
        return self.chosen.identification.model

    @cached_property
    def residual_tests(self) -> ResidualTests:
        """Whether the residual of the chosen model is white and independent of the inputs."""
        return self.chosen.identification.residual_tests()

    @cached_property
    def excitation(self) -> dict[str, int]:
        """Order to which every input excites persistently (thesis, eq. 3.16)."""
        data = self.estimation
        return {
            name: pexcit(values)
            for name, values in zip(data.input_names, data.inputs.T, strict=True)
        }

    @property
    def sentence(self) -> str:
        """The result in a sentence."""
        row, tests = self.chosen, self.residual_tests
        says = "is white and independent of the inputs" if tests.passed else "still holds structure"
        article = "A" if row.structure == "BJ" else "An"
        return (
            f"{article} {row.structure} model follows the part of {self.columns.path.name} that it has not seen by "
            f"{row.validation_fit:.1f} %, free running; its one-step residual {says}."
        )

    def __str__(self) -> str:
        return "\n".join(
            [self.sentence, "", self.search.table(), "", self.chosen.identification.summary()]
        )

    def __repr__(self) -> str:
        row = self.chosen
        return f"<BlackBox {row.structure}: {row.validation_fit:.1f} % on unseen data>"

    def _repr_html_(self) -> str:
        return preformatted(str(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON; numbers in the units of the file."""
        found, tests = self.chosen.identification, self.residual_tests
        return {
            "record": {
                "file": self.columns.path.name,
                "samples": len(self.columns.data),
                "step": self.model.step,
                "estimated_from": len(self.estimation),
                "notes": [*self.columns.notes],
            },
            "inputs": {
                n: {"unit": self.columns.units[n], "excitation": self.excitation[n]}
                for n in self.estimation.input_names
            },
            "output": {
                "name": self.model.output_name,
                "unit": self.columns.units[self.model.output_name],
            },
            "criterion": self.search.criterion,
            "models": [_row(row) for row in self.search.rows],
            "left_out": [*self.search.left_out],
            "chosen": _row(self.chosen)
            | {
                "parameters": {
                    p.name: {"value": p.value, "standard_error": number(p.standard_error)}
                    for p in found.parameters
                },
                "noise_variance": found.model.noise_variance,
                "white": tests.whiteness.is_white,
                "independent_of": {
                    n: c.is_independent
                    for n, c in zip(self.estimation.input_names, tests.inputs, strict=True)
                },
                "poles": {
                    n: [_complex(z) for z in self.model.s_plane_poles(n)]
                    for n in self.estimation.input_names
                },
                "zeros": {
                    n: [_complex(z) for z in self.model.s_plane_zeros(n)]
                    for n in self.estimation.input_names
                },
                "messages": [*found.messages],
            },
        }

    def report(self, path: str | Path) -> Path:
        """Write a page: table of structures, free run, residual tests, s-plane, parameters.

        Raises
        ------
        UserError
            If it cannot be written.
        """
        from orchestration.identify.black_box.study import page

        return page.write(self, Path(path))

    def export(self, path: str | Path, name: str = "") -> Path:
        """Write the chosen model as a class, of which ``ppy build file.py:Class`` makes FMUs.

        Parameters
        ----------
        path : str or Path
            ``file.py``; the model is called after it unless named.
        name : str

        Raises
        ------
        UserError
            If it cannot be written.
        """
        target = Path(path)
        row = self.chosen
        doc = f"{row.structure} model of {self.model.output_name}, identified from {self.columns.path.name}."
        files.write(
            target, source(self.model, name or target.stem, self.columns.units, doc).encode()
        )
        return target


def _row(row: Row) -> dict[str, Any]:
    return {
        "structure": row.structure,
        "path_orders": [*row.path_orders],
        "noise_order": row.noise_order,
        "fit": number(row.fit),
        "validation_fit": number(row.validation_fit),
        "aic": row.aic,
        "bic": row.bic,
    }


def _complex(z: complex) -> list[float]:
    return [float(z.real), float(z.imag)]


def study(
    columns: Columns,
    share: float = 0.5,
    structures: Sequence[str] = STRUCTURES,
    path_orders: Sequence[int] = (1, 2, 3),
    noise_orders: Sequence[int] = (1, 2, 3),
    delays: int | Sequence[int] = 1,
    criterion: str = "BIC",
    progress: Callable[[int, int], None] = lambda done, whole: None,
) -> BlackBox:
    """Identify models of every structure and order from the first part of a record, and judge them by the rest.

    Parameters
    ----------
    columns : Columns
    share : float
        Of the record that models are identified from.
    structures, path_orders, noise_orders, delays, criterion, progress
        See :func:`search_orders`.

    Returns
    -------
    BlackBox

    Raises
    ------
    UserError
        If there is no such structure or criterion, or no model can be identified.
    """
    estimation, validation = columns.data.split(share)
    found = search_orders(
        estimation, validation, structures, path_orders, noise_orders, delays, criterion, progress
    )
    return BlackBox(columns, found, estimation, validation)
