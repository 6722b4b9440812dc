"""Declarations shared by the controllers of a displacement by a current."""

from __future__ import annotations

from typing import Any

from ..kit import Discrete, Parameter


def largest_current(doc: str = "largest current in either direction") -> Any:
    """Declare the limit of the current in A, that of the galvanostat in thesis table 2-2."""
    source = "thesis table 2-2 (HA-151)"
    return Parameter(1.3, "A", min=1e-9, max=1e6, source=source, tunable=True, doc=doc)


def sampled_length(update: str, doc: str, output: bool = False) -> Any:
    """Declare a length in m that changes at samples only.

    Parameters
    ----------
    update : str
        Law of its value after a sample.
    doc : str
    output : bool
        Whether it is an output, too.
    """
    return Discrete(
        "m",
        update=update,
        period="sample_period",
        nominal=1e-4,
        display="mm",
        output=output,
        doc=doc,
    )
