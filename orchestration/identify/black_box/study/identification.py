"""A black-box study: models of a record in every structure and order, and the best of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import files
from orchestration.identify.black_box.data import InputOutputData
from orchestration.identify.black_box.excitation import pexcit
from orchestration.identify.black_box.models import IdentifiedModel
from orchestration.identify.black_box.order_search import OrderSearch, Row, search_orders
from orchestration.identify.black_box.orders import Count
from orchestration.identify.black_box.polynomials import Roots
from orchestration.identify.black_box.residual_tests import ResidualTests
from orchestration.identify.black_box.study.columns import Columns, without_outliers
from orchestration.identify.black_box.study.component import source
from orchestration.identify.metrics import finite_or_none
from orchestration.reporting import Displayable, one_line, option, plain_table

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType


@dataclass(frozen=True)
class BlackBox(Displayable):
    """The result of :func:`study`.

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
        """The model that follows unseen data best, free running; the criterion has its orders."""
        return self.search.chosen

    @property
    def model(self) -> IdentifiedModel:
        """The model that is preferred; its transfer functions are `control` objects."""
        return self.chosen.identification.model

    @cached_property
    def residual_tests(self) -> ResidualTests:
        """Tests of the chosen model's residual for whiteness and independence of the inputs."""
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
        row = self.chosen
        tests = self.residual_tests
        verdict = (
            "is white and independent of the inputs" if tests.passed else "still holds structure"
        )
        article = "A" if row.structure == "BJ" else "An"
        doubts = "; ".join(row.identification.doubts)
        return (
            f"{f'Doubtful: {doubts}. ' if doubts else ''}"
            f"{article} {row.structure} model follows the part of {self.columns.path.name} that it"
            f" has not seen by {row.validation_fit:.1f} %, free running; its one-step residual"
            f" {verdict}.{self._others}"
        )

    @property
    def _others(self) -> str:
        """The free runs of the other structures, the best first, in a sentence after a space."""
        others = [
            f"{row.structure} {row.validation_fit:.1f} %"
            + " (doubtful)" * bool(row.identification.doubts)
            for row in self.search.ranked[1:]
        ]
        return f" Others: {', '.join(others)}." if others else ""

    @property
    def passed_over(self) -> list[str]:
        """A line for each degenerate model that was passed over."""
        return [row.describe_passed_over() for row in self.search.passed_over]

    @property
    def remarks(self) -> list[str]:
        """Delays, inputs that rest, and models passed over and left out, a line for each."""
        names = self.estimation.input_names
        delays = (
            f"{name} {delay}" + f" ({delay * self.model.step:g} s)" * (delay > 0)
            for name, delay in zip(names, self.search.delays, strict=True)
        )
        return [
            f"delays in samples: {', '.join(delays)}",
            *([] if np.ptp(self.validation.inputs, axis=0).any() else [self._resting]),
            *(f"passed over: {line}" for line in self.passed_over),
            *(f"left out: {line}" for line in self.search.left_out),
        ]

    @property
    def _resting(self) -> str:
        """A line on unseen data in which nothing happens."""
        at = len(self.estimation)
        return (
            f"no input moves from sample {at} on, in the part that models have not seen: it judges"
            f" nothing but noise; {option('share')} sets where it begins"
        )

    def __str__(self) -> str:
        return "\n".join(
            [self.sentence, "", self.search.table(), "", self.chosen.identification.summary()]
        )

    def __repr__(self) -> str:
        row = self.chosen
        return one_line(f"BlackBox {row.structure}: {row.validation_fit:.1f} % on unseen data")

    def overview(self) -> Iterator[RenderableType]:
        """Yield the sentence, a table of the models and the coefficients, for notebooks."""
        yield self.sentence
        head, *rows = self.search.lines()
        yield plain_table("the best of every structure", *head, right=head[1:], rows=rows)
        chosen = self.chosen.identification
        yield plain_table(
            f"the {self.chosen.structure} model",
            *("coefficient", "value", "standard error"),
            rows=chosen.parameter_rows(),
        )
        yield from chosen.messages

    def to_frame(self) -> pandas.DataFrame:
        """Return the best model of every structure as a table, a row for each.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        return pandas.DataFrame([_row_figures(row) for row in self.search.best])

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON; numbers in the units of the file."""
        units = self.columns.units
        return {
            "record": {
                "file": self.columns.path.name,
                "samples": len(self.columns.data),
                "step": self.model.step,
                "estimated_from": len(self.estimation),
                "notes": [*self.columns.notes],
            },
            "inputs": {
                name: {"unit": units[name], "excitation": self.excitation[name], "delay": delay}
                for name, delay in zip(self.estimation.input_names, self.search.delays, strict=True)
            },
            "output": {
                "name": self.model.output_name,
                "unit": units[self.model.output_name],
            },
            "criterion": self.search.criterion,
            "models": [_row_figures(row) for row in self.search.rows],
            "passed_over": self.passed_over,
            "left_out": [*self.search.left_out],
            "chosen": _row_figures(self.chosen) | self._details(),
        }

    def _details(self) -> dict[str, Any]:
        """Return the figures of the chosen model beyond those that every row has."""
        identification = self.chosen.identification
        model = self.model
        tests = self.residual_tests
        inputs = self.estimation.input_names
        return {
            "parameters": {
                p.name: {"value": p.value, "standard_error": finite_or_none(p.standard_error)}
                for p in identification.parameters
            },
            "noise_variance": model.noise_variance,
            "white": tests.whiteness.is_white,
            "independent_of": {
                name: cross.is_independent for name, cross in zip(inputs, tests.inputs, strict=True)
            },
            "poles": {name: _real_and_imaginary(model.s_plane_poles(name)) for name in inputs},
            "zeros": {name: _real_and_imaginary(model.s_plane_zeros(name)) for name in inputs},
            "doubts": [*identification.doubts],
            "messages": [*identification.messages],
        }

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
        doc = (
            f"{self.chosen.structure} model of {self.model.output_name}, identified from"
            f" {self.columns.path.name}."
        )
        spreads = self.columns.data.inputs.std(axis=0)
        text = source(self.model, name or target.stem, self.columns.units, doc, spreads)
        files.write(target, text.encode())
        return target


def _row_figures(row: Row) -> dict[str, Any]:
    """Return the figures of one model of the search."""
    return {
        "structure": row.structure,
        "path_orders": [*row.path_orders],
        "noise_order": row.noise_order,
        "fit": finite_or_none(row.fit),
        "validation_fit": finite_or_none(row.validation_fit),
        "aic": row.aic,
        "bic": row.bic,
    }


def _real_and_imaginary(roots: Roots) -> list[list[float]]:
    """Return real and imaginary part of every root, as JSON has no complex numbers."""
    return np.column_stack([roots.real, roots.imag]).tolist()


def study(
    columns: Columns, share: float = 0.5, delays: Count | None = None, **options: Any
) -> BlackBox:
    """Identify models of every structure and order from the first part of a record.

    They are judged by the other part, the validation data. Bad readings of the output count in
    neither.

    Parameters
    ----------
    columns : Columns
    share : float
        Of the record that models are identified from.
    delays : int or sequence of int, optional
        In samples; estimated by default.
    **options
        Structures, orders, criterion and progress, as :func:`search_orders` takes them.

    Returns
    -------
    BlackBox

    Raises
    ------
    UserError
        If there is no such structure or criterion, or no model can be identified.
    """
    cleaned = without_outliers(columns)
    estimation, validation = cleaned.data.split(share)
    search = search_orders(estimation, validation, nk=delays, **options)
    return BlackBox(cleaned, search, estimation, validation)
