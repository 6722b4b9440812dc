"""Black-box identification from Python: ``ppy.black_box``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from orchestration.identify.black_box.order_search import STRUCTURES
from orchestration.identify.black_box.study.columns import read_columns
from orchestration.identify.black_box.study.study import BlackBox, study


def black_box(
    record: str | Path,
    output: str,
    inputs: Sequence[str] = (),
    *,
    step: float | None = None,
    share: float = 0.5,
    structures: Sequence[str] = STRUCTURES,
    path_orders: Sequence[int] = (1, 2, 3),
    noise_orders: Sequence[int] = (1, 2, 3),
    delays: int | Sequence[int] = 1,
    criterion: str = "BIC",
    progress: Callable[[int, int], None] = lambda done, whole: None,
) -> BlackBox:
    """Identify discrete-time models of one output of a record, of several structures and orders, and choose one.

    Parameters
    ----------
    record : str or Path
        CSV, Parquet, TDMS, MAT or LabVIEW text; the first column is the time, or counts samples if a step is given.
    output : str
        A column.
    inputs : sequence of str, optional
        Columns; all but the first and the output unless given.
    step : float, optional
        Sample period in s, of a file that has no time.
    share : float
        Of the record that models are identified from; the rest judges them.
    structures : sequence of {"ARX", "ARMAX", "OE", "SS", "BJ"}
        Ljung's; SS is a subspace method, BJ has a denominator of its own for every input.
    path_orders, noise_orders : sequence of int
        Every combination is tried.
    delays : int or sequence of int
        From every input to the output, in samples; 0 where the output answers in the same sample.
    criterion : {"BIC", "AIC"}
    progress : callable
        Told how many models are done, and of how many.

    Returns
    -------
    BlackBox
        ``model`` (transfer functions as `control` objects), ``search``, ``residual_tests``, ``report("page.html")``,
        ``export("file.py")`` for FMUs.

    Raises
    ------
    UserError
        If the file is refused or not equally spaced, a column is not there, or no model can be identified.

    Examples
    --------
    >>> import numpy as np
    >>> import orchestration as ppy
    >>> rng = np.random.default_rng(1)
    >>> u, y = rng.normal(size=400), np.zeros(400)
    >>> for k in range(1, 400):
    ...     y[k] = 0.8 * y[k - 1] + 0.5 * u[k - 1]
    >>> table = np.column_stack([np.arange(400), u, y + 0.01 * rng.normal(size=400)])
    >>> np.savetxt("steps.csv", table, delimiter=",", header="time [s],u [V],y [mm]", comments="")
    >>> found = ppy.black_box("steps.csv", "y", path_orders=[1], noise_orders=[1])
    >>> found.chosen.structure, [round(float(abs(z)), 2) for z in found.model.poles("u")]
    ('OE', [0.8])
    """
    columns = read_columns(Path(record), output, inputs, step)
    return study(columns, share, structures, path_orders, noise_orders, delays, criterion, progress)
