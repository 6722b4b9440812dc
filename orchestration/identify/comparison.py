"""Holding a model against a measured record: how far apart, and what the rest looks like (``ppy compare``)."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component, files, units
from fmus.kit.errors import UserError, suggestion
from fmus.kit.units import unit_of_differences
from orchestration.fmu.model import Model
from orchestration.fmu.simulate import simulate
from orchestration.identify.grey_box import Fit, fit
from orchestration.identify.metrics import Whiteness, fit_percent, number, rms, whiteness
from orchestration.records import Record, read_record

Array = NDArray[np.float64]
_SHORTEST = 20  # samples that a test of whiteness needs
_MUCH_LARGER = 25.0


@dataclass(frozen=True)
class Judgement:
    """One output of one simulation against the record.

    Attributes
    ----------
    measured, simulated : ndarray, shape (n,)
        In the FMU's unit; NaN where nothing was measured.
    fit_percent : float
        100 (1 - |y - yhat| / |y - mean(y)|).
    rms : float
        Root mean square of the residual, in the FMU's unit.
    whiteness : Whiteness or None
        None if the record is too short to tell.
    """

    measured: Array
    simulated: Array
    fit_percent: float
    rms: float
    whiteness: Whiteness | None

    @property
    def residual(self) -> Array:
        """Measured minus simulated."""
        return self.measured - self.simulated


@dataclass(frozen=True)
class Comparison:
    """A model against a record, before and, if parameters were fitted, after.

    Attributes
    ----------
    model : Model
    record : Record
    parameters : dict of str to float
        Set by the user, in the FMU's units.
    before, after : dict of str to Judgement
        By output; ``after`` is None without a fit.
    fit : Fit or None
    """

    model: Model
    record: Record
    parameters: dict[str, float]
    before: dict[str, Judgement]
    fit: Fit | None
    after: dict[str, Judgement] | None


def read_for(model: Model, path: Path, mapping: Mapping[str, str] | None = None) -> Record:
    """Read a record of which some columns are the model's inputs and outputs.

    Raises
    ------
    UserError
        If the file is refused, or holds none of the model's outputs.
    """
    signals = {s.name: s.unit for s in (*model.inputs.values(), *model.outputs.values())}
    record = read_record(path, signals, mapping=mapping, inputs=list(model.inputs))
    if not any(name in model.outputs for name in record.signals):
        known = ", ".join(model.outputs)
        raise UserError(f"{path}: no column is an output of {model.name} ({known}); rename with --map column=signal")
    return record


def compare(
    model: Model,
    record: Record,
    parameters: Mapping[str, float] | None = None,
    names: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> Comparison:
    """Run the model's FMU over a record and judge every measured output; recalibrate if asked.

    Parameters
    ----------
    model : Model
    record : Record
    parameters : Mapping[str, float], optional
        Values that replace defaults, in the FMU's units.
    names : sequence of str
        Parameters to fit.
    progress : callable
        Told what is being done.

    Returns
    -------
    Comparison

    Raises
    ------
    UserError
        If the FMU fails, or a fit is asked of a model whose equations are not ours.
    """
    given = dict(parameters or {})
    cls = _equations(model, names)
    inputs = {name: values for name, values in record.signals.items() if name in model.inputs}
    measured = {name: values for name, values in record.signals.items() if name in model.outputs}
    progress(f"simulating {model.path.name} over {record.time.size} samples")
    before = _judge(model, record.time, inputs, measured, given)
    if cls is None:
        return Comparison(model, record, given, before, None, None)
    constant = {name: np.full(record.time.size, value) for name, value in given.items() if name in model.inputs}
    fixed = {name: value for name, value in given.items() if name in model.parameters}
    progress(f"fitting {', '.join(names)}")
    result = fit(cls, record.time, constant | inputs, measured, names, fixed)
    progress("simulating with the fitted parameters")
    return Comparison(
        model, record, given, before, result, _judge(model, record.time, inputs, measured, given | result.values)
    )


def _equations(model: Model, names: Sequence[str]) -> type[Component] | None:
    """Return the class to fit, None without names; refuse, before any work is done, what cannot be fitted."""
    if not names:
        return None
    if model.cls is None:
        raise UserError(
            f"--fit needs the equations; {model.name} is an FMU without them (fit one of ours: see ppy list)"
        )
    for k, name in enumerate(names):
        if name not in model.parameters:
            raise UserError(f"--fit: {model.name} has no parameter named {name!r}{suggestion(name, model.parameters)}")
        if name in names[:k]:
            raise UserError(f"--fit: {name} is named twice in {','.join(names)}")
    return model.cls


def _judge(
    model: Model,
    time: Array,
    inputs: Mapping[str, Array],
    measured: Mapping[str, Array],
    parameters: Mapping[str, float],
) -> dict[str, Judgement]:
    simulated = simulate(model, time, inputs, parameters)
    judged = {}
    for name, y in measured.items():
        residual = y - simulated[name]
        long_enough = np.isfinite(residual).sum() >= _SHORTEST
        judged[name] = Judgement(
            y,
            simulated[name],
            fit_percent(y, simulated[name]),
            rms(residual),
            whiteness(residual) if long_enough else None,
        )
    return judged


def to_json(comparison: Comparison) -> dict[str, Any]:
    """Gather the figures, ready for JSON: numbers in the units that stand beside them, no NaN (null instead)."""

    def judged(judgements: Mapping[str, Judgement]) -> dict[str, Any]:
        return {
            name: {
                "fit_percent": number(j.fit_percent),
                "rms": number(j.rms),
                "unit": comparison.model.outputs[name].unit,
                "white": j.whiteness.is_white if j.whiteness else None,
                "ljung_box_p": number(j.whiteness.p_value) if j.whiteness else None,
            }
            for name, j in judgements.items()
        }

    record, result = comparison.record, comparison.fit
    page: dict[str, Any] = {
        "record": {
            "file": record.source.name,
            "samples": int(record.time.size),
            "seconds": float(record.time[-1] - record.time[0]),
            "notes": [repair.message for repair in record.repairs],
        },
        "model": comparison.model.name,
        "set": comparison.parameters,
        "outputs": judged(comparison.before),
    }
    if result is not None and comparison.after is not None:
        page["fitted"] = {
            "outputs": judged(comparison.after),
            "parameters": {
                name: {"value": e.value, "ci95": [number(x) for x in e.interval], "nominal": e.nominal, "unit": e.unit}
                for name, e in result.estimates.items()
            },
            "simulations": result.evaluations,
            "warnings": result.warnings,
        }
    return page


def write_json(comparison: Comparison, path: Path) -> None:
    """Write :func:`to_json` to a file.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    files.write(path, (json.dumps(to_json(comparison), indent=2) + "\n").encode())


def plot(comparison: Comparison, path: Path) -> None:
    """Draw, for every measured output, record and simulation above the residual.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    from orchestration.reporting import pictures

    model, time = comparison.model, comparison.record.time
    figure, axes = pictures.panels(2 * len(comparison.before), f"{comparison.record.source.name} against {model.name}")
    for k, (name, before) in enumerate(comparison.before.items()):
        unit, display = model.outputs[name].unit, model.outputs[name].display
        difference = unit_of_differences(model.outputs[name])
        over, rest = axes[2 * k], axes[2 * k + 1]
        over.plot(
            time, units.convert(before.measured, unit, display), color=pictures.MEASURED, lw=2.5, label="measured"
        )
        runs = [(before, pictures.MODEL, "simulated" if comparison.after is None else "before")]
        runs += [(comparison.after[name], pictures.FITTED, "fitted")] if comparison.after else []
        for judged, colour, text in runs:
            label = f"{text}: {judged.fit_percent:.1f} % fit"
            over.plot(time, units.convert(judged.simulated, unit, display), color=colour, label=label)
        # what the fit leaves would vanish beside a much larger error before it
        shown = runs[-1:] if runs[0][0].rms > _MUCH_LARGER * runs[-1][0].rms else runs
        for judged, colour, _ in shown:
            rest.plot(time, units.convert(judged.residual, unit, difference), color=colour)
        over.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1)
        pictures.label(over, name, display)
        pictures.label(rest, "residual" if len(shown) == len(runs) else "residual (fitted)", difference)
    pictures.logarithmic(axes, time)
    pictures.save(figure, path)
