"""History of a rig for its page: extremes of each signal in parts of a span, gaps and events."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from orchestration.rig.archive import Archive

PARTS = 900  # of a span, as a curve has points on a wide screen
_EVENTS = 500  # the newest ones of a span


def history(folder: Path, begin: float | None = None, end: float | None = None) -> dict[str, Any]:
    """Return what an archive holds in a span of time, for a picture.

    Parameters
    ----------
    folder : Path
    begin, end : float, optional
        Wall times in s since 1970; default all there is.

    Returns
    -------
    dict
        The span and that of the whole archive, signals, gaps and events, as JSON can hold them.

    Raises
    ------
    UserError
        If there is no archive with samples.
    """
    archive = Archive(folder)
    spans = archive.spans()
    whole = [spans[0].begin, spans[-1].end]
    begin = whole[0] if begin is None else begin
    end = whole[1] if end is None else end
    contents = archive.contents(begin, end)
    signals = []
    for role in ("inputs", "outputs"):
        for name, unit in contents["rig"][role].items():
            curves = archive.extremes(name, begin, max(end, begin + 1e-3), PARTS)
            time, low, high = (curve.tolist() for curve in curves)
            about = {"name": name, "unit": unit, "role": role}
            signals.append({**about, "time": time, "low": low, "high": high})
    return {
        "span": [begin, end],
        "whole": whole,
        "signals": signals,
        "gaps": contents["gaps"],
        "events": contents["events"][-_EVENTS:],
        "omitted": max(0, len(contents["events"]) - _EVENTS),
    }
