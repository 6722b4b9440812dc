"""Forms of values on the command line, and types of options that have them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any

from fmus.kit import UserError
from orchestration.api.declaration import Form

_RECORDS = "Record, str or Path, or sequence of these"
_ADVICE = "name at least one, or leave the option out"


def comma_list(given: str | Sequence[str], flag: str, advice: str = _ADVICE) -> list[str]:
    """Return names that are separated by commas; UserError if one is empty or repeated.

    Several texts, of an option that is given several times, are one list. The error for a text
    without a name ends with `advice`.
    """
    text = given if isinstance(given, str) else ",".join(given)
    if not text.strip():
        raise UserError(f"{flag} {text!r}: {advice}")
    # a comma in brackets is part of a name, such as thermal_node(loss, room) and A[1,2]
    names = [name.strip() for name in re.split(r",(?![^()]*\)|[^\[\]]*\])", text)]
    if "" in names:
        raise UserError(f"{flag} {text!r}: there is nothing before or after a comma")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UserError(f"{flag} {text!r}: {twice} is named twice")
    return names


def some_of(advice: str) -> Form:
    """Return the form of names separated by commas; `advice` ends the error for an empty text."""
    return NAMES._replace(read=partial(comma_list, advice=advice))


def given_names(value: str | Sequence[str], name: str) -> list[str]:
    """Return names from Python as a list: from a sequence, or from a text with commas."""
    return comma_list(value, name) if isinstance(value, str) else list(value)


def names_among(known: Sequence[str]) -> Form:
    """Return the form of names separated by commas, each from a list of known names."""
    allowed = f"there are {', '.join(known)}"

    def read(texts: Sequence[str], flag: str) -> list[str]:
        names = comma_list(texts, flag, allowed)
        for name in names:
            if name not in known:
                raise UserError(f"{flag} {name}: {allowed}")
        return names

    return Form(read, _join, list[str] | None)


def numbers(least: int) -> Form:
    """Return the form of whole numbers separated by commas, each at least `least`."""

    def read(text: str, flag: str) -> list[int]:
        try:
            values = [int(one) for one in text.split(",")]
        except ValueError:
            values = []
        if not values or min(values) < least:
            raise UserError(f"{flag} {text!r}: write whole numbers from {least} on, such as 1,2,3")
        return values

    def given(value: str | int | Sequence[int], name: str) -> list[int]:
        return read(value, name) if isinstance(value, str) else _listed(value)

    return Form(read, _join, str, given=given)


def _listed(value: Any, name: str = "") -> list[Any]:
    """Return one value or several as a list; a text is one."""
    return list(value) if isinstance(value, Iterable) and not isinstance(value, str) else [value]


def seconds(given: str | float) -> float:
    """Return a time in s from a number of seconds or a text with a unit."""
    try:
        return float(given)  # the range, and nan, is checked where the time is used
    except ValueError:
        from orchestration.fmu.signal import read_amount

        return read_amount(str(given), "s", f"{given!r}")


def size_in_bytes(given: str | float) -> float:
    """Return a size in bytes from a text such as ``1GB``, with a power of a thousand."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([kMGT])B\s*", str(given))
    if match is None:
        raise ValueError(f"{given!r}: write a size with its unit, kB, MB, GB or TB, such as 1GB")
    return float(match[1]) * 1000.0 ** (1 + "kMGT".index(match[2]))


def percent(text: str) -> float:
    """Return a share in percent, above 0 and up to 100, from a text with or without ``%``."""
    try:
        value = float(text.strip().removesuffix("%"))
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 100.0:
        raise ValueError(f"{text!r}: write a share above 0% and up to 100%, such as 95%")
    return value


def band(given: str, name: str) -> tuple[float, float]:
    """Return the ends in Hz of a band of frequencies, such as ``10mHz..2Hz``."""
    from orchestration.fmu.signal import read_amount

    ends = given.split("..")
    if len(ends) != 2:
        raise UserError(f"{name} {given!r}: write two frequencies, such as 10mHz..2Hz")
    low, high = (read_amount(end, "Hz", f"{name} {given!r}") for end in ends)
    if not 0.0 <= low < high:
        raise UserError(f"{name} {given!r}: the first frequency must be below the second one")
    return low, high


def _two_ends(given: str | Sequence[float | str], name: str) -> list[str]:
    """Return the ends of a range as texts, from one text or two texts or numbers."""
    try:
        ends = given.split("..") if isinstance(given, str) else [str(end) for end in given]
    except TypeError:
        ends = []
    if len(ends) != 2 or not all(end.strip() for end in ends):
        raise UserError(f"{name} {given!r}: write two commands, such as -1.3A..1.3A")
    return ends


def rows_per_second(given: str | float) -> float:
    """Return a rate in Hz from a number, or a text with a unit of frequency or of time."""
    from orchestration.fmu.signal import read_amount

    try:
        rate = read_amount(str(given), "Hz", f"{given!r}")
    except UserError:
        step = read_amount(str(given), "s", f"{given!r}")
        rate = 1.0 / step if step else 0.0
    if not 0.0 < rate < inf:
        raise UserError(f"{given!r}: write a rate above 0, such as 100Hz, or a time such as 10ms")
    return rate


def _given_rate(value: str | float | None, name: str) -> float | None:
    """Return a rate in Hz, or none, from Python."""
    try:
        return None if value is None else rows_per_second(value)
    except UserError as error:
        raise UserError(f"{name} {error}") from error


def row_range(given: str, name: str) -> tuple[int, int]:
    """Return the ends of a range of rows, such as ``100..2000``."""
    match = re.fullmatch(r"\s*(\d+)\s*(?:\.\.|:)\s*(\d+)\s*", given)
    ends = (int(match[1]), int(match[2])) if match else (1, 0)
    if ends[0] > ends[1]:
        raise UserError(f"{name} {given!r}: write the first and the last row, such as 100..2000")
    return ends


def optional_seconds(given: str | float | None) -> float | None:
    """Return a time in s as `seconds` does, or None for None."""
    return None if given is None else seconds(given)


def _in_seconds(given: str | float) -> str:
    value = seconds(given)
    return f"{value:.12g}s" if isfinite(value) else f"{value}"


def _join(values: Sequence[object]) -> list[str]:
    return [",".join(map(str, values))]


def _one_or_all(values: list[int]) -> int | list[int]:
    return values[0] if len(values) == 1 else values


def _read_effects(given: str | Sequence[str], flag: str) -> list[str]:
    names = comma_list(given, flag, "name effects, see ppy info, or none")
    return [] if names == ["none"] else names


def _read_records(texts: list[str], flag: str) -> list[str]:
    for text in texts:
        if not text.strip():
            raise UserError(f"{flag} {text!r}: name a record, or labels such as 7,8,9")
    return texts


def _read_mapping(texts: Sequence[str], flag: str) -> dict[str, str]:
    from orchestration.records import parse_mapping

    return parse_mapping(texts)


def _read_settings(texts: Sequence[str], flag: str) -> dict[str, str]:
    settings = {}
    for text in texts:
        # the name may have such signs in it, and a text too: the model knows its names
        name, equals, value = text.rpartition("=")
        if not equals:
            raise UserError(f"{flag} {text!r}: write name=value or name=value[unit]")
        if name.strip() in settings:
            raise UserError(f"{flag} {text}: {name.strip()} has a value already")
        settings[name.strip()] = value.strip()
    return settings


def with_files(texts: Sequence[str], flag: str) -> list[str]:
    """Return settings with those of parameter files, ``FILE`` or ``MEMBER@FILE``, in their place.

    A setting that is typed overrides that of a file.

    Raises
    ------
    UserError
        If a file cannot be read, or a value is neither a number nor a text.
    """
    typed = [text for text in texts if "=" in text or not text.endswith((".toml", ".ssv"))]
    names = {text.rpartition("=")[0].strip() for text in typed}
    values: dict[str, object] = {}
    for text in texts:
        if text not in typed:
            values |= _read_parameters(text)
    return [*_pairs({n: v for n, v in values.items() if n not in names}), *typed]


def _read_parameters(text: str) -> dict[str, object]:
    """Return the parameters of ``FILE``; of ``MEMBER@FILE`` with the member's name."""
    from orchestration.identify import parameter_set

    member, _, path = text.rpartition("@")
    read = parameter_set.read if path.endswith(".ssv") else _read_table
    values = read(Path(path))
    return {f"{member}.{name}" if member else name: value for name, value in values.items()}


def _read_table(path: Path) -> Mapping[str, object]:
    """Return the table ``[parameters]`` of a file."""
    from orchestration.experiment.values import read_toml

    values = read_toml(path).get("parameters")
    if not isinstance(values, dict):
        raise UserError(f"{path}: a file of parameters has a table [parameters]")
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise UserError(f'{path}: {name} = {value}: write a number or "number unit"')
    return values


def _given_parameters(value: Any, name: str) -> Any:
    """Return the settings of a file that is named from Python; other settings as they are."""
    is_file = isinstance(value, str | Path)
    return _read_settings(with_files([str(value)], name), name) if is_file else value


def _pairs(values: Mapping[str, object]) -> list[str]:
    return [f"{name}={value}" for name, value in values.items()]


# --- forms ---------------------------------------------------------------------------------------

NAMES = Form(comma_list, _join, list[str] | None, given=given_names)
EFFECTS = Form(
    _read_effects,
    lambda names: [",".join(names) or "none"],
    list[str] | None,
    given=lambda value, name: _read_effects(value, name) if isinstance(value, str) else list(value),
)
MAPPING = Form(_read_mapping, _pairs, list[str] | None, metavar="COLUMN=SIGNAL[UNIT]")
SETTINGS = Form(_read_settings, _pairs, list[str] | None, metavar="NAME=VALUE[UNIT]")
PARAMETERS = SETTINGS._replace(
    read=lambda texts, flag: _read_settings(with_files(texts, flag), flag), given=_given_parameters
)
LATER = Form(
    typed=list[Path] | None,
    write=lambda values: list(map(str, values)),
    given=lambda value, name: [*value] if isinstance(value, list | tuple) else [value],
    metavar="AFTER",
    kind=_RECORDS,
)
TEXTS = Form(typed=list[str] | None, write=list, metavar="KEY=VALUE")
ASSIGNMENTS = TEXTS._replace(read=with_files)
RECORDS = TEXTS._replace(read=_read_records, metavar="RECORD", kind=_RECORDS)
RATIOS = TEXTS._replace(given=_listed, metavar="A/B")
SEGMENT = SETTINGS._replace(metavar="COLUMN=LABEL")
ROWS = Form(
    row_range,
    lambda ends: [f"{ends[0]}..{ends[1]}"],
    str | None,
    given=lambda value, name: row_range(value, name) if isinstance(value, str) else value,
    metavar="FIRST..LAST",
    kind='tuple of int or str such as "100..2000"',
)
BAND = Form(
    band,
    lambda ends: [f"{ends[0]:.12g}Hz..{ends[1]:.12g}Hz"],
    str | None,
    given=lambda value, name: band(value, name) if isinstance(value, str) else value,
    metavar="FROM..TO",
    kind='tuple of float in Hz or str such as "10mHz..2Hz"',
)
LIMITS = Form(
    _two_ends,
    lambda ends: ["..".join(ends)],
    str | None,
    given=_two_ends,
    metavar="FROM..TO",
    kind='tuple of float in the unit of the command or str such as "0..10V"',
)
SIZE = Form(
    write=lambda value: [f"{value / 1e6:g}MB"],
    typed=float | None,
    parse=size_in_bytes,
    metavar="SIZE",
)
TIME = Form(
    write=lambda value: [_in_seconds(value)],
    typed=float | None,
    parse=seconds,
    metavar="TIME",
    kind='float in s or str such as "10s"',
)
RATE = Form(
    write=lambda value: [f"{rows_per_second(value):.12g}Hz"],
    typed=float | None,
    parse=rows_per_second,
    given=_given_rate,
    metavar="HZ",
    kind='float in Hz or str such as "100Hz" or "10ms"',
)
TIMES = Form(
    lambda text, flag: [seconds(one) for one in comma_list(text, flag)],
    lambda values: [",".join(_in_seconds(one) for one in values)],
    str | None,
    given=_listed,
    metavar="TIMES",
    kind=f"{TIME.kind}, or sequence of these",
)
PERCENT = Form(
    write=lambda value: [f"{value:g}%"], typed=float | None, parse=percent, metavar="PERCENT"
)
LEFT_OUT = Form(read=lambda typed, flag: not typed, typed=bool)
ONE_OR_ALL = Form(
    lambda text, flag: _one_or_all(numbers(0).read(text, flag)),
    lambda value: _join(value if isinstance(value, Sequence) else [value]),
    str | None,
)

# --- types of options, with their forms -----------------------------------------------------------

File = Annotated[Path | None, Form(metavar="FILE", kind="str or Path")]
Names = Annotated[Sequence[str], NAMES]
Number = Annotated[int | None, Form(metavar="N")]
Percent = Annotated[float | None, PERCENT]
Rate = Annotated[float | str | None, RATE]
Seconds = Annotated[float | None, TIME]
Settings = Annotated[Mapping[str, float | str] | None, SETTINGS]
Texts = Annotated[Sequence[str], TEXTS]
Time = Annotated[float | str | None, TIME]
