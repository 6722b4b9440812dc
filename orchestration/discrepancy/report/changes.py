"""What changed from one record to a later one, as a table."""

from __future__ import annotations

from collections.abc import Sequence

from fmus.kit.units import shown
from orchestration.discrepancy.changes import Change
from orchestration.discrepancy.report import elements, typography
from orchestration.identify.estimate import Estimate

HEAD = ["parameter", "before", "after", "gain", "verdict"]


def plain_rows(found: Sequence[Change]) -> list[list[str]]:
    """Rows for a terminal: every parameter in both records, those that changed first."""
    rows = []
    for change in found:
        values = (shown(value, change.declaration) for value in (change.before, change.after))
        name = f"{change.name} ({change.effect})" if change.effect else change.name
        rows.append([name, *values, _gain(change), _verdict(change)])
    return rows


def page_rows(found: Sequence[Change]) -> list[list[str]]:
    """Rows for a page: the same with intervals and what the parameters are."""
    rows = []
    for change in found:
        p = change.declaration
        records = (change.before, change.before_interval), (change.after, change.after_interval)
        estimates = [
            typography.estimate(Estimate(value, value, ends, p.unit), p) for value, ends in records
        ]
        cells = [elements.two(value, interval) for value, interval, _ in estimates]
        verdict = elements.chip("differs", _verdict(change)) if change.changed else _verdict(change)
        rows.append(
            [elements.two(change.name, change.effect or p.doc), *cells, _gain(change), verdict]
        )
    return rows


def _gain(change: Change) -> str:
    return "" if change.gain is None else f"{100 * change.gain:.1f} %"


def _verdict(change: Change) -> str:
    if change.changed:
        return "changed"
    return "uncertain" if change.uncertain else "not claimed"
