"""Comparison and fit from Python: ``ppy.compare`` and ``ppy.fit``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

from orchestration.api.declaration import takes
from orchestration.api.forms import given_names
from orchestration.api.options import CompareKeywords, FitKeywords
from orchestration.api.records import Data, Records, matching_record, matching_runs
from orchestration.api.simulation import AnyModel, as_measured, values_of
from orchestration.fmu.model import built
from orchestration.identify import Comparison, Fit, comparison, read_assumptions
from orchestration.records import record_labels


@takes(CompareKeywords)
def compare(
    record: Data,
    model: AnyModel | None = None,
    **options: Unpack[CompareKeywords],
) -> Comparison:
    """Compare a model with a measured record: fit in percent, RMS error, whiteness of the residual.

    Parameters
    ----------
    record : Record, str, Path, DataFrame or Mapping of str to array_like, shape (n,)
        From `read_record`, or an argument of it.
    model : Model, System, type[Component], str or Path, optional
        A component, any FMU, ``path/to/file.py:Class``, a class such as ``diagnose(...).model``, or
        a system, by its name or its ``.ssp`` file; by default the first of ``ppy list``.

    Returns
    -------
    Comparison

    Raises
    ------
    UserError
        If the record or the model cannot be used, or a parameter is unknown.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> from demonstrations.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "clean.csv")
    >>> compared = ppy.compare("clean.csv", fit=["R1", "R2", "C"])
    >>> bool(compared.after["voltage"].fit_percent > compared.before["voltage"].fit_percent)
    True
    """
    declared = as_measured(model).with_options(options)
    given = values_of(declared, options["settings"])
    data = matching_record(record, declared, options)
    subject = built(declared)
    return comparison.compare(subject, data, given, options["fit"], workers=options["workers"])


@takes(FitKeywords)
def fit(
    record: Records,
    model: AnyModel,
    names: str | Sequence[str],
    **options: Unpack[FitKeywords],
) -> Fit:
    """Fit parameters so that the free-running simulation follows a record (output error).

    Derivatives are exact if the equations of the model are known, and differences of runs of its
    FMU otherwise.

    Parameters
    ----------
    record : Record, str, Path, DataFrame or Mapping of str to array_like, or sequence of these
        From `read_record`, or an argument of it. Several records, and the runs of a file, have one
        set of parameters, but for start values of states and `each`.
    model : Model, System, type[Component], str or Path
        A component, any FMU, ``path/to/file.py:Class``, a class such as ``diagnose(...).model``, or
        a system, by its name or its ``.ssp`` file.
    names : str or sequence of str
        Parameters to fit, and start values of states if the equations are known.

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
    >>> import ppy_rig as ppy
    >>> from demonstrations.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "clean.csv")
    >>> fitted = ppy.fit("clean.csv", "ppy_actuator", ["R1", "C"])
    >>> sorted(fitted.values)
    ['C', 'R1']
    """
    declared = as_measured(model).with_options(options)
    given = values_of(declared, options["settings"])
    data = matching_runs(record, declared, options)
    subject = comparison.with_measured(built(declared), *data)
    labels = record_labels(data)
    return comparison.fit_model(
        subject,
        [comparison.fit_data(subject, *pair) for pair in zip(data, labels, strict=True)],
        given_names(names, "names ="),
        given,
        read_assumptions(subject, options),
        workers=options["workers"],
    )
