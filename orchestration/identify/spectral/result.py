"""Frequency responses of a record as text, tables, pictures and figures."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import files
from fmus.kit.errors import UserError, suggestion
from fmus.kit.units import printed, write_prefixed
from orchestration.identify.spectral.response import Response
from orchestration.records import Repair
from orchestration.reporting import Displayable, one_line, plain_table

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType
    from rich.table import Table

_ROWS = 9  # of a response in a text
_WHOLE = 1e6  # below which a number has no power of ten


@dataclass(frozen=True)
class FrequencyResponse(Displayable):
    """Frequency responses that were estimated from a record, with those of a model.

    Attributes
    ----------
    source : str
        Name of the record.
    model : str
        Name of the model; empty without one.
    samples : int
        That were used.
    step : float
        Sample period, s.
    responses : Mapping of str to Response
        By ratio, such as ``voltage/current``.
    notes : tuple of str
        Method of estimation, a sentence for each input.
    repairs : tuple of Repair
        Repairs and remarks from reading the record.
    """

    source: str
    model: str
    samples: int
    step: float
    responses: Mapping[str, Response]
    notes: tuple[str, ...]
    repairs: tuple[Repair, ...] = ()

    def __getitem__(self, ratio: str) -> Response:
        """Return the response of a ratio such as ``voltage/current``."""
        if ratio not in self.responses:
            raise UserError(f"{ratio}: no such response{suggestion(ratio, self.responses)}")
        return self.responses[ratio]

    def __repr__(self) -> str:
        beside = f" beside {self.model}" if self.model else ""
        return one_line(f"FrequencyResponse {', '.join(self.responses)}: {self.source}{beside}")

    def overview(self) -> Iterator[RenderableType]:
        """Yield the text of ``ppy frequency``: a table of every response, and the omitted lines."""
        against = f" against {self.model}" if self.model else ""
        yield f"{self.source}{against}: {self.samples} samples of {self.step:.6g} s"
        for response in self.responses.values():
            yield ""
            yield _table(response)
            if response.agrees is not None and response.agrees.size:
                yield (
                    f"the model is within the 95 % region at {response.agrees.sum()} of"
                    f" {response.agrees.size} frequencies"
                )
            unseen = int(np.count_nonzero(~response.seen))
            if unseen:
                yield f"lost in noise at {unseen} of {response.seen.size} frequencies"
            yield from _describe_omissions(response)
        yield ""
        yield from self.notes

    def to_frame(self) -> pandas.DataFrame:
        """Return all responses as a table, a row for each ratio and frequency.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        frames = {name: pandas.DataFrame(one.columns()) for name, one in self.responses.items()}
        made = pandas.concat(frames, names=["response", "line"]).reset_index("line", drop=True)
        return made.set_index("frequency", append=True)

    def to_csv(self, path: str | Path) -> Path:
        """Write all responses as CSV, a row for each ratio and frequency, in its unit.

        Raises
        ------
        UserError
            If it cannot be written.
        """
        # by column; a column in the unit of the response has none of its own
        headings: dict[str, str] = {}
        for response in self.responses.values():
            for name in response.columns():
                unit = response.unit_of(name)
                headings[name] = f"{name} [{unit}]" if unit in ("Hz", "deg") else name
        text = io.StringIO()
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(["response", "unit", *headings.values()])
        for ratio, response in self.responses.items():
            columns = response.columns()
            for k in range(response.frequency.size):
                cells = [
                    repr(float(columns[name][k])) if name in columns else "" for name in headings
                ]
                rows.writerow([ratio, response.unit, *cells])
        files.write(Path(path), text.getvalue().encode())
        return Path(path)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON, as ``ppy frequency --json`` writes them."""
        return {
            "record": {
                "file": self.source,
                "samples": self.samples,
                "step": self.step,
                "notes": [repair.message for repair in self.repairs],
            },
            "model": self.model or None,
            "responses": {name: one.to_dict() for name, one in self.responses.items()},
            "notes": [*self.notes],
        }


def _table(response: Response) -> Table:
    """Return a table of a response at some frequencies, evenly spaced on a logarithmic scale."""
    names = ["magnitude", "phase", *list(response.quantities)[2:]]
    headings = [f"{name.replace('_', ' ')} ± 95 %" for name in names]
    beside = ["model"] if response.model is not None else []
    title = f"{response.name} [{printed(response.unit)}]"
    table = plain_table(title, "frequency", *headings, *beside, right=(*headings, *beside))
    for k in _lines_to_show(response):
        cells = []
        for name in names:
            one = response.quantities[name]
            unit = "°" if name == "phase" else ""
            half = _write_number(one.high[k] - one.value[k], 2)
            cells.append(f"{_write_number(one.value[k], 4)}{unit} ± {half}{unit}")
        if response.model is not None:
            magnitude = _write_number(abs(response.model[k]), 4)
            cells.append(f"{magnitude}, {_write_number(response.model_phase[k], 4)}°")
        table.add_row(write_prefixed(float(response.frequency[k]), "Hz"), *cells)
    return table


def _write_number(value: float, digits: int) -> str:
    """Write a number to `digits` digits, but below a million without a power of ten."""
    return f"{value:.0f}" if 10.0**digits <= abs(value) < _WHOLE else f"{value:.{digits}g}"


def _lines_to_show(response: Response) -> list[int]:
    """Return the indices of at most `_ROWS` lines, evenly spaced on a logarithmic scale."""
    count = response.frequency.size
    if count <= _ROWS:
        return list(range(count))
    wanted = np.geomspace(response.frequency[0], response.frequency[-1], _ROWS)
    nearest = np.abs(np.log(response.frequency[:, np.newaxis] / wanted)).argmin(axis=0)
    return sorted(set(nearest.tolist()))


def _describe_omissions(response: Response) -> Iterator[str]:
    """Yield a sentence for every reason for which lines were left out."""
    for reason, lines in response.left_out.items():
        ends = [write_prefixed(float(end), "Hz") for end in (lines.min(), lines.max())]
        where = ends[0] if lines.size == 1 else f"{lines.size} lines, {ends[0]} … {ends[1]}"
        yield f"left out: {where}: {reason}"
