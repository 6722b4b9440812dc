"""Comparison of a model with a measured record, and recalibration (``ppy compare``)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, find
from fmus.kit.record import CompiledModel
from orchestration.fmu import Model, Value
from orchestration.fmu.isolation import limits_of
from orchestration.fmu.signal import join_names, numeric
from orchestration.fmu.simulation import LimitOutputs, simulate, source_of
from orchestration.identify import presentation
from orchestration.identify.fitting import (
    NO_ASSUMPTIONS,
    Assumptions,
    FitData,
    FmuWithDifferences,
)
from orchestration.identify.grey_box import Fit, fit_records, held_warnings
from orchestration.identify.metrics import finite_or_none, fit_percent, rms
from orchestration.identify.noise import WHITENESS_SAMPLES, Whiteness, whiteness
from orchestration.records import Record, Source, read_record, read_runs, record_labels
from orchestration.records.quality import outliers_of
from orchestration.reporting import Displayable, one_line, option

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType

_ALONE = 5.0  # percent between the error and what the output moves by, that noise may make


@dataclass(frozen=True)
class GoodnessOfFit:
    """One simulated output against the measured one.

    Attributes
    ----------
    measured, simulated : ndarray, shape (n,)
        In the FMU's unit; NaN where nothing was measured.
    fit_percent : float
        100 (1 - |y - yhat| / |y - mean(y)|).
    rms : float
        Root mean square of the residual, in the FMU's unit.
    whiteness : Whiteness or None
        None if the record is too short for the test.
    """

    measured: Array
    simulated: Array
    fit_percent: float
    rms: float
    whiteness: Whiteness | None

    @property
    def residual(self) -> Array:
        """Measured minus simulated (n,), in the unit of the FMU."""
        return self.measured - self.simulated

    @property
    def is_noise_alone(self) -> bool:
        """True if noise alone was measured: a white residual, as large as the output moves."""
        is_white = self.whiteness is not None and self.whiteness.is_white
        return is_white and abs(self.fit_percent) < _ALONE

    def to_dict(self, unit: str) -> dict[str, Any]:
        """Return the figures with their unit, ready for JSON: None for NaN."""
        test = self.whiteness
        return {
            "fit_percent": finite_or_none(self.fit_percent),
            "rms": finite_or_none(self.rms),
            "unit": unit,
            "white": test.is_white if test else None,
            "ljung_box_p": finite_or_none(test.p_value) if test else None,
        }


@dataclass(frozen=True)
class Comparison(Displayable):
    """A model against a record, before and, if parameters were fitted, after the fit.

    Attributes
    ----------
    model : Model
    record : Record
    parameters : dict of str to float or str
        Values set by the user, in the FMU's units.
    before, after : dict of str to GoodnessOfFit
        By output; ``after`` is None without a fit.
    fit : Fit or None
    remarks : tuple of str
        On limits that the latest run exceeds, and ranges that it leaves.
    """

    model: Model
    record: Record
    parameters: dict[str, Value]
    before: dict[str, GoodnessOfFit]
    fit: Fit | None
    after: dict[str, GoodnessOfFit] | None
    remarks: tuple[str, ...] = ()

    @property
    def latest(self) -> dict[str, GoodnessOfFit]:
        """The simulation after the fit, or without one the only one."""
        return self.before if self.after is None else self.after

    def overview(self) -> Iterator[RenderableType]:
        """Yield the output of ``ppy compare``."""
        yield presentation.overview(self)
        yield from self.fit.warning_lines if self.fit else ()

    def __repr__(self) -> str:
        percents = ", ".join(f"{output} {g.fit_percent:.1f} %" for output, g in self.latest.items())
        return one_line(f"Comparison {percents}: {self.model.name}, {self.record.source.name}")

    def to_frame(self) -> pandas.DataFrame:
        """Return the goodness of fit as a table, a row for each output and run.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        rows = {
            (output, label): run[output].to_dict(self.model.outputs[output].unit)
            for output in self.before
            for label, run in presentation.runs(self).items()
        }
        table = pandas.DataFrame.from_dict(rows, orient="index").drop(columns="ljung_box_p")
        return table.rename_axis(["output", "run"])

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON, as ``ppy compare --json`` writes them.

        Returns
        -------
        dict
            Numbers with their units; None for numbers that are not finite.
        """
        record = self.record
        figures: dict[str, Any] = {
            "record": {
                "file": record.source.name,
                "samples": int(record.time.size),
                "seconds": float(record.time[-1] - record.time[0]),
                "notes": [repair.message for repair in record.repairs],
            },
            "model": self.model.name,
            "set": self.parameters,
            "outputs": self._figures_of(self.before),
            "remarks": list(self.remarks),
        }
        if self.fit is not None and self.after is not None:
            figures["fitted"] = {"outputs": self._figures_of(self.after), **self.fit.to_dict()}
        return figures

    def _figures_of(self, run: Mapping[str, GoodnessOfFit]) -> dict[str, Any]:
        """Return the figures of every output of a run."""
        return {name: one.to_dict(self.model.outputs[name].unit) for name, one in run.items()}


def read_for(model: Model, path: Source, mapping: Mapping[str, str] | None = None) -> Record:
    """Read a record of which some columns are the model's inputs and outputs.

    Parameters
    ----------
    model : Model
    path : Source
    mapping : Mapping of str to str, optional
        Column of the file to signal of the model.

    Returns
    -------
    Record

    Raises
    ------
    UserError
        If the file is refused, or holds none of the model's outputs.
    """
    record = read_record(path, mapping=mapping, **_signals(model))
    _check_outputs(record, model)
    return record


def read_runs_for(
    model: Model,
    path: Source,
    mapping: Mapping[str, str] | None = None,
    column: str | None = None,
) -> list[Record]:
    """Read the runs of a file that may have several.

    Parameters
    ----------
    model, path, mapping
        See :func:`read_for`.
    column : str, optional
        The column whose values distinguish runs; without it a run begins where the clock restarts.

    Raises
    ------
    UserError
        If the file is refused, or a run holds none of the model's outputs.
    """
    runs = read_runs(path, mapping=mapping, column=column, **_signals(model))
    for record in runs:
        _check_outputs(record, model)
    return runs


def _signals(model: Model) -> dict[str, Any]:
    """Return the signals of a model that a record may have, as arguments of `read_record`."""
    signals = {**model.inputs, **model.outputs}
    others = {} if model.cls else model.others  # a law is fitted to outputs
    return {
        "signals": {name: signal.unit_of_records for name, signal in signals.items()},
        "others": {name: signal.unit_of_records for name, signal in others.items()},
        "inputs": [*model.inputs],
        "words": {name: dict(signal.items) for name, signal in signals.items() if signal.items},
    }


def with_measured(model: Model, *records: Record) -> Model:
    """Return a model whose outputs include all that was measured in any of some records."""
    measured = dict.fromkeys(name for record in records for name in record.signals)
    found = [name for name in measured if name in model.others and name not in model.outputs]
    return model.recording([*model.outputs, *found]) if found else model


def _check_outputs(record: Record, model: Model) -> None:
    """Refuse a record without any output of the model."""
    if not any(name not in model.inputs for name in record.signals):
        known = ", ".join(model.outputs)
        empty = [repair.message for repair in record.repairs if repair.kind == "empty column"]
        if empty:
            reasons = "; ".join(message.partition(";")[0] for message in empty)
            raise UserError(
                f"{record.source}: {reasons} (all are NaN),"
                f" and no other is an output of {model.name}"
            )
        raise UserError(
            f"{record.source}: no column is an output of {model.name} ({known}); say which is, with"
            f" {option('mapping', {'column': 'signal'})}, as ppy info of the record proposes it"
        )


@dataclass(frozen=True)
class JointComparison(Displayable):
    """A model against several records that it was fitted to together.

    Attributes
    ----------
    comparisons : dict of str to Comparison
        By the label of the record, each with the same fit.
    fit : Fit
    """

    comparisons: dict[str, Comparison]
    fit: Fit

    def overview(self) -> Iterator[RenderableType]:
        """Yield the goodness of fit of each record, and the parameters once."""
        yield presentation.overview(*self.comparisons.values())

    def __repr__(self) -> str:
        return one_line(f"JointComparison of {', '.join(self.comparisons)}: {self.fit!r}")

    def to_frame(self) -> pandas.DataFrame:
        """Return the goodness of fit as a table, a row for each record, output and run."""
        import pandas

        return pandas.concat(
            {label: one.to_frame() for label, one in self.comparisons.items()}, names=["record"]
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: those of each record, and of the fit once."""
        records = []
        for label, one in self.comparisons.items():
            figures = one.to_dict()
            fitted = figures.pop("fitted")
            records.append({**figures, "label": label, "fitted": {"outputs": fitted["outputs"]}})
        return {"records": records, "fitted": self.fit.to_dict()}


def compare(
    model: Model,
    record: Record,
    parameters: Mapping[str, Value] | None = None,
    names: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
    workers: int = 1,
) -> Comparison:
    """Run the model's FMU over a record, assess every measured output, and fit parameters if named.

    Parameters
    ----------
    model : Model
    record : Record
    parameters : Mapping[str, float | str], optional
        Values that replace defaults, in the FMU's units.
    names : sequence of str
        Parameters to fit.
    progress : callable
        Called with a message before every stage.
    workers : int
        Processes that run an FMU without equations side by side in a fit.

    Returns
    -------
    Comparison

    Raises
    ------
    UserError
        If the FMU fails, or a parameter cannot be fitted.
    """
    given = dict(parameters or {})
    if names:
        found = compare_fitted(model, [record], given, names, progress=progress, workers=workers)
        return next(iter(found.comparisons.values()))
    model = with_measured(model, record)
    data = fit_data(model, record)
    progress(f"simulating {source_of(model).name} over {record.time.size} samples")
    starts = _unknown_starts(model, given)
    estimated = fit_model(model, [data], starts, given).values if starts else {}
    before, remarks = _assess(model, data, given | estimated)
    if starts:
        values = ", ".join(f"{name} = {value:.4g}" for name, value in estimated.items())
        remarks = (*remarks, f"start states are estimated from the record: {values}")
    return Comparison(model, record, given, before, fit=None, after=None, remarks=remarks)


def _unknown_starts(model: Model, given: Collection[str]) -> list[str]:
    """Return start values of which neither a model nor the user, who gives some, says anything."""
    if model.cls is None or not model.cls.begins_anywhere:
        return []
    layout = model.cls.layout
    states = [*layout.states, *(z for z in layout.discretes if not z.is_memory)]
    names = [layout.start_of[state.name] for state in states]
    return [name for name in names if name not in given]


def compare_fitted(
    model: Model,
    records: Sequence[Record],
    given: dict[str, Value],
    names: Sequence[str],
    assumptions: Assumptions = NO_ASSUMPTIONS,
    *,
    progress: Callable[[str], None] = lambda text: None,
    workers: int = 1,
) -> JointComparison:
    """Fit parameters to records together, and assess each of them before and after.

    Parameters
    ----------
    model, given, names, progress, workers
        See :func:`compare`.
    records : sequence of Record
    assumptions : Assumptions

    Raises
    ------
    UserError
        If the FMU fails, or a parameter cannot be fitted.
    """
    model = with_measured(model, *records)
    names = _checked_names(model, names, f"{option('fit', [*names])}: ")
    labels = record_labels(records)
    data = [fit_data(model, *pair) for pair in zip(records, labels, strict=True)]
    samples = sum(record.time.size for record in records)
    progress(f"simulating {source_of(model).name} over {samples} samples")
    before = [_assess(model, one, given, assumptions.linear)[0] for one in data]
    progress(f"fitting {', '.join(names)}")
    fit = fit_model(model, data, names, given, assumptions, progress=progress, workers=workers)
    progress("simulating with the fitted parameters")
    comparisons = {}
    for record, one, first in zip(records, data, before, strict=True):
        values = given | fit.values_of(one.label)
        after, remarks = _assess(model, one, values, assumptions.linear)
        comparisons[one.label] = Comparison(model, record, given, first, fit, after, remarks)
    return JointComparison(comparisons, fit)


def fit_data(model: Model, record: Record, label: str = "") -> FitData:
    """Return a record as a fit takes it: the model's inputs, and what was measured of it."""
    inputs = {name: values for name, values in record.signals.items() if name in model.inputs}
    measured = {name: values for name, values in record.signals.items() if name in model.outputs}
    return FitData(record.time, inputs, measured, label)


def fit_model(
    model: Model,
    records: Sequence[FitData],
    names: Sequence[str],
    given: Mapping[str, Value],
    assumptions: Assumptions = NO_ASSUMPTIONS,
    *,
    progress: Callable[[str], None] = lambda text: None,
    workers: int = 1,
) -> Fit:
    """Fit a model's parameters: by its equations where they are known, else by running its FMU.

    Parameters
    ----------
    model : Model
    records : sequence of FitData
        In the FMU's units.
    names : sequence of str
        Parameters to fit.
    given : Mapping of str to float or str
        Values of other parameters and of constant inputs; starting points of the fitted ones.
    assumptions : Assumptions
    progress : callable
        Takes what is done next.
    workers : int
        Processes that run an FMU without equations side by side.

    Raises
    ------
    UserError
        If a parameter is unknown or cannot be fitted, or the model cannot be simulated.
    """
    names = _checked_names(model, names)
    names += _unknown_starts(model, [*names, *given])
    moved = _checked_names(model, [*names, *assumptions.ties])
    fixed = {name: value for name, value in given.items() if name not in model.inputs}
    data = [_with_constants(model, record, given) for record in records]
    if model.cls is not None:
        fit = fit_records(model.cls, data, names, numeric(fixed), assumptions, progress)
        assert fit.likelihood is not None
        # of an FMU, differences of its runs would cost too much for these
        further = [
            *fit.likelihood.narrow_warnings(),
            *held_warnings(fit, data, names, numeric(fixed), assumptions),
        ]
        return replace(fit, warnings=[*fit.warnings, *further])
    others = {name: value for name, value in fixed.items() if name not in moved}
    numbers = {name: value for name, value in fixed.items() if not isinstance(value, str)}
    outputs = list(dict.fromkeys(output for record in records for output in record.measured))
    with FmuWithDifferences(model, moved, outputs, others, workers) as fmu:
        fit = fit_records(fmu, data, names, numeric(numbers), assumptions, progress)
        return replace(fit, evaluations=fmu.runs)


def _checked_names(model: Model, words: Sequence[str], fit: str = "") -> list[str]:
    """Return the parameters to fit; refuse some that cannot be, before any work is done.

    A tolerance, too, which only an FMU takes.
    """
    known = model.constants
    names = join_names(words, known)
    if names and model.cls is not None and model.tolerance is not None:
        given = option("tolerance", model.tolerance)
        raise UserError(
            f"{given}: {model.name} is fitted by its equations, whose accuracy is fixed; leave it"
            " out"
        )
    for k, name in enumerate(names):
        kind = find(name, known, f"{fit}{model.name} has no parameter").type
        if kind != "real":
            raise UserError(f"{fit}{name} is {kind}; only real parameters can be fitted")
        if name in names[:k]:
            raise UserError(f"{fit}{name} is named twice in {','.join(names)}")
    return names


def _with_constants(model: Model, data: FitData, given: Mapping[str, Value]) -> FitData:
    """Return data of a fit with the inputs that have a value instead of a column."""
    constant = {
        name: np.full(data.time.size, value)
        for name, value in given.items()
        if name in model.inputs
    }
    return data._replace(inputs=constant | dict(data.inputs))


def _linear_run(
    model: Model, data: FitData, parameters: Mapping[str, Value]
) -> Mapping[str, Array]:
    """Simulate the equations of a model with inputs in straight lines between samples."""
    assert model.cls is not None
    fixed = {name: value for name, value in parameters.items() if name not in model.inputs}
    inputs = _with_constants(model, data, parameters).inputs
    return CompiledModel(model.cls).run(data.time, inputs, numeric(fixed), linear=True).signals


def _assess(
    model: Model, data: FitData, parameters: Mapping[str, Value], linear: bool = False
) -> tuple[dict[str, GoodnessOfFit], tuple[str, ...]]:
    """Simulate the model; return the goodness of fit of every measured output, and remarks."""
    simulated = (
        _linear_run(model, data, parameters)
        if linear
        else simulate(model, data.time, data.inputs, parameters, isolation=limits_of(model.foreign))
    )
    assessed = {}
    for name, y in data.measured.items():
        residual = y - simulated[name]
        is_long_enough = np.isfinite(residual).sum() >= WHITENESS_SAMPLES
        assessed[name] = GoodnessOfFit(
            y,
            simulated[name],
            fit_percent(y, simulated[name]),
            rms(residual),
            whiteness(residual) if is_long_enough else None,
        )
    limits = LimitOutputs.among(model.outputs, model.parameters)
    remarks = limits.remarks(data.time, simulated, parameters)
    return assessed, (*remarks, *_outlier_remarks(data, assessed))


def _outlier_remarks(data: FitData, assessed: Mapping[str, GoodnessOfFit]) -> Iterator[str]:
    """Yield a remark on single values of an output that are far from the others, with their share.

    They count in all figures: a record is compared as it is.
    """
    inputs = np.column_stack([np.zeros(len(data.time)), *data.inputs.values()])
    for name, goodness in assessed.items():
        far = outliers_of(goodness.residual, inputs)
        if far.any():
            y = np.where(far, np.nan, goodness.measured)
            yield (
                f"{name} has single values far from those beside them: {far.sum()}, the first at"
                f" {data.time[far.argmax()]:.6g} s; they count, and without them the fit is"
                f" {fit_percent(y, goodness.simulated):.4g} %"
            )
