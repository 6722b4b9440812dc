"""Parameters of a specimen by all of its tests: graphical values, and a fit to all together."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from demonstrations.characterise.kinds import CIRCUIT, HELD_VOLTAGE, KINDS, Estimates, Kind, kind_of
from fmus.kit import UserError
from orchestration.fmu import Model, Value
from orchestration.identify import Fit, JointComparison, comparison, interval_cells
from orchestration.identify.fitting import Assumptions
from orchestration.records import Record, record_labels, refuse_same
from orchestration.reporting import Displayable, one_line, plain_table

if TYPE_CHECKING:
    from rich.console import RenderableType

_WIDE = 0.5  # of a value: half an interval, beyond which it counts as not determined
_STRONG = 6.0  # difference of two deviances that is strong evidence (Kass and Raftery 1995)
_ANYTHING = 100.0  # typical sizes of a state: deviation of a start value that nothing tells
TESTS = ("record", "test", "tells")
HEAD = ("parameter", "record", "graphical", "95 % interval", "fitted to all", "95 % interval")


@dataclass(frozen=True)
class Characterisation(Displayable):
    """A specimen's records and parameters.

    Attributes
    ----------
    model : Model
    kinds : Mapping of str to Kind or None
        The test that each record is, by its label; None for none of the thesis.
    graphical : Mapping of str to Estimates
        What is read off each record.
    joint : JointComparison
        Of the fit to all records, without start values.
    remarks : tuple of str
        Why nothing was read off a record.
    """

    model: Model
    kinds: Mapping[str, Kind | None]
    graphical: Mapping[str, Estimates]
    joint: JointComparison
    remarks: tuple[str, ...]

    @property
    def fit(self) -> Fit:
        """Fit of the parameters to all records."""
        return self.joint.fit

    @property
    def determined(self) -> dict[str, float]:
        """Fitted values by name, SI, of the parameters that the records determine.

        Those that no test among them tells are left out: where a minute of creep stands for all of
        it, a linearised interval of one of its parameters may be narrow and wrong.
        """
        told: set[str] = set()
        for kind in self.kinds.values():
            told |= set(self.fit.estimates if kind is None else kind.tells)
        known = {}
        for name, estimate in self.fit.estimates.items():
            low, high = estimate.interval
            if name in told and high - low <= 2.0 * _WIDE * abs(estimate.value):
                known[name] = estimate.value
        return known

    @property
    def missing(self) -> dict[str, str]:
        """By parameter that the records do not determine: the test that would tell it."""
        advice = {}
        determined = self.determined
        for name in self.fit.estimates:
            able = [f"{kind.title}: {kind.advice}" for kind in KINDS if name in kind.tells]
            if name not in determined:
                advice[name] = "; or ".join(able) or "no test of the thesis tells it"
        return advice

    def rows(self) -> Iterator[list[str]]:
        """Yield a row of `HEAD` for each reading, and for each parameter without one."""
        determined = self.determined
        for name, estimate in self.fit.estimates.items():
            declared = self.fit.declared[name]
            fitted = ("not determined", "")
            if name in determined:
                fitted = interval_cells(estimate.value, estimate.interval, declared)
            readings = []
            for label, read in self.graphical.items():
                if name in read:
                    one = read[name]
                    readings.append([label, *interval_cells(one.value, one.interval, declared)])
            for reading in readings or [["", "", ""]]:
                yield [name, *reading, *fitted]

    def kind_rows(self) -> Iterator[list[str]]:
        """Yield a row for each record: its label, its test, and what such a test tells."""
        for label, kind in self.kinds.items():
            if kind is None:
                yield [label, "no test of the thesis", "only fitted, with the others"]
            else:
                yield [label, f"{kind.title} ({kind.source})", ", ".join(kind.tells)]

    def overview(self) -> Iterator[RenderableType]:
        """Yield the tests, the parameters, and what is missing."""
        yield plain_table(None, *TESTS, rows=self.kind_rows())
        yield ""
        yield plain_table(None, *HEAD, right=HEAD[2:], rows=self.rows())
        yield from (f"not determined: {name}; {text}" for name, text in self.missing.items())
        yield from (f"warning: {text}" for text in (*self.remarks, *self.fit.warnings))

    def __repr__(self) -> str:
        return one_line(f"Characterisation of {', '.join(self.kinds)}: {self.fit!r}")

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON."""
        return {
            "model": self.model.name,
            "tests": {label: kind and kind.title for label, kind in self.kinds.items()},
            "graphical": {
                label: {name: asdict(one) for name, one in read.items()}
                for label, read in self.graphical.items()
            },
            "fitted": self.fit.to_dict(),
            "missing": self.missing,
            "remarks": [*self.remarks],
        }


def characterise(
    model: Model,
    records: Sequence[Record],
    given: Mapping[str, Value] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Characterisation:
    """Name the test that each record is, read parameters off it, and fit them to all records.

    Parameters
    ----------
    model : Model
        With its equations.
    records : sequence of Record
    given : Mapping of str to float or str, optional
        Start values of parameters, in the units of the model.
    progress : callable
        Called with a message before every stage.

    Raises
    ------
    UserError
        If the model has no equations, two records are the same, or the fit fails.
    """
    if model.cls is None:
        raise UserError(f"{model.without_equations}; ppy identify fits named parameters of it")
    refuse_same(records, model.outputs)
    by_label = dict(zip(record_labels(records), records, strict=True))
    kinds = {label: kind_of(record) for label, record in by_label.items()}
    fitted = [p for p in model.cls.layout.parameters if p.fitted and p.type == "real"]
    starts = [p.name for p in fitted if p.starts]
    # a state that no sample tells, such as one long before it, would make the fit singular
    priors = {p.name: (0.0, _ANYTHING * p.nominal) for p in fitted if p.starts}

    def fit_to(read: Sequence[Record]) -> JointComparison:
        names, assumptions = [p.name for p in fitted], Assumptions(priors=priors)
        return comparison.compare_fitted(
            model, read, dict(given or {}), names, assumptions, progress=progress
        )

    joint, remarks = _fitted(fit_to, by_label, kinds)
    progress("reading parameters off the records")
    fit = _without_starts(joint.fit, starts)
    circuit = {name: value for name, value in fit.values.items() if name in CIRCUIT}
    graphical: dict[str, Estimates] = {}
    comparisons = {}
    for label, record in by_label.items():
        kind = kinds[label]
        comparisons[label] = _of_samples(joint.comparisons[label], record, fit)
        try:
            graphical[label] = {} if kind is None else kind.read(record, circuit)
        except UserError as error:
            remarks.append(f"{label}: nothing is read off it: {error}")
    joint = JointComparison(comparisons, fit)
    return Characterisation(model, kinds, graphical, joint, tuple(remarks))


def _fitted(
    fit_to: Callable[[Sequence[Record]], JointComparison],
    by_label: Mapping[str, Record],
    kinds: Mapping[str, Kind | None],
) -> tuple[JointComparison, list[str]]:
    """Return a fit to records as they were driven, and what they leave open of that.

    Some potentiostats hold their current from sample to sample. A record of a held voltage does not
    tell; others that determine the circuit do, as they agree with it in one way alone.
    """
    driven = [
        record if kind is None else kind.as_driven(record)
        for record, kind in zip(by_label.values(), kinds.values(), strict=True)
    ]
    joint = fit_to(driven)
    held = [label for label, kind in kinds.items() if kind is HELD_VOLTAGE]
    if not held:
        return joint, []
    other = fit_to(
        [
            by_label[label] if label in held else one
            for label, one in zip(by_label, driven, strict=True)
        ]
    )
    others = by_label.keys() - {*held}
    gain = _deviance(joint, others) - _deviance(other, others)
    if gain > _STRONG:
        return other, []
    changed = [
        f"{name}={other.fit.values[name]:.4g}" for name in CIRCUIT if name in joint.fit.values
    ]
    if gain < -_STRONG or not changed:
        return joint, []
    return joint, [
        f"{', '.join(held)}: the current is taken as continuous between samples; if it is held, the"
        f" fit has {', '.join(changed)}"
    ]


def _deviance(joint: JointComparison, labels: Collection[str]) -> float:
    """Return -2 log L of white residuals of some records, but for a constant."""
    runs = [run for label in labels for run in joint.comparisons[label].latest.values()]
    return sum(2.0 * np.isfinite(run.residual).sum() * np.log(run.rms) for run in runs)


def _of_samples(one: comparison.Comparison, record: Record, fit: Fit) -> comparison.Comparison:
    """Return a comparison over the samples of the record itself, with another fit."""
    own = np.searchsorted(one.record.time, record.time)
    before, after = (
        {
            name: replace(judged, measured=judged.measured[own], simulated=judged.simulated[own])
            for name, judged in run.items()
        }
        for run in (one.before, one.latest)
    )
    return replace(one, record=record, before=before, after=after, fit=fit)


def _without_starts(fit: Fit, starts: Collection[str]) -> Fit:
    """Return a fit of the parameters alone: start values are of a record, not of the specimen."""
    estimates = {
        name: one for name, one in fit.estimates.items() if name.partition("@")[0] not in starts
    }
    correlations = {pair: r for pair, r in fit.correlations.items() if estimates.keys() >= {*pair}}
    warnings = [text for text in fit.warnings if not any(name in text for name in starts)]
    return replace(fit, estimates=estimates, correlations=correlations, warnings=warnings)
