"""Faults of the default experiment in a model description."""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree.ElementTree import Element

_ELEMENT = "DefaultExperiment"
_LONGEST = 40  # characters of a value in a message


def experiment_faults(description: Element) -> Iterator[str]:
    """Yield a message for each attribute that is not finite, or negative unless a time.

    A stop time or step of 0 is allowed, because some tools write it for an undefined one.

    Parameters
    ----------
    description : Element
        Root of ``modelDescription.xml``.

    Yields
    ------
    str
        Attribute, value, and the allowed values.
    """
    experiment = description.find(_ELEMENT)
    if experiment is None:
        return
    for name, text in experiment.items():
        value = _number(text)
        may_be_negative = name in ("startTime", "stopTime")
        if not math.isfinite(value) or (value < 0.0 and not may_be_negative):
            bound = "" if may_be_negative else " of 0 or more"
            yield f"{_ELEMENT}: {name} {text[:_LONGEST]!a} is not a finite number{bound}"


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
