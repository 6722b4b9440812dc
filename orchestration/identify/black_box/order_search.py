"""Order search: every structure with a grid of orders, compared as in the thesis' table 3-2."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

from fmus.kit.errors import UserError, suggestion
from orchestration.identify.black_box.data import InputOutputData
from orchestration.identify.black_box.delays import estimate_delays
from orchestration.identify.black_box.estimation import identify
from orchestration.identify.black_box.models import PolynomialModel
from orchestration.identify.black_box.orders import Count, Orders, one_per_input, orders, whole
from orchestration.identify.black_box.result import Identification
from orchestration.identify.black_box.subspace import state_space

STRUCTURES = ("ARX", "ARMAX", "OE", "SS", "BJ")
CRITERIA = ("AIC", "BIC")
# Of an order. Roots drawn evenly in a disc of radius 0.97 come back from their polynomial within
# 1e-6 at order 50, but with errors of some tenths at order 100.
_HIGHEST = 50
_MOST = 10_000  # combinations of orders
# Percent of fit over validation data by which a sound model may stay behind a degenerate one.
_AS_WELL = 1.0


class _Trial(NamedTuple):
    """A structure with its orders, to be identified."""

    structure: str
    path_orders: tuple[int, ...]
    noise_order: int

    def __str__(self) -> str:
        return f"{self.structure} of order {' '.join(map(str, self.path_orders))}"


@dataclass(frozen=True)
class Row:
    """One model of an order search, and a line of its table.

    Attributes
    ----------
    structure : str
    path_orders : tuple of int
        Order of the path from every input, that is of its denominator; the number of states alone
        for SS.
    noise_order : int or None
        Of the noise model C/(A D), so that ARX, whose noise passes 1/A, has that of its paths; None
        for SS, which has a constant gain.
    identification : Identification
    fit, validation_fit : float
        Free run over identification and validation data, in percent.
    aic, bic : float
        Per sample, of the same samples for all rows.
    """

    structure: str
    path_orders: tuple[int, ...]
    noise_order: int | None
    identification: Identification
    fit: float
    validation_fit: float
    aic: float
    bic: float

    def describe_passed_over(self) -> str:
        """Return why the row is passed over, in a line."""
        doubts = self.identification.doubts or ("it has a pole at one without need",)
        title = _Trial(self.structure, self.path_orders, 0)
        return f"{title}, {self.validation_fit:.1f} % on unseen data: {'; '.join(doubts)}"

    @property
    def cells(self) -> list[str]:
        """Cells of a table: fits, criteria, an order for each input, that of the noise model."""
        inputs = len(self.identification.model.input_names)
        paths = [str(order) for order in self.path_orders]
        return [
            self.structure,
            f"{self.fit:.1f}",
            f"{self.validation_fit:.1f}",
            f"{self.aic:.2f}",
            f"{self.bic:.2f}",
            *paths,
            *[""] * (inputs - len(paths)),
            "constant" if self.noise_order is None else str(self.noise_order),
        ]


@dataclass(frozen=True)
class OrderSearch:
    """All models of an order search.

    Attributes
    ----------
    rows : tuple of Row
    criterion : str
        AIC or BIC.
    left_out : tuple of str
        A line for each that could not be identified.
    delays : tuple of int, length m
        From every input to the output, in samples.
    """

    rows: tuple[Row, ...]
    criterion: str
    left_out: tuple[str, ...]
    delays: tuple[int, ...]

    def _criterion(self, row: Row) -> float:
        return row.aic if self.criterion == "AIC" else row.bic

    @property
    def chosen(self) -> Row:
        """The first of :attr:`ranked`."""
        return self.ranked[0]

    @property
    def ranked(self) -> tuple[Row, ...]:
        """The best row of every structure, the best free run over validation data first.

        Among fits that are equal to a tenth of a percent, the criterion decides. A row that is
        passed over is not the first.
        """
        ranked = self._by_fit()
        first = _preferred(ranked)
        return (first, *(row for row in ranked if row is not first))

    @property
    def best(self) -> tuple[Row, ...]:
        """The row that the criterion prefers of every structure, in the order of the structures.

        Rows that are passed over are not among them.
        """
        return tuple(map(_preferred, self._by_structure()))

    @property
    def passed_over(self) -> tuple[Row, ...]:
        """Rows that are degenerate, or integrate, and follow unseen data no better than others.

        They are those that the criterion preferred of their structure, and the one with the best
        free run of all structures.
        """
        candidates = [*self._by_structure(), self._by_fit()]
        return tuple(rows[0] for rows in candidates if rows[0] is not _preferred(rows))

    def _by_structure(self) -> list[list[Row]]:
        """Return the rows of every structure, in the order of the criterion."""
        rows = sorted(self.rows, key=self._criterion)
        groups = ([row for row in rows if row.structure == name] for name in STRUCTURES)
        return [group for group in groups if group]

    def _by_fit(self) -> list[Row]:
        """Return the best row of every structure in the order of free runs over validation data."""
        return sorted(
            self.best, key=lambda row: (-round(row.validation_fit, 1), self._criterion(row))
        )

    def lines(self, rows: Sequence[Row] | None = None) -> list[list[str]]:
        """Return the head and the cells of rows; by default of the best of every structure."""
        inputs = self.rows[0].identification.model.input_names
        head = ["Model type", "% fit ID data", "% fit validation data", "AIC", "BIC"]
        orders = [f"{name} model order" for name in inputs]
        return [[*head, *orders, "Noise model order"], *(row.cells for row in rows or self.best)]

    def table(self, rows: Sequence[Row] | None = None) -> str:
        """Lay rows out like the thesis' table 3-2, with BIC in a column of its own.

        Parameters
        ----------
        rows : sequence of Row, optional
            By default the best of every structure.

        Returns
        -------
        str
            Lines of equal length.
        """
        lines = self.lines(rows)
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        aligned = [
            [cell.rjust(width) for cell, width in zip(line, widths, strict=True)] for line in lines
        ]
        return "\n".join("  ".join(line) for line in aligned)


def _preferred(rows: Sequence[Row]) -> Row:
    """Return the first row, or the first sound one that follows unseen data as well."""
    first = rows[0]
    if first.identification.is_sound:
        return first
    enough = first.validation_fit - _AS_WELL
    sound = (r for r in rows if r.identification.is_sound and r.validation_fit >= enough)
    return next(sound, first)


def search_orders(
    estimation: InputOutputData,
    validation: InputOutputData,
    structures: Sequence[str] = STRUCTURES,
    path_orders: Sequence[int] = (1, 2, 3),
    noise_orders: Sequence[int] = (1, 2, 3),
    nk: Count | None = 1,
    *,
    criterion: str = "BIC",
    progress: Callable[[int, int], None] = lambda done, whole: None,
) -> OrderSearch:
    """Identify every structure with every combination of orders, and compare the models.

    Every path has as many coefficients in its numerator as it has poles, and one more where its
    delay is zero. The denominator that ARX and ARMAX share has the highest order of any path; a
    state-space model, as many states as any combination has poles. C has the order of the noise
    model, and so has D where there is one.

    Parameters
    ----------
    estimation, validation : InputOutputData
    structures : sequence of str
        Of ARX, ARMAX, OE, SS and BJ.
    path_orders, noise_orders : sequence of int
        From 1 to 50: of a longer polynomial rounding leaves no roots (Wilkinson, The evaluation of
        the zeros of ill-conditioned polynomials, Numerische Mathematik 1, 1959).
    nk : int, sequence of int or None
        Delays in samples; estimated if None.
    criterion : str
        AIC or BIC, which chooses the orders of every structure. The thesis minimised AIC;
        BIC does not prefer ever larger models as records grow.
    progress : callable
        Called with the number of finished models, and the number of all.

    Returns
    -------
    OrderSearch

    Raises
    ------
    UserError
        If there is no such structure, criterion or order, there are too many combinations, or none
        of the models can be identified.
    """
    inputs = len(estimation.input_names)
    _check_known("structure", structures, STRUCTURES)
    _check_known("criterion", [criterion], CRITERIA)
    _check_grid(inputs, structures, path_orders, noise_orders)
    delays = (
        estimate_delays(estimation, path_orders, progress)
        if nk is None
        else one_per_input("delays", nk, inputs, 0)
    )
    planned: list[tuple[_Trial, Orders]] = []
    rows: list[Row] = []
    left_out: list[str] = []
    for trial in _grid(inputs, structures, path_orders, noise_orders):
        try:
            planned.append((trial, _orders_of_trial(estimation, trial, delays)))
        except UserError as error:
            left_out.append(f"{trial}: {error}")
    first = max((chosen.first for _, chosen in planned), default=0)
    for done, (trial, chosen) in enumerate(planned):
        progress(done, len(planned))
        try:
            contained = [
                row.identification for row in rows if _is_nested(chosen, row.identification)
            ]
            rows.append(_identify_row(estimation, validation, trial, chosen, first, contained))
        except UserError as error:
            left_out.append(f"{trial}: {error}")
    if not rows:
        raise UserError(f"no model can be identified; {left_out[0]}")
    return OrderSearch(tuple(rows), criterion, tuple(left_out), delays)


def _check_known(kind: str, names: Sequence[str], known: Sequence[str]) -> None:
    """Raise UserError if a name is not known."""
    for name in names:
        if name not in known:
            raise UserError(f"{kind} {name}: there is none{suggestion(name, known)}")


def _check_grid(
    inputs: int,
    structures: Sequence[str],
    path_orders: Sequence[int],
    noise_orders: Sequence[int],
) -> None:
    """Refuse an empty grid, and one too large."""
    if not (structures and path_orders and noise_orders):
        raise UserError(
            f"path orders {list(path_orders)}, noise orders {list(noise_orders)}, structures"
            f" {list(structures)}: at least one of each"
        )
    for kind, values in (("path order", path_orders), ("noise order", noise_orders)):
        for value in values:
            if whole(kind, value, 1) > _HIGHEST:
                raise UserError(
                    f"{kind} {value}: {_HIGHEST} at most; of a longer polynomial rounding leaves no"
                    " roots, which are the poles and zeros of a model"
                )
    combinations = len(set(path_orders)) ** inputs * len(set(noise_orders))
    if combinations > _MOST:
        raise UserError(
            f"{combinations:,} combinations of orders for {inputs} inputs: {_MOST:,} at most, for"
            " each is a search of its own"
        )


def _grid(
    inputs: int, structures: Sequence[str], path_orders: Sequence[int], noise_orders: Sequence[int]
) -> Iterator[_Trial]:
    """Yield every structure with every combination of orders that it has."""
    combinations = sorted(set(product(path_orders, repeat=inputs)))
    states = [(total,) for total in sorted({sum(path) for path in combinations})]
    # nested models come before those that contain them
    for structure in sorted(set(structures), key=STRUCTURES.index):
        paths = states if structure == "SS" else combinations
        noises = sorted(set(noise_orders)) if structure in ("ARMAX", "BJ") else [0]
        for path, noise in product(paths, noises):
            yield _Trial(structure, path, noise)


def _orders_of_trial(data: InputOutputData, trial: _Trial, nk: tuple[int, ...]) -> Orders:
    """Return the orders of every polynomial of a trial; raise if the data are too few for it."""
    path = trial.path_orders
    noise = trial.noise_order
    if trial.structure == "SS":
        return orders(data, 1, nk, nf=1)  # only for its delays and its first sample
    nb = [order + (delay == 0) for order, delay in zip(path, nk, strict=False)]
    if trial.structure in ("ARX", "ARMAX"):
        return orders(data, nb, nk, na=max(path), nc=noise)
    return orders(data, nb, nk, nf=path, nc=noise, nd=noise)


def _is_nested(chosen: Orders, identification: Identification) -> bool:
    """Return whether an identified model is nested in those of some orders."""
    model = identification.model
    return isinstance(model, PolynomialModel) and chosen.contains(model.orders)


def _identify_row(
    estimation: InputOutputData,
    validation: InputOutputData,
    trial: _Trial,
    chosen: Orders,
    first: int,
    contained: Sequence[Identification],
) -> Row:
    """Identify one model of the grid, and assess it."""
    if trial.structure == "SS":
        noise_order = None
        result = state_space(estimation, trial.path_orders[0], chosen.nk, first)
    else:
        noise_order = chosen.noise_order
        result = identify(estimation, trial.structure, chosen, first, contained)
    return Row(
        trial.structure,
        trial.path_orders,
        noise_order,
        result,
        fit=result.fit,
        validation_fit=result.model.fit(validation),
        aic=result.aic,
        bic=result.bic,
    )
