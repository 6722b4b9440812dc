"""What a correction comes to in quantities that mean something: where it bends, and how much it is at the end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.laws.discovery import Correction
from orchestration.discrepancy.report.laws.asked import (
    Asked,
    shape_form,
    shape_width,
    signal_of,
    with_unit,
)

Array = NDArray[np.float64]
# by shape, where it bends; other shapes have no width, or none that can be seen
_BENDS = {
    "saturating": "levels off beyond about {width}",
    "exponential": "grows e times with every {width}",
    "stribeck": "falls off beyond about {width}",
    "levelling": "sets in beyond about {width} on either side",
    "sign_beyond": "sets in beyond {width} on either side",
    "stops": "sets in beyond {width} on either side",
    "weir": "sets in above {width}",
    "upper_stop": "sets in above {width}",
    "lower_stop": "sets in below {below}",
}
_PLACES = "weir", "upper_stop", "lower_stop"  # whose width is a place
_ALIKE = 0.9  # of what is made at the lower end, from which on that at the upper end is told


def quantities(asked: Asked, correction: Correction) -> str:
    """Where a correction bends, and what it makes of its law where the record has been farthest.

    Parameters
    ----------
    asked : Asked
    correction : Correction

    Returns
    -------
    str
        Such as ``levels off beyond about 2.1 rad/s, and makes 0.0098 N*m more at 95 rad/s``.
    """
    law, signal = asked.units(correction)
    ends = np.array([correction.entry.visited.min(), correction.entry.visited.max()])
    made = _values(correction, ends)
    farthest = 1 if abs(made[1]) >= _ALIKE * abs(made[0]) else 0
    amount, where = float(made[farthest]), with_unit(float(ends[farthest]), signal)
    size = (
        f"{100.0 * abs(amount):.3g} %"
        if correction.entry.kind == "multiply"
        else with_unit(abs(amount), law)
    )
    makes = f"makes {size} {'less' if amount < 0.0 else 'more'} at {where}"
    bend = _BENDS.get(correction.shape, "")
    width = shape_width(correction)
    if not bend or width is None:
        return makes
    zero = signal_of(correction.model.effect)[1].zero
    is_place = correction.shape in _PLACES
    place = bend.format(
        width=with_unit(zero + width if is_place else width, signal),
        below=with_unit(zero - width, signal),
    )
    about = (
        f" from {with_unit(zero, signal)}"
        if zero and not is_place and correction.shape != "exponential"
        else ""
    )
    return f"{place}{about}, and {makes}"


def _values(correction: Correction, x: Array) -> Array:
    """The function at places x (n,): its shape, or else the curve."""
    form = shape_form(correction)
    return form(x) if form else np.interp(x, correction.entry.basis.knots, correction.band[0])
