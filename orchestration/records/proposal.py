"""Proposal of columns for the signals of a model: by words that people use, and by units."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import SequenceMatcher

from fmus.kit import UserError
from fmus.kit.units import measure_alike
from orchestration.reporting import flag

_WORDS = [
    set(line.split())
    for line in """
    voltage volt volts spannung potential tension u v e ewe vf vm ecell vcell ucell
    current strom amp amps courant i im icell
    temperature temperatur temp t
    force kraft load last f
    displacement position weg pos hub stroke travel auslenkung x s
    velocity speed geschwindigkeit v
    rotation drehzahl rpm n omega
    torque drehmoment moment m
    pressure druck p
    power leistung p
    charge ladung capacity kapazität q
    angle winkel phi theta
    acceleration beschleunigung a
    flow durchfluss volumenstrom q
    strain dehnung epsilon
    stress sigma
    """.strip().splitlines()
]
"""Words of one quantity; single letters count only beside a unit that fits."""

_SAME_NAME = 4.0
_SAME_QUANTITY = 2.0
_SIMILAR = 0.7  # ratio of alike letters
_COMPOUND = 5  # letters of a word that may be part of another one, as in Klemmenspannung


@dataclass(frozen=True)
class Proposal:
    """Which columns are probably which signals.

    Attributes
    ----------
    mapping : dict of str to str
        Column to signal, with the unit where only the column's name suggests it; those that need no
        ``--map`` are left out.
    matched : dict of str to str
        Signal to column, of all that are found.
    open : dict of str to list of str
        Signals that are not found, and the columns that may be each.
    """

    mapping: dict[str, str]
    matched: dict[str, str]
    open: dict[str, list[str]]

    def options(self) -> str:
        """Return the options for a shell."""
        entries = [f"{column}={target}" for column, target in self.mapping.items()]
        return shlex.join(word for entry in entries for word in (flag("mapping"), entry))


def propose(columns: Mapping[str, tuple[str, str]], signals: Mapping[str, str]) -> Proposal:
    """Propose a column for every signal, the clearest pairs first.

    Parameters
    ----------
    columns : Mapping of str to tuple of str
        By name: the unit that the file states, and the one that the name suggests; may be empty.
    signals : Mapping of str to str
        Unit of each signal of the model.

    Returns
    -------
    Proposal
    """
    units = {name: stated or guess for name, (stated, guess) in columns.items()}
    scores = {
        (signal, name): _score(name, units[name], signal, unit)
        for signal, unit in signals.items()
        for name in columns
    }
    matched: dict[str, str] = {}
    while True:
        pair = _clearest(scores, matched)
        if pair is None:
            break
        matched[pair[0]] = pair[1]
    guesses = {name: guess for name, (stated, guess) in columns.items() if guess and not stated}
    suggested = {name: f"[{guess}]" for name, guess in guesses.items()}
    mapping = {
        name: signal + suggested.get(name, "")
        for signal, name in matched.items()
        if name != signal or name in suggested
    }
    free = [name for name in columns if name not in matched.values()]
    missing = {
        signal: [name for name in free if scores[signal, name] > 0.0 or not units[name]]
        for signal in signals
        if signal not in matched
    }
    return Proposal(mapping, matched, missing)


def _clearest(
    scores: Mapping[tuple[str, str], float], matched: Mapping[str, str]
) -> tuple[str, str] | None:
    """Return the pair of the greatest score that no other column or signal shares."""
    left = {
        (signal, name): score
        for (signal, name), score in scores.items()
        if score > 0.0 and signal not in matched and name not in matched.values()
    }
    for pair, score in sorted(left.items(), key=lambda item: -item[1]):
        rivals = [
            other
            for other, theirs in left.items()
            if other != pair and theirs >= score and (other[0] == pair[0] or other[1] == pair[1])
        ]
        if not rivals:
            return pair
    return None


def _score(column: str, unit: str, signal: str, expected: str) -> float:
    """Return how well a column suits a signal; 0 if not at all."""
    fits = bool(unit) and _alike(unit, expected)
    if unit and not fits:
        return 0.0
    words = _words(column, fits)
    score = 1.0 if fits else 0.0
    if column.casefold() == signal.casefold():
        return score + _SAME_NAME
    if _mean_the_same(words, _words(signal, True)):
        return score + _SAME_QUANTITY
    ratio = SequenceMatcher(None, column.casefold(), signal.casefold()).ratio()
    return score + (ratio if ratio >= _SIMILAR else 0.0)


def _alike(unit: str, other: str) -> bool:
    try:
        return measure_alike(unit, other)
    except UserError:
        return False


def _words(name: str, with_letters: bool) -> set[str]:
    """Return the words of a name; single letters are words only beside a unit that fits."""
    words = re.findall(r"[^\W\d_]+", name.casefold())
    return {word for word in words if with_letters or len(word) > 1}


def _mean_the_same(words: set[str], others: set[str]) -> bool:
    return any(_name(words, quantity) and _name(others, quantity) for quantity in _WORDS)


def _name(words: set[str], quantity: set[str]) -> bool:
    """Return whether words name a quantity, by themselves or within a compound."""
    return any(
        word == known or (len(known) >= _COMPOUND and known in word)
        for word in words
        for known in quantity
    )
