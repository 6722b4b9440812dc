"""Comparison and fit from Python: ``ppy.compare`` and ``ppy.fit``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.kit import Component
from orchestration.api.records import matching_record
from orchestration.api.simulation import as_model, values_of
from orchestration.fmu.model import Model
from orchestration.identify import comparison
from orchestration.identify.comparison import Comparison
from orchestration.identify.grey_box import Fit
from orchestration.records import Record


def compare(
    record: Record | str | Path,
    model: Model | type[Component] | str = "ppy_actuator",
    *,
    fit: Sequence[str] = (),
    settings: Mapping[str, float | str] | None = None,
    mapping: Mapping[str, str] | None = None,
    workers: int = 1,
) -> Comparison:
    """Hold a model against a measured record: fit in percent, RMS error, whiteness of the residual.

    Parameters
    ----------
    record : Record, str or Path
        From `read_record`, or a file.
    model : Model, type[Component] or str
        A component, any FMU, ``path/to/file.py:Class``, or a class such as ``diagnose(...).model``.
    fit : sequence of str
        Parameters to recalibrate first.
    settings : Mapping of str to float or str, optional
        Values that replace defaults.
    mapping : Mapping of str to str, optional
        Column of a file to signal of the model.
    workers : int
        Processes that run an FMU without equations side by side in a fit.

    Returns
    -------
    Comparison

    Raises
    ------
    UserError
        If the record or the model cannot be used, or a parameter is unknown.

    Examples
    --------
    >>> import orchestration as ppy
    >>> from orchestration.rig.emulator.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "clean.csv")
    >>> compared = ppy.compare("clean.csv", fit=["R1", "R2", "C"])
    >>> bool(compared.after["voltage"].fit_percent > compared.before["voltage"].fit_percent)
    True
    """
    subject = as_model(model)
    given = values_of(subject, settings)
    return comparison.compare(
        subject, matching_record(record, subject, mapping), given, fit, workers=workers
    )


def fit(
    record: Record | str | Path,
    model: Model | type[Component] | str,
    names: Sequence[str],
    *,
    settings: Mapping[str, float | str] | None = None,
    mapping: Mapping[str, str] | None = None,
    workers: int = 1,
) -> Fit:
    """Fit parameters so that the free-running simulation follows a record (output error).

    Derivatives are exact where the equations of the model are known, and differences of runs of its FMU elsewhere.

    Parameters
    ----------
    record : Record, str or Path
        From `read_record`, or a file.
    model : Model, type[Component] or str
        A component, any FMU, ``path/to/file.py:Class``, or a class such as ``diagnose(...).model``.
    names : sequence of str
        Parameters to fit; start values of states too where the equations are known.
    settings : Mapping of str to float or str, optional
        Values of others, and starting points of those to fit.
    mapping : Mapping of str to str, optional
        Column of a file to signal of the model.
    workers : int
        Processes that run an FMU without equations side by side in a fit.

    Returns
    -------
    Fit
        ``values``, ``intervals`` and ``warnings``; SI.

    Raises
    ------
    UserError
        If the record or the model cannot be used, or a parameter is unknown.

    Examples
    --------
    >>> import orchestration as ppy
    >>> from orchestration.rig.emulator.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "clean.csv")
    >>> fitted = ppy.fit("clean.csv", "ppy_actuator", ["R1", "C"])
    >>> sorted(fitted.values)
    ['C', 'R1']
    """
    subject = as_model(model)
    given, data = values_of(subject, settings), matching_record(record, subject, mapping)
    inputs = {name: values for name, values in data.signals.items() if name in subject.inputs}
    measured = {name: values for name, values in data.signals.items() if name in subject.outputs}
    return comparison.fit_model(subject, data.time, inputs, measured, list(names), given, workers)
