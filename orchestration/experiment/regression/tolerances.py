"""Tolerances of a comparison as users write them: ``20ms, 1%``, or ``voltage=1mV, omega=0.5%``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from fmus.kit import UserError, units
from orchestration.fmu.signal import read_amount, read_quantity


class Tolerance(NamedTuple):
    """Half the width and half the height of a tube, before the signal is known.

    Attributes
    ----------
    time : float
        Half the width, s.
    percent : float
        Share of the range of the reference in half the height.
    amounts : tuple of str
        What is added to that: with a unit, or in that of the signal.
    """

    time: float = 0.0
    percent: float = 0.0
    amounts: tuple[str, ...] = ()

    def height(self, unit: str, extent: float, where: str) -> float:
        """Return half the height of the tube of a signal.

        Parameters
        ----------
        unit : str
            Unit of the signal, and of the result.
        extent : float
            Range of the reference.
        where : str
            Beginning of the message.

        Raises
        ------
        UserError
            If an amount is of another quantity.
        """
        added = (read_amount(text, unit, where, difference=True) for text in self.amounts)
        return self.percent / 100.0 * extent + sum(added)


EXACT = Tolerance()
OTHERS = ""
"""Key of the tolerance of all signals that are not named."""


def read_tolerances(texts: str | Sequence[str], flag: str) -> dict[str, Tolerance]:
    """Read tolerances that are separated by commas.

    Those after ``NAME=`` are of that signal; those before any name are of all others.

    Parameters
    ----------
    texts : str or sequence of str
    flag : str
        Name of the option, for messages.

    Returns
    -------
    dict of str to Tolerance
        By signal, and by `OTHERS`.

    Raises
    ------
    UserError
        If a text is no tolerance, or a signal has two.
    """
    text = texts if isinstance(texts, str) else ",".join(texts)
    found: dict[str, Tolerance] = {}
    name = OTHERS
    # a comma in brackets is part of a name, such as A[1,2]
    for part in re.split(r",(?![^\[\]]*\])", text):
        named, equals, amount = part.rpartition("=")
        if equals:
            name = named.strip()
            if not name or name in found:
                raise UserError(f"{flag} {text!r}: {name or 'a name'} is named twice or missing")
        found[name] = _with(found.get(name, EXACT), amount, f"{flag} {part!r}")
    return found


def _with(tolerance: Tolerance, given: str, where: str) -> Tolerance:
    """Return a tolerance with one more amount."""
    text = given.strip()
    number, unit = read_quantity(text.removesuffix("%")) or (inf, "")
    is_share = text.endswith("%")
    if not 0.0 <= number < inf or (is_share and unit):
        raise UserError(
            f"{where}: write a time, a value or a share of the range, at least 0, such as"
            " 20ms, 1mV or 1%"
        )
    if is_share:
        return tolerance._replace(percent=tolerance.percent + number)
    if unit and units.measure_alike(unit, "s"):
        return tolerance._replace(time=tolerance.time + read_amount(text, "s", where))
    return tolerance._replace(amounts=(*tolerance.amounts, text))
