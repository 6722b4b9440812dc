"""A parameter in a record and in a later one of a specimen, and the verdict on its change."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fmus.kit.arrays import Interval
from fmus.kit.declare import ParameterDeclaration
from fmus.kit.units import format_value
from orchestration.identify.metrics import finite_or_none
from orchestration.identify.uncertainty import is_significantly_different
from orchestration.reporting import format_percent

CHANGE_HEAD = ["parameter", "before", "after", "gain", "verdict"]


@dataclass(frozen=True)
class Change:
    """A parameter in both records, SI.

    Attributes
    ----------
    name : str
    before, after : float
    before_interval, after_interval : tuple of float
        95 % confidence intervals.
    changed : bool
        True if the change is claimed.
    uncertain : bool
        True if the change is significant by the noise, but stretches of the records contradict it.
    gain : float or None
        Share of the fall of the squared error with all parameters free that this parameter
        explains, in the order in which they are freed; for one that is not needed, its share in
        addition to the needed ones. None if the fall is insignificant.
    declaration : ParameterDeclaration
        Its unit and range.
    effect : str
        Effect that has the parameter; empty for those of the model.
    neutral : float or None
        Value at which that effect does nothing, if this is its strength.
    bound : float
        Largest change within 95 %, as a share of the value; infinite if nothing is known.
    unchanged : bool
        True if it does not differ significantly, and its largest change would not be noticed.
    """

    name: str
    before: float
    after: float
    before_interval: Interval
    after_interval: Interval
    changed: bool
    uncertain: bool
    gain: float | None
    declaration: ParameterDeclaration
    effect: str = ""
    neutral: float | None = None
    bound: float = math.inf
    unchanged: bool = False

    @property
    def unit(self) -> str:
        """Its SI unit."""
        return self.declaration.unit

    @property
    def lacking(self) -> tuple[bool, bool]:
        """Pair of flags: the earlier, and the later record, may do without the effect.

        True where the interval of its strength includes the value at which it does nothing.
        """
        return self._may_be_neutral(self.before_interval), self._may_be_neutral(self.after_interval)

    def _may_be_neutral(self, interval: Interval) -> bool:
        """Return whether an interval includes the value at which the effect does nothing."""
        low, high = interval
        return self.neutral is not None and low <= self.neutral <= high

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        figures: dict[str, Any] = {
            "parameter": self.name,
            "unit": self.unit,
            "changed": self.changed,
            "uncertain": self.uncertain,
            "unchanged": self.unchanged,
            "gain": self.gain,
            "bound": finite_or_none(self.bound),
        }
        if self.effect:
            figures["effect"] = self.effect
        figures["before"] = _with_interval(self.before, self.before_interval)
        figures["after"] = _with_interval(self.after, self.after_interval)
        return figures


def _with_interval(value: float, interval: Interval) -> dict[str, Any]:
    """Return a value with its interval, ready for JSON."""
    return {"value": value, "ci95": [finite_or_none(end) for end in interval]}


def change_rows(changes: Sequence[Change]) -> list[list[str]]:
    """Return the rows of a table of changes below `CHANGE_HEAD`, as plain text."""
    rows = []
    for change in changes:
        name = f"{change.name} ({change.effect})" if change.effect else change.name
        before = format_value(change.before, change.declaration)
        after = format_value(change.after, change.declaration)
        rows.append([name, before, after, format_gain(change), change_verdict(change)])
    return rows


def format_gain(change: Change) -> str:
    """Return the share of the squared error that a change explains; empty where it is unknown."""
    return "" if change.gain is None else f"{100 * change.gain:.1f} %"


def change_verdict(change: Change) -> str:
    """Return the verdict on a change: changed, unchanged, uncertain or not claimed."""
    if change.changed:
        return "changed"
    within = f"within {format_percent(change.bound)}"
    if change.unchanged:
        return f"unchanged, {within}"
    if change.uncertain:
        return "uncertain"
    return f"not claimed, {within}" if change.bound < 1.0 else "not claimed"


def describe_changes(changes: Sequence[Change]) -> str:
    """Return the changes from one record to another, in a sentence."""
    claimed = [_describe_change(change) for change in changes if change.changed]
    uncertain = ", ".join(_changed_name(change) for change in changes if change.uncertain)
    if claimed:
        text = f"What changed: {'; '.join(claimed)}."
    elif uncertain:
        text = "Nothing surely changed."
    else:
        text = "Nothing changed beyond noise."
    stayed = ", ".join(
        f"{_changed_name(change)} within {format_percent(change.bound)}"
        for change in changes
        if change.unchanged
    )
    text += f" Unchanged: {stayed}." if stayed else ""
    return f"{text} Uncertain: {uncertain}." if uncertain else text


def _describe_change(change: Change) -> str:
    """Describe one change; an effect that only one record needs has appeared or vanished."""
    lacking_before, lacking_after = change.lacking
    if lacking_before != lacking_after:
        return f"{change.effect} {'appeared' if lacking_before else 'vanished'}"
    name = _changed_name(change)
    if not change.before:
        return name
    ratio = change.after / change.before
    digits = 3 if is_significantly_different(ratio - 1.0, 0.0) else 5
    return f"{name}, times {ratio:.{digits}g}"


def _changed_name(change: Change) -> str:
    return f"{change.effect} ({change.name})" if change.effect else change.name
