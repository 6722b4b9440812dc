"""Input clocks of a model description of FMI 3.0 that tick by time."""

from __future__ import annotations

import math
from typing import NamedTuple
from xml.etree.ElementTree import Element

from orchestration.fmu.wrapping.variables import Fmi3Description

# kinds by ``intervalVariability``, as numbers in `wrapper.h`; the first also if it is declared
_CONSTANT, _FIXED = 0, 1
_KINDS = {"constant": _CONSTANT, "fixed": _FIXED, "tunable": _FIXED, "changing": 2, "countdown": 3}


class InputClock(NamedTuple):
    """An input clock that ticks by time.

    Attributes
    ----------
    kind : {0, 1, 2, 3}
        Number in `wrapper.h`.
    reference : int
        Value reference.
    interval, shift : float
        Seconds; 0 where the FMU tells them.
    """

    kind: int
    reference: int
    interval: float
    shift: float


def input_clocks(description: Fmi3Description) -> list[InputClock]:
    """Return the input clocks that tick by time, of the highest priority first.

    Raises
    ------
    UserError
        If an interval, a shift or a priority is no such number.
    """
    found = []
    for node in description.clocks:
        kind = _KINDS.get(node.get("intervalVariability", ""))
        if node.get("causality") != "input" or kind is None:
            continue
        name = node.get("name", "")
        reference = description.whole_number(node.get("valueReference"), name, "valueReference")
        priority = description.whole_number(node.get("priority", "0"), name, "priority")
        interval = _seconds(description, node, "interval")
        shift = _seconds(description, node, "shift")
        if kind == _CONSTANT and interval == 0.0:
            raise description.error(name, "is a clock of a constant interval, which is not given")
        if kind == _FIXED and interval > 0.0:
            kind = _CONSTANT
        found.append((priority, InputClock(kind, reference, interval, shift)))
    return [clock for _, clock in sorted(found, key=lambda pair: pair[0])]


def _seconds(description: Fmi3Description, node: Element, quantity: str) -> float:
    """Return an interval or a shift in s: a decimal number, or a count of ticks of a resolution."""
    name = node.get("name", "")
    counter = node.get(f"{quantity}Counter")
    if counter is not None:
        count = description.whole_number(counter, name, f"{quantity}Counter")
        resolution = description.whole_number(node.get("resolution", "1"), name, "resolution")
        return count / max(resolution, 1)
    text = node.get(f"{quantity}Decimal", "0")
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0.0 <= seconds < math.inf:
        raise description.error(name, f"{quantity}Decimal {text[:40]!r} is no time in s")
    return seconds
