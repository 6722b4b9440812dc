"""Files of a reference result, in the form of the FMI cross-check."""

from collections.abc import Iterable, Sequence
from pathlib import Path

Rows = Iterable[Sequence[float]]


def write_rows(path: Path, signals: Iterable[str], rows: Rows) -> None:
    """Write a table of numbers over time.

    Parameters
    ----------
    path : Path
        Of the file.
    signals : iterable of str
        Names of the columns after the time.
    rows : iterable of sequence of float
        The time and the values, SI.
    """
    lines = [",".join(("time", *signals)), *(",".join(f"{v:.12g}" for v in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def write_options(path: Path, stop: float, step: float, solver: str) -> None:
    """Write how a reference result was made.

    Parameters
    ----------
    path : Path
        Of the file.
    stop, step : float
        Stop time and step of the rows, s.
    solver : str
        What computed it.
    """
    options = {
        "StartTime": 0,
        "StopTime": stop,
        "StepSize": step,
        "RelTol": 1e-7,
        "AbsTol": 1e-9,
        "SolverType": solver,
        "OutputIntervalLength": step,
    }
    lines = [f"{key},{value}" for key, value in options.items()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
