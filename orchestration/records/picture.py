"""Picture of a record."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kit import UserError
from orchestration.records.record import Record
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@draw.register(Record)
def draw_record(record: Record) -> Figure:
    """Draw every signal over time, one panel each.

    Raises
    ------
    UserError
        If it has no samples or no signals.
    """
    if not (record.time.size and record.signals):
        raise UserError(f"{record.source}: no samples or no signals, so there is nothing to draw")
    figure, axes = pictures.panels(len(record.signals), record.source.name)
    for axis, (name, values) in zip(axes, record.signals.items(), strict=True):
        axis.plot(record.time, values, color=pictures.MEASURED, lw=1)
        pictures.fit_values(axis)
        pictures.label(axis, name, record.units[name])
    pictures.logarithmic(axes, record.time)
    return figure
