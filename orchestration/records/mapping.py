"""Mapping of columns to signals of a model: by equal names, or by ``--map column=signal[unit]``."""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from fmus.kit import quoting
from fmus.kit.errors import UserError, suggestion
from orchestration.records.formula import Formula, is_formula
from orchestration.records.proposal import propose
from orchestration.records.record import refuse
from orchestration.records.tables import INDEX, Column, Table, split_header_cell
from orchestration.records.times import (
    TIME,
    complementary_column,
    find_time,
    merge_date_and_time,
)
from orchestration.reporting import option

_EQUALS = re.compile(r"\s*=\s*")


@dataclass(frozen=True)
class Match:
    """A column of a file and its signal.

    Parameters
    ----------
    column : Column
        The column of the file.
    signal : str
        Name in the model, or ``"time"``.
    unit : str or None
        Unit of the column as the user states it; None for the unit in the file.
    """

    column: Column
    signal: str
    unit: str | None


def parse_mapping(entries: Iterable[str]) -> dict[str, str]:
    """Parse ``file_column=signal``, ``file_column=signal[unit]`` and ``signal=formula`` entries.

    Parameters
    ----------
    entries : iterable of str
        As given on the command line.

    Returns
    -------
    dict of str to str
        Signal, with its unit if stated, by file column: ``{"strain": "displacement[m]"}``; and
        formula by signal: ``{"current": "-I"}``.

    Raises
    ------
    UserError
        If an entry does not have that form, or a column or a signal occurs twice.
    """
    mapping: dict[str, str] = {}
    for entry in entries:
        column, equals, target = (part.strip() for part in entry.rpartition("="))
        signal, _ = split_header_cell(target)
        if is_formula(signal):
            if column in mapping:
                raise UserError(f"{option('mapping', entry)}: signal '{column}' is mapped twice")
            mapping[column] = target
            continue
        # brackets are either the index of an array element, as in A[2,1], or around a unit
        has_other_bracket = bool(set("[]") & set(INDEX.sub("", signal)))
        if not (equals and column and signal) or has_other_bracket:
            raise UserError(
                f"{option('mapping', entry)}: the form is file_column=signal or"
                " file_column=signal[unit]"
            )
        if column in mapping:
            raise UserError(f"{option('mapping', entry)}: column '{column}' is mapped twice")
        is_element = INDEX.sub("", target) == signal  # A[2] is split like A in a unit 2
        if not is_element and signal in (split_header_cell(t)[0] for t in mapping.values()):
            raise UserError(f"{option('mapping', entry)}: signal '{signal}' is mapped twice")
        mapping[column] = target
    return mapping


def _find_column(table: Table, name: str, entry: str) -> Column:
    """Return the column with a name, or a header cell ``name [unit]``; raise if it is not unique.

    `entry` is the option for the message.
    """
    matches = [
        column
        for column in table.columns
        if name in (column.name, column.title, f"{column.name} [{column.unit}]")
    ]
    if len(matches) > 1:
        raise refuse(table.path, f"{len(matches)} columns are called '{name}'; rename them")
    if not matches:
        raise refuse(
            table.path, f"{entry}: there is no column '{name}'{suggestion(name, table.names())}"
        )
    return matches[0]


def match_columns(
    table: Table, signals: Mapping[str, str], mapping: Mapping[str, str], required: Collection[str]
) -> list[Match]:
    """Match columns to the time and to the signals of a model.

    Parameters
    ----------
    table : Table
        Columns of the file; a repair is added for those that are ignored.
    signals : mapping of str to str
        The model's signals and their units.
    mapping : mapping of str to str
        Signal by column as the user states it, see `parse_mapping`.
    required : collection of str
        Signals that must be there.

    Returns
    -------
    list of Match
        Time, then the signals in the model's order.

    Raises
    ------
    UserError
        If a mapped column, a required signal, the time or every signal is missing, or a name is not
        unique.
    """
    matches, computed = _stated_matches(table, signals, mapping)
    matched = [match.column for match in matches.values()]
    if len({id(column) for column in matched}) != len(matched):
        raise refuse(table.path, f"{option('mapping')} gives one column to two signals")
    matched += computed
    time = matches.pop(TIME, None)
    if time is None:
        time = Match(find_time(table, signals, _unmatched(table, matched)), TIME, None)
    matched.append(time.column)
    time = _with_other_half(table, time, matched)
    for signal in signals:
        if signal not in matches:
            _match_name(table, signal, matches, matched)
    so_far = (table, signals, matches, matched)
    _match_alike(*so_far, _is_of_member, "of a member of this name")
    _match_alike(*so_far, _is_written_alike, "that is written so where spaces may not be")
    unmatched = _unmatched(table, matched)
    ignored = [column.name for column in unmatched]
    missing = {signal: unit for signal, unit in signals.items() if signal not in matches}
    advice = _advice(table, unmatched, missing)
    for signal in required:
        if signal not in matches:
            raise refuse(
                table.path,
                f"the signal '{signal}' [{signals.get(signal, '?')}] is required and not among the"
                f" columns{suggestion(signal, ignored)}{advice}",
            )
    if not matches:
        raise refuse(
            table.path,
            f"none of the columns {', '.join(table.names())} is a signal of the model"
            f" ({', '.join(signals)}){advice}",
        )
    if ignored:
        hints = [
            f"'{name}'{suggestion(name, missing, few=0)}" if name else "a column without a name"
            for name in ignored
        ]
        table.note("ignored columns", f"not signals of the model, so ignored: {', '.join(hints)}")
    return [time, *(matches[signal] for signal in signals if signal in matches)]


def _advice(table: Table, unmatched: Sequence[Column], missing: Mapping[str, str]) -> str:
    """Return the end of a message: the probable mapping, and what each other column may be."""
    columns = {table.map_name(column): (column.unit or "", "") for column in unmatched}
    proposal = propose(columns, missing)
    begin = "probably" if proposal.mapping else "say which column it is"
    advice = f"; {begin}: {option('mapping', proposal.mapping or {'column': 'signal'})}"
    for column in columns:
        fitting = [signal for signal, names in proposal.open.items() if column in names]
        if fitting:
            any_of_them = 1 < len(fitting) == len(proposal.open)
            advice += f"; '{column}' may be {'any' if any_of_them else ' or '.join(fitting)}"
    return advice


def _stated_matches(
    table: Table, signals: Mapping[str, str], mapping: Mapping[str, str]
) -> tuple[dict[str, Match], list[Column]]:
    """Return the matches that the user states, by signal, and the columns of formulas."""
    matches: dict[str, Match] = {}
    computed: list[Column] = []
    for entry in mapping.items():
        name, target = split_at_names(table, signals, *entry)
        signal, unit = (target, None) if target in signals else split_header_cell(target)
        argument = option("mapping", {name: target})
        if signal not in signals and name in (*signals, TIME) and is_formula(signal):
            is_index = unit is not None and unit.replace(",", "").isdigit()  # of a column u[2]
            formula = Formula(table, target if is_index else signal, argument)
            matches[name] = Match(formula.column(name), name, None if is_index else unit)
            computed += formula.columns
            continue
        if signal != TIME and signal not in signals:
            raise UserError(
                f"{argument}: the model has no signal '{signal}'{suggestion(signal, signals)}"
            )
        if signal in matches:
            raise UserError(f"{argument}: signal '{signal}' is mapped twice")
        matches[signal] = Match(_find_column(table, name, argument), signal, unit)
    return matches, computed


def split_at_names(
    table: Table, signals: Mapping[str, str], name: str, target: str
) -> tuple[str, str]:
    """Return the column and the target of an entry; names of either may hold equals signs."""
    parts = _EQUALS.split(f"{name}={target}")
    columns = {_EQUALS.sub("=", text): text for c in table.columns for text in (c.title, c.name)}
    known = {_EQUALS.sub("=", signal): signal for signal in (*signals, TIME)}
    for k in range(1, len(parts)):
        column = columns.get("=".join(parts[:k]))
        text = "=".join(parts[k:])
        signal, unit = (text, None) if text in known else split_header_cell(text)
        if column is not None and signal in known:
            return column, known[signal] + (f"[{unit}]" if unit else "")
    return name, target


def _unmatched(table: Table, matched: list[Column]) -> list[Column]:
    """Return the columns that are not matched yet."""
    return [column for column in table.columns if not any(column is other for other in matched)]


def _with_other_half(table: Table, time: Match, matched: list[Column]) -> Match:
    """Return the time with the column of its date or time of day, if there is one."""
    other = complementary_column(time.column, _unmatched(table, matched))
    if other is None:
        return time
    matched.append(other)
    return replace(time, column=merge_date_and_time(table, time.column, other))


def _match_name(
    table: Table, signal: str, matches: dict[str, Match], matched: list[Column]
) -> None:
    """Match the column that has the name of a signal, including the index of an array element."""
    columns = [
        column for column in _unmatched(table, matched) if signal in (column.name, column.title)
    ]
    if len(columns) > 1:
        raise refuse(
            table.path, f"{len(columns)} columns are called '{signal}'; rename them, or keep one"
        )
    if columns:
        column = columns[0]
        matched.append(column)
        if column.name != signal and INDEX.search(signal):  # the index was read as a unit
            column = replace(column, name=signal, unit=None)
        matches[signal] = Match(column, signal, None)


def _match_alike(
    table: Table,
    signals: Iterable[str],
    matches: dict[str, Match],
    matched: list[Column],
    is_alike: Callable[[str, str], bool],
    reason: str,
) -> None:
    """Match a column whose name is alike to a signal without a column.

    A signal is matched only if there is exactly one such column; it is noted as a repair.
    """
    for signal in signals:
        columns = [column for column in _unmatched(table, matched) if is_alike(column.name, signal)]
        if signal not in matches and len(columns) == 1:
            column = columns[0]
            matches[signal] = Match(column, signal, None)
            matched.append(column)
            message = f"column '{column.name}' is read as {signal}: the only one {reason}"
            table.note("member", message)


def _is_of_member(name: str, signal: str) -> bool:
    """Return whether a column is ``member.signal`` of a system's result."""
    return name.endswith(f".{signal}")


def _is_written_alike(name: str, signal: str) -> bool:
    """Return whether a signal is a column's name as models may write it: ``Zone_3`` for Zone 3."""
    return quoting.identifier(name, "signal") == signal
