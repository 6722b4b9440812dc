"""Proposal of columns for the signals of a model, by usual words for quantities and by units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import SequenceMatcher

from fmus.kit import UserError, quoting
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
"""Words for each quantity; a single letter counts only if the unit is of the same dimension."""

_SAME_NAME = 4.0
_SAME_QUANTITY = 2.0
_SIMILAR = 0.7  # least ratio of matching letters, see `difflib.SequenceMatcher.ratio`
_COMPOUND = 5  # letters of a word that also counts within another one, as in Klemmenspannung


@dataclass(frozen=True)
class Proposal:
    """Probable mapping of columns to signals.

    Attributes
    ----------
    mapping : dict of str to str
        Signal by column, with the unit if only the column's name suggests it; without pairs that
        need no ``--map``.
    matched : dict of str to str
        Column by signal, for all pairs.
    open : dict of str to list of str
        Candidate columns of each signal that is not matched.
    """

    mapping: dict[str, str]
    matched: dict[str, str]
    open: dict[str, list[str]]

    def options(self) -> str:
        """Return the ``--map`` options for a shell."""
        entries = [f"{column}={target}" for column, target in self.mapping.items()]
        return quoting.shell(word for entry in entries for word in (flag("mapping"), entry))


def propose(columns: Mapping[str, tuple[str, str]], signals: Mapping[str, str]) -> Proposal:
    """Propose a column for every signal, the pairs of the greatest score first.

    Parameters
    ----------
    columns : Mapping of str to tuple of str
        By name: the unit in the file, and the unit that the name suggests; each may be empty.
    signals : Mapping of str to str
        Unit by signal of the model.

    Returns
    -------
    Proposal
    """
    units = {column: stated or guess for column, (stated, guess) in columns.items()}
    scores = {}
    for signal, expected in signals.items():
        for column, unit in units.items():
            scores[signal, column] = _score(column, unit, signal, expected)
    matched: dict[str, str] = {}
    while pair := _clearest(scores, matched):
        signal, column = pair
        matched[signal] = column
    mapping = {}
    for signal, column in matched.items():
        stated, guess = columns[column]
        suffix = f"[{guess}]" if guess and not stated else ""
        if suffix or column != signal:
            mapping[column] = signal + suffix
    unmatched = [column for column in columns if column not in matched.values()]
    candidates = {}
    for signal in signals:
        if signal not in matched:
            candidates[signal] = [c for c in unmatched if scores[signal, c] > 0.0 or not units[c]]
    return Proposal(mapping, matched, candidates)


def _clearest(
    scores: Mapping[tuple[str, str], float], matched: Mapping[str, str]
) -> tuple[str, str] | None:
    """Return the pair (signal, column) of the greatest score that has no rival; None without one.

    A rival shares the signal or the column of the pair and has at least its score.
    """
    candidates = {
        (signal, name): score
        for (signal, name), score in scores.items()
        if score > 0.0 and signal not in matched and name not in matched.values()
    }
    for pair, score in sorted(candidates.items(), key=lambda item: -item[1]):
        signal, name = pair
        rivals = (
            other
            for other, other_score in candidates.items()
            if other != pair and other_score >= score and (other[0] == signal or other[1] == name)
        )
        if not any(rivals):
            return pair
    return None


def _score(column: str, unit: str, signal: str, expected: str) -> float:
    """Return the score of a column for a signal; 0 if units or names do not match.

    A unit of the same dimension gives 1, the name 4 if equal, 2 for a word of the same quantity,
    else the share of letters in common if that is high.
    """
    fits = bool(unit) and _alike(unit, expected)
    if unit and not fits:
        return 0.0
    words = _words(column, fits)
    score = 1.0 if fits else 0.0
    if column.casefold() == signal.casefold():
        return score + _SAME_NAME
    others = _words(signal, True)
    if any(_denote(words, quantity) and _denote(others, quantity) for quantity in _WORDS):
        return score + _SAME_QUANTITY
    ratio = SequenceMatcher(None, column.casefold(), signal.casefold()).ratio()
    return score + (ratio if ratio >= _SIMILAR else 0.0)


def _alike(unit: str, other: str) -> bool:
    try:
        return measure_alike(unit, other)
    except UserError:
        return False


def _words(name: str, with_letters: bool) -> set[str]:
    """Return the words in a name, with or without single letters."""
    words = re.findall(r"[^\W\d_]+", name.casefold())
    return {word for word in words if with_letters or len(word) > 1}


def _denote(words: set[str], quantity: set[str]) -> bool:
    """Return whether one of the words is among those for a quantity, or a compound of one."""
    return any(
        word == known or (len(known) >= _COMPOUND and known in word)
        for word in words
        for known in quantity
    )
