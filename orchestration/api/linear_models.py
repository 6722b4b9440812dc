"""Black-box identification from Python: ``ppy.black_box``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

from fmus.kit.extras import require
from orchestration.api.declaration import only, takes
from orchestration.api.forms import given_names, optional_seconds
from orchestration.api.options import BlackBoxKeywords, InputsOption, StudyKeywords
from orchestration.identify.black_box.study import BlackBox, read_columns, study
from orchestration.records import Arrays


@takes(InputsOption, BlackBoxKeywords)
def black_box(
    record: str | Path | Arrays,
    output: str,
    inputs: Sequence[str] = (),
    **options: Unpack[BlackBoxKeywords],
) -> BlackBox:
    """Identify discrete-time models of several structures and orders, and choose one.

    Parameters
    ----------
    record : str, Path, DataFrame or Mapping of str to array_like, shape (n,)
        CSV, Parquet, TDMS, MAT or LabVIEW text, or columns by ``name [unit]``; the first column is
        the time, or a sample count if a step is given.
    output : str
        Name of a column.

    Returns
    -------
    BlackBox
        ``model`` (transfer functions as `control` objects), ``search``, ``residual_tests``,
        ``report("page.html")``, ``export("file.py")`` for FMUs.

    Raises
    ------
    UserError
        If the file cannot be read or is not equally spaced, a column is missing, or no model can be
        identified.

    Examples
    --------
    >>> import numpy as np
    >>> import ppy_rig as ppy
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
    require("threadpoolctl")
    driving = given_names(inputs, "inputs =")
    source = Path(record) if isinstance(record, str) else record
    columns = read_columns(source, output, driving, optional_seconds(options["step"]))
    return study(columns, **only(StudyKeywords, options))
