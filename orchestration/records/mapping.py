"""Mapping of columns to signals of a model: by equal names, or by ``--map column=signal[unit]``."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from fmus.kit.errors import UserError, suggestion
from orchestration.records.proposal import propose
from orchestration.records.record import Repair, refuse
from orchestration.records.tables import INDEX, Column, Table, split_header_cell
from orchestration.records.times import TIME, find_time, holds_instants, joined, other_half
from orchestration.reporting import option


@dataclass(frozen=True)
class Match:
    """A column and the signal it is.

    Parameters
    ----------
    column : Column
        The column of the file.
    signal : str
        The model's name, or ``"time"``.
    unit : str or None
        The unit the user says the column is in; None: take the file's.
    """

    column: Column
    signal: str
    unit: str | None


def parse_mapping(entries: Iterable[str]) -> dict[str, str]:
    """Parse ``file_column=signal`` and ``file_column=signal[unit]`` entries.

    Parameters
    ----------
    entries : iterable of str
        As given on the command line.

    Returns
    -------
    dict of str to str
        File column to signal, the unit still behind it: ``{"strain": "displacement[m]"}``.

    Raises
    ------
    UserError
        If an entry has not that form, or a column or a signal occurs twice.
    """
    mapping: dict[str, str] = {}
    for entry in entries:
        column, equals, target = (part.strip() for part in entry.rpartition("="))
        signal, unit = split_header_cell(target)
        if (
            not (equals and column and signal)
            or set("[]") & set(INDEX.sub("", signal))
            or (unit is None and "[" in target)
        ):
            raise UserError(
                f"{option('mapping', entry)}: the form is file_column=signal or"
                " file_column=signal[unit]"
            )
        if column in mapping:
            raise UserError(f"{option('mapping', entry)}: column '{column}' is mapped twice")
        is_element = INDEX.sub("", target) == signal  # whose index is no unit
        if not is_element and signal in (split_header_cell(t)[0] for t in mapping.values()):
            raise UserError(f"{option('mapping', entry)}: signal '{signal}' is mapped twice")
        mapping[column] = target
    return mapping


def _find_column(table: Table, name: str, why: str) -> Column:
    """Find a column by its name, or by its whole header cell ``name [unit]``."""
    called = [
        column
        for column in table.columns
        if name in (column.name, column.title, f"{column.name} [{column.unit}]")
    ]
    if len(called) > 1:
        raise refuse(table.path, f"{len(called)} columns are called '{name}'; rename them")
    if not called:
        raise refuse(
            table.path, f"{why}: there is no column '{name}'{suggestion(name, table.names())}"
        )
    return called[0]


def match_columns(
    table: Table, signals: Mapping[str, str], mapping: Mapping[str, str], required: Collection[str]
) -> list[Match]:
    """Decide which column is which signal; time comes first.

    Parameters
    ----------
    table : Table
        The file's columns; takes a line for what is ignored.
    signals : mapping of str to str
        The model's signals and their units.
    mapping : mapping of str to str
        The user's renaming, as `parse_mapping` gives it.
    required : collection of str
        Signals that must be there.

    Returns
    -------
    list of Match
        Time, then the signals in the model's order.

    Raises
    ------
    UserError
        If a mapped column, a required signal, the time or every signal is absent, or a name occurs
        twice.
    """
    matches = _mapped(table, signals, mapping)
    taken = [match.column for match in matches.values()]
    if len({id(column) for column in taken}) != len(taken):
        raise refuse(table.path, f"{option('mapping')} gives one column to two signals")
    if TIME not in matches:
        matches[TIME] = Match(find_time(table, signals, _free(table, taken)), TIME, None)
    taken.append(matches[TIME].column)
    _complete_time(table, matches, taken)
    for signal in signals:
        if signal not in matches:
            _match_name(table, signal, matches, taken)
    _match_members(table, signals, matches, taken)
    ignored = [column.name for column in _free(table, taken)]
    absent = [signal for signal in signals if signal not in matches]
    advice = _advice(table, _free(table, taken), {signal: signals[signal] for signal in absent})
    for signal in required:
        if signal not in matches:
            raise refuse(
                table.path,
                f"the signal '{signal}' [{signals.get(signal, '?')}] is required and not among the"
                f" columns{suggestion(signal, ignored)}{advice}",
            )
    if len(matches) == 1:
        raise refuse(
            table.path,
            f"none of the columns {', '.join(table.names())} is a signal of the model"
            f" ({', '.join(signals)}){advice}",
        )
    if ignored:
        hints = [f"'{name}'{suggestion(name, absent, few=0)}" for name in ignored]
        table.repairs.append(
            Repair("ignored columns", f"not signals of the model, so ignored: {', '.join(hints)}")
        )
    return [matches[TIME], *(matches[signal] for signal in signals if signal in matches)]


def _advice(table: Table, free: Sequence[Column], absent: Mapping[str, str]) -> str:
    """Return the mapping that probably gives a model what it lacks, or that one is needed."""
    columns = {table.map_name(column): (column.unit or "", "") for column in free}
    likely = propose(columns, absent).mapping
    if likely:
        return f"; probably: {option('mapping', likely)}"
    return f"; say which column it is: {option('mapping', {'column': 'signal'})}"


def _mapped(
    table: Table, signals: Mapping[str, str], mapping: Mapping[str, str]
) -> dict[str, Match]:
    """Match the columns that the user has renamed."""
    matches: dict[str, Match] = {}
    for name, target in mapping.items():
        signal, unit = (target, None) if target in signals else split_header_cell(target)
        given_as = option("mapping", {name: target})
        if signal != TIME and signal not in signals:
            raise UserError(
                f"{given_as}: the model has no signal '{signal}'{suggestion(signal, signals)}"
            )
        if signal in matches:
            raise UserError(f"{given_as}: signal '{signal}' is mapped twice")
        matches[signal] = Match(_find_column(table, name, given_as), signal, unit)
    return matches


def _free(table: Table, taken: list[Column]) -> list[Column]:
    """Columns that are no signal yet."""
    return [column for column in table.columns if not any(column is other for other in taken)]


def _complete_time(table: Table, matches: dict[str, Match], taken: list[Column]) -> None:
    """Join the time of day to the date, where they are in two columns."""
    time = matches[TIME]
    other = other_half(time.column, _free(table, taken)) if holds_instants(time.column) else None
    if other is not None:
        taken.append(other)
        matches[TIME] = Match(joined(table, time.column, other), TIME, time.unit)


def _match_name(table: Table, signal: str, matches: dict[str, Match], taken: list[Column]) -> None:
    """Take the column that has the name of a signal, of an element of an array with its index."""
    free = [column for column in _free(table, taken) if signal in (column.name, column.title)]
    if len(free) > 1:
        raise refuse(
            table.path, f"{len(free)} columns are called '{signal}'; rename them, or keep one"
        )
    if free:
        (column,) = free
        taken.append(column)
        is_index = column.name != signal and INDEX.search(signal) is not None
        own = replace(column, name=signal, unit=None) if is_index else column
        matches[signal] = Match(own, signal, None)


def _match_members(
    table: Table, signals: Iterable[str], matches: dict[str, Match], taken: list[Column]
) -> None:
    """Take the column ``member.signal`` for a signal without one, as systems' results name it."""
    for signal in signals:
        free = [column for column in _free(table, taken) if column.name.endswith(f".{signal}")]
        if signal not in matches and len(free) == 1:
            matches[signal] = Match(free[0], signal, None)
            taken.append(free[0])
            message = (
                f"column '{free[0].name}' is read as {signal}: the only one of a member of this"
                " name"
            )
            table.repairs.append(Repair("member", message))
