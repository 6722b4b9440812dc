"""Tolerances of a comparison as users write them: ``20ms, 1%``, or ``voltage=1mV, omega=0.5%``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import inf

from fmus.kit import units
from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.signal import read_amount, read_quantity

_FORM = "write a time, a value or a share of the range such as 20ms, 1mV or 1%"


@dataclass(frozen=True)
class Tolerance:
    """Half the width and half the height of a tube, before the signal is known.

    Attributes
    ----------
    time : float
        Half the width, s.
    values : tuple of str
        Amounts with a unit, or without one in that of the signal, and shares of the reference's
        range in percent; half the height is their sum.
    """

    time: float = 0.0
    values: tuple[str, ...] = ()

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
        shares = [text for text in self.values if text.endswith("%")]
        amounts = [text for text in self.values if not text.endswith("%")]
        # a difference of temperatures has no offset
        difference = units.difference_unit(unit)
        return sum(float(text[:-1]) / 100.0 * extent for text in shares) + sum(
            read_amount(text, difference, where) for text in amounts
        )


EXACT = Tolerance()


@dataclass(frozen=True)
class Tolerances:
    """The tolerance of each signal.

    Attributes
    ----------
    others : Tolerance
        Of all signals that are not named.
    named : dict of str to Tolerance
        By signal.
    """

    others: Tolerance = EXACT
    named: dict[str, Tolerance] = field(default_factory=dict)

    def of(self, signal: str) -> Tolerance:
        """Return the tolerance of a signal."""
        return self.named.get(signal, self.others)

    def check_names(self, known: Iterable[str], source: object) -> None:
        """Raise UserError if a signal that has a tolerance is not in a file."""
        names = list(known)
        for name in self.named:
            if name not in names:
                raise UserError(
                    f"tolerance of {name}: {source} has no such signal{suggestion(name, names)}"
                )


def read_tolerances(texts: str | Sequence[str], flag: str) -> Tolerances:
    """Read tolerances that are separated by commas.

    Those after ``NAME=`` are of that signal; those before any name are of all others.

    Parameters
    ----------
    texts : str or sequence of str
    flag : str
        Name of the option, for messages.

    Returns
    -------
    Tolerances

    Raises
    ------
    UserError
        If a text is no tolerance, or a signal has two.
    """
    text = texts if isinstance(texts, str) else ",".join(texts)
    groups: dict[str, list[str]] = {"": []}
    name = ""
    # a comma in brackets is part of a name, such as A[1,2]
    for part in re.split(r",(?![^\[\]]*\])", text):
        named, equals, amount = part.rpartition("=")
        if equals:
            name = named.strip()
            if not name or name in groups:
                raise UserError(f"{flag} {text!r}: {name or 'a name'} is {_fault(name)}")
            groups[name] = []
        groups[name].append(amount)
    read = {name: _tolerance(amounts, flag) for name, amounts in groups.items()}
    return Tolerances(read.pop(""), read)


def _fault(name: str) -> str:
    return "named twice" if name else "missing before ="


def _tolerance(amounts: Sequence[str], flag: str) -> Tolerance:
    """Return the tolerance of one signal, of a width and a height."""
    time = 0.0
    values = []
    for given in amounts:
        text = given.strip()
        number, unit = read_quantity(text.removesuffix("%")) or (inf, "")
        if not 0.0 <= number < inf or (text.endswith("%") and unit):
            raise UserError(f"{flag} {given!r}: {_FORM}, at least 0")
        if unit and units.measure_alike(unit, "s"):
            time += read_amount(text, "s", flag)
        else:
            values.append(text)
    return Tolerance(time, tuple(values))
