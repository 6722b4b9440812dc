"""From an FMU and records to what is diagnosed: the component behind it, and records with what it simulates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError, suggestion
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.discrepancy.data.records import joined_dataset
from orchestration.discrepancy.foreign.component import RECORDED, Behind, behind, real
from orchestration.discrepancy.foreign.response import Response, responses
from orchestration.discrepancy.note import Note
from orchestration.fmu.model import Model, model_of
from orchestration.fmu.signal import Value, numeric
from orchestration.identify.any_fmu import FmuWithDifferences
from orchestration.identify.comparison import fit_model
from orchestration.identify.estimate import Estimate
from orchestration.identify.grey_box import Fit
from orchestration.records import Record

Array = NDArray[np.float64]
_FAR = 0.01  # relative change of a parameter, from which on an FMU is linearised anew


@dataclass(frozen=True)
class Surrounded:
    """What is diagnosed in place of an FMU.

    Attributes
    ----------
    original : Model
        The FMU.
    settings : dict of str to float or str
        With which it was simulated, fitted values among them.
    fit : Fit or None
    behind : Behind
    answers : dict of tuple of str to Response
        Of outputs to inputs, where a linear one follows the FMU.
    model : Model
        Of the component behind it.
    records, holdouts : list of Record
        With what the FMU simulates over them.
    """

    original: Model
    settings: dict[str, Value]
    fit: Fit | None
    behind: Behind
    answers: dict[tuple[str, str], Response]
    model: Model
    records: list[Record]
    holdouts: list[Record]

    @property
    def moved(self) -> list[str]:
        """Inputs that may be others in the FMU than they were recorded, by the names of the component."""
        inputs = dict.fromkeys(name for _, name in self.answers)
        return [self.behind.names[name] for name in inputs]

    def moved_to(self, estimates: Mapping[str, Estimate]) -> dict[str, float]:
        """Parameters of the FMU as they were found beside corrections; empty if none is far from where it was."""
        found = {
            p: estimates[name].value for p, name in self.behind.fitted.items() if name in estimates
        }
        before = {p: float(self.settings.get(p, self.original.parameters[p].start)) for p in found}
        far = any(abs(found[p] - before[p]) > _FAR * (abs(before[p]) or 1.0) for p in found)
        return found if far else {}

    def of_recorded(self, notes: Sequence[Note]) -> list[Note]:
        """Notes without those of what was simulated, not recorded."""
        own = {v.name for v in self.behind.cls.layout.inputs} - {*self.behind.names.values()}
        return [note for note in notes if note.subject not in own]

    @property
    def at_rest(self) -> list[str]:
        """Parameters that are known: what is recorded and what the FMU gets begin alike."""
        return [self.behind.cls.layout.start_of[s.name] for s in self.behind.cls.layout.states]


def surround(
    model: Model,
    records: Sequence[Record],
    holdouts: Sequence[Record],
    given: Mapping[str, Value],
    fit: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
    at: Mapping[str, float] | None = None,
) -> Surrounded:
    """Simulate an FMU over records, and put the component behind it.

    Parameters
    ----------
    model : Model
        Without equations.
    records, holdouts : sequence of Record
        In the FMU's units.
    given : Mapping of str to float or str
        Values of parameters, and of inputs that stand still.
    fit : sequence of str
        Parameters to fit first, to the first record without the part that is held out; they may still change, to first
        order, beside every correction.
    progress : callable
        Told what is being done.
    at : Mapping of str to float, optional
        Values of these parameters to linearise at, in place of a first fit.

    Raises
    ------
    UserError
        If the FMU cannot be simulated over a record, or a parameter cannot be fitted.
    """
    every = (*records, *holdouts)
    measured = [
        n
        for n in model.outputs
        if any(n in r.signals for r in every) and model.outputs[n].type == "real"
    ]
    if not measured:
        raise UserError(
            f"{records[0].source}: it has no real output of {model.name} ({', '.join(model.outputs)})"
        )
    for name in fit:
        if name not in model.parameters:
            raise UserError(
                f"fit: {model.name} has no parameter named {name!r}{suggestion(name, model.parameters)}"
            )
    settings, fitted = dict(given) | dict(at or {}), None
    if fit and at is None:
        progress(f"fitting {', '.join(fit)} of {model.path.name}")
        estimation = _estimation_data(
            model, records[0], given, whole=bool(holdouts) or len(records) > 1
        )
        fitted = fit_model(
            model, estimation.time, estimation.inputs, estimation.measured, fit, given
        )
        settings |= fitted.values
    progress(f"simulating {model.path.name}")
    time, values = (
        records[0].time,
        {p: float(settings.get(p, model.parameters[p].start)) for p in fit},
    )
    others = {n: v for n, v in settings.items() if n not in fit and n in model.parameters}
    with FmuWithDifferences(model, (), [*real(model.outputs)], {**others, **values}) as fmu:
        fed = _fed(records[0], model, settings)
        moving = [i for i in real(model.inputs) if i in records[0].signals and np.ptp(fed[i]) > 0.0]
        answers = responses(fmu, time, fed, {}, measured, moving)
    found = behind(
        model, measured, values, float(time[-1] - time[0]), float(np.median(np.diff(time))), answers
    )
    with FmuWithDifferences(model, fit, [*real(model.outputs)], others) as fmu:
        wrapped = [_wrapped(record, model, found, fmu, settings, measured) for record in every]
    return Surrounded(
        model,
        settings,
        fitted,
        found,
        answers,
        replace(model_of(found.cls), name=model.name),
        wrapped[: len(records)],
        wrapped[len(records) :],
    )


def _estimation_data(
    model: Model, record: Record, given: Mapping[str, Value], whole: bool
) -> Dataset:
    """What nothing is judged by; of a record with gaps what is before the first one."""
    data = joined_dataset({"": record}, model, numeric(given))
    fitted = data if whole else ValidationData.split(data)[0]
    return next(iter(fitted.apart().values()))


def _fed(record: Record, model: Model, settings: Mapping[str, Value]) -> dict[str, Array]:
    """What the FMU gets over a record."""
    held = {
        i: np.full(len(record.time), float(v)) for i, v in settings.items() if i in model.inputs
    }
    return held | {i: record.signals[i] for i in model.inputs if i in record.signals}


def _wrapped(
    record: Record,
    model: Model,
    found: Behind,
    fmu: FmuWithDifferences,
    settings: Mapping[str, Value],
    measured: Sequence[str],
) -> Record:
    """A record with what the FMU makes of its inputs, by the names of the component behind it."""
    fed = _fed(record, model, settings)
    values = {p: float(settings.get(p, model.parameters[p].start)) for p in found.fitted}
    ran = fmu.run(record.time, fed, values)
    signals = {
        found.names[name]: series
        for name, series in (record.signals | fed).items()
        if name in found.names
    }
    signals |= {found.simulated(o): series for o, series in ran.signals.items()}
    known = {v.name for v in found.cls.layout.inputs}
    signals |= {
        recorded: fed[i]
        for i in fed
        if (recorded := RECORDED.format(found.names.get(i, ""))) in known
    }
    for k, p in enumerate(values):
        signals |= {found.slope(o, p): ran.sensitivities[o][:, k] for o in measured}
    units = {v.name: v.unit for v in found.cls.layout.variables}
    return replace(record, signals=signals, units={name: units[name] for name in signals})
