"""Page of a sweep: ranges of its numbers, influence of parameters, failures and reproduction."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray
from rich.table import Table

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.titles import capitalised, in_words
from fmus.kit.units import convert, printed, write_prefixed
from orchestration.reporting import option
from orchestration.reporting.html import Markup, Page, escaped
from orchestration.sweeps.reductions import REDUCTIONS
from orchestration.sweeps.sensitivity import failures, parameters_of
from orchestration.sweeps.storage import iterate_pieces

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TITLES = {
    "last": "{} at the end",
    "smallest": "smallest {}",
    "largest": "largest {}",
    "mean": "mean of {}",
    "rms": "root mean square of {}",
}
_NOTABLE = 0.3  # least rank correlation of a parameter in the verdict
_MENTIONS = 2  # most parameters in the verdict
_FEWEST = 8  # least number of cases for a correlation


class Extreme(NamedTuple):
    """The range of a number or a trace over all cases of a sweep."""

    name: str
    smallest: float
    largest: float
    unit: str

    def written(self, digits: int) -> list[str]:
        """Return smallest and largest value as text, with one prefix of the unit."""
        largest = max(abs(self.smallest), abs(self.largest))
        ends = (self.smallest, self.largest)
        return [write_prefixed(x, self.unit, digits, like=largest) for x in ends]

    @property
    def title(self) -> str:
        """Title for people."""
        output, _, reduction = self.name.rpartition("_")
        template = _TITLES.get(reduction, "")
        return template.format(in_words(output)) if template and output else in_words(self.name)


def extremes(data: xarray.Dataset) -> Iterator[Extreme]:
    """Yield the range of every number and trace of a sweep.

    Parameters
    ----------
    data : xarray.Dataset

    Yields
    ------
    Extreme
        For each variable with a finite value.
    """
    for name, array in data.items():
        if name == "failure":
            continue
        smallest = np.nan
        largest = np.nan
        for part in iterate_pieces(array):
            smallest = np.fmin(smallest, np.fmin.reduce(part, axis=None))
            largest = np.fmax(largest, np.fmax.reduce(part, axis=None))
        if np.isfinite(smallest):
            unit = array.attrs.get("display_units", array.units)
            low, high = convert(np.array([smallest, largest]), array.units, unit)
            yield Extreme(str(name), float(low), float(high), unit)


def sweep_page(
    data: xarray.Dataset,
    draw: Callable[[], Figure],
    tables: list[Table],
    command: str,
) -> Page:
    """Return the page of a sweep.

    Parameters
    ----------
    data : xarray.Dataset
        Outcomes of the sweep.
    draw : callable
        Draws the picture of the sweep, or raises a UserError if it has none.
    tables : list of rich.table.Table
        Tables of the analysis of the design.
    command : str
        Command that repeats the sweep.

    Returns
    -------
    Page
    """
    ranges = [*extremes(data)]
    about = Markup(f"Sweep of <code>{escaped(str(data.attrs['model']))}</code>")
    page = Page(_range_sentence(data, ranges), _verdict(data, ranges), about)
    page.heading("What comes out")
    rows = [[capitalised(e.title), *e.written(4)] for e in ranges]
    page.table(["over all cases", "smallest", "largest"], rows)
    for table in tables:
        _add_table(page, table)
    _add_picture(page, draw)
    page.heading("What to do next")
    page.items(_next_steps(data))
    page.heading("How sure this is")
    page.items(_certainty(data))
    page.heading("How it was found")
    page.table(["parameter", "from", "to"], [*_ranges(data)])
    page.text(f"Design: {in_words(str(data.attrs['design']))}, {in_words(data.attrs['engine'])}.")
    page.reproduction([], command)
    return page


def case_count(data: xarray.Dataset) -> int:
    """Return the number of cases of a sweep."""
    return int(np.prod([data.sizes[d] for d in data.dims if d != "time"]))


def _range_sentence(data: xarray.Dataset, ranges: list[Extreme]) -> str:
    """Return a sentence on the range of the first number."""
    cases = case_count(data)
    if not ranges:
        return f"Not one of the {cases:,} cases could be run."
    first = ranges[0]
    low, high = first.written(3)
    return f"{capitalised(first.title)} goes from {low} to {high} over {cases:,} cases."


def _verdict(data: xarray.Dataset, ranges: list[Extreme]) -> str:
    """Return a sentence on the parameters with the largest effect on the first number."""
    correlations = _correlations(data, ranges[0].name) if ranges else {}
    effects = [
        f"{'rises' if r > 0.0 else 'falls'} with {in_words(name)} (rank correlation {r:+.2f})"
        for name, r in sorted(correlations.items(), key=lambda item: -abs(item[1]))
        if abs(r) > _NOTABLE
    ]
    if effects:
        return f"It {' and '.join(effects[:_MENTIONS])}."
    return f"Swept: {', '.join(map(in_words, parameters_of(data)))}."


def _correlations(data: xarray.Dataset, name: str) -> dict[str, float]:
    """Return the rank correlation of a number with every parameter that varies."""
    from scipy.stats import rankdata

    value = data[name]
    if "time" in value.dims or value.size < _FEWEST:
        return {}
    correlations = {}
    for parameter in parameters_of(data):
        values, number = xarray.broadcast(data[parameter], value)
        finite = np.isfinite(number.values)
        x = rankdata(values.values[finite])
        y = rankdata(number.values[finite])
        if np.ptp(x) > 0.0 and np.ptp(y) > 0.0:
            correlations[parameter] = float(np.corrcoef(x, y)[0, 1])
    return correlations


def _add_table(page: Page, table: Table) -> None:
    """Add a table of the terminal to the page."""
    head = [str(column.header) for column in table.columns]
    columns = [[str(cell) for cell in column.cells] for column in table.columns]
    page.table(head, [list(row) for row in zip(*columns, strict=True)])


def _add_picture(page: Page, draw: Callable[[], Figure]) -> None:
    """Add the picture of the sweep to the page, if it has one."""
    try:
        figure = draw()
    except UserError:
        return
    page.heading("The picture")
    page.figure(figure, "What was kept of every case, over what was swept.")


def _next_steps(data: xarray.Dataset) -> list[str]:
    """Return suggestions for further sweeps, by the design of this one."""
    steps = {
        "grid": (
            "Find out which parameters matter most:"
            f" {option('kind', 'sobol-indices')}, or {option('kind', 'tornado')}."
        ),
        "tornado": "Sweep the parameters at the top of the tornado alone, on a finer grid.",
    }
    lines = [
        steps.get(str(data.attrs["design"]), "Sweep the parameters that matter alone, on a grid."),
        f"Keep the cases for other tools with {option('out', 'sweep.nc')}.",
    ]
    reasons = failures(data)
    return [f"Look at the {len(reasons)} cases that failed.", *lines] if reasons else lines


def _certainty(data: xarray.Dataset) -> list[str]:
    """Return sentences on the numbers of cases and failures, and on the reductions."""
    reasons = failures(data)
    lines = [f"{case_count(data):,} cases were run; {len(reasons)} of them failed."]
    if reasons:
        lines.append(f"The first: {reasons[0]}.")
    reductions = {str(name).rpartition("_")[2] for name in data} & set(REDUCTIONS)
    if reductions:
        lines.append(f"Of every trace the {', '.join(sorted(reductions))} was kept.")
    return [*lines, *str(data.attrs.get("remarks", "")).splitlines()]


def _ranges(data: xarray.Dataset) -> Iterator[list[str]]:
    """Yield every parameter with its smallest and largest value."""
    for name in parameters_of(data):
        values: Array = data[name].values
        unit = str(data[name].units)
        suffix = "" if unit == "1" else f" {printed(unit)}"
        yield [in_words(name), f"{values.min():g}{suffix}", f"{values.max():g}{suffix}"]
