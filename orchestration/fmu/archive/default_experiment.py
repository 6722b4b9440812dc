"""The default experiment that a model description declares, and what is wrong with it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree.ElementTree import Element

_ELEMENT = "DefaultExperiment"
_LONGEST = 40  # characters of a value that are shown


def experiment_faults(description: Element) -> Iterator[str]:
    """Find attributes whose value no simulation can use.

    A stop time or a step of 0, which tools write that have none, is as good as none.

    Parameters
    ----------
    description : Element
        Root of ``modelDescription.xml``.

    Yields
    ------
    str
        Attribute, value, and what is allowed.
    """
    experiment = description.find(_ELEMENT)
    for name, text in () if experiment is None else experiment.items():
        least, bound = (-math.inf, "") if name == "startTime" else (0.0, " of 0 or more")
        value = _number(text)
        if not math.isfinite(value) or value < least:
            yield f"{_ELEMENT}: {name} {text[:_LONGEST]!a} is not a finite number{bound}"


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
