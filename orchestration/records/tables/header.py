"""Header cells as instruments write them: ``name [unit]``, ``name (unit)``, ``name/unit``."""

import re
from collections.abc import Sequence

_BRACKETED = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]", re.DOTALL)
_PARENTHESISED = re.compile(r"(?P<name>.*?)\s*\((?P<unit>[^()]*)\)", re.DOTALL)
_IN_BRACKETS = re.compile(r"[(\[]\s*([^()\[\]]*?)\s*[)\]]")
_SINCE = re.compile(r"(\w+)\s+since\s.*", re.DOTALL)  # of times in NetCDF (CF conventions)
# a name that says that it is a time, and in which unit
_TIME_IN_UNIT = re.compile(
    r"(?:.*[\s_.-])?(?:time|t|zeit|timestamp|elapsed|clock)[\s_.-]+"
    r"(?P<unit>ns|us|µs|ms|msecs?|milliseconds?|microseconds?|nanoseconds?|s|secs?|seconds?|min"
    r"|minutes?|h|hours?|days?)",
    re.IGNORECASE,
)
_WORDED = re.compile(r"(?P<name>.*\S)\s+in\s+(?P<unit>\S+)", re.DOTALL)
_REFERRED = re.compile(r"\s+vs\.?\s.*", re.DOTALL)
_TIME_OF_DAY = re.compile(r"d{0,2}[.\s]?h{1,2}:m(?:in|m)?(?::s{1,2}(?:[.,:](?:ms|[sf0]+))?)?")
# units in measured files; pint would also accept dt, dV and the name a of a channel
_FACTOR = (
    r"(?:[GMkmuµμnp]?(?:Ohm|ohm|Ω|Pa|Hz|Ah|Wh|VA|Nm|bar|eV|[sAVWJCFHNgmSTLlK])"
    r"|cm|min|hr?|d|sec|rad|°[CF]|[℃℉]|°|deg[CF]?|rpm|%|mol|cd|1)(?:\^?-?[1-4]|[²³])?"
)
_UNIT = re.compile(rf"{_FACTOR}(?:[*·./]{_FACTOR})*")
# unit of pint by its name in files; None for "no unit"
_SPELLED = {
    "#": None,
    "": None,
    "-": "1",
    "n/a": None,
    "bits": None,
    "vdc": "V",
    "vac": "V",
    "volt": "V",
    "volts": "V",
    "adc": "A",
    "aac": "A",
    "amp": "A",
    "amps": "A",
    "ampere": "A",
    "sec": "s",
    "secs": "s",
    "sek": "s",
    "second": "s",
    "seconds": "s",
    "sekunden": "s",
    "msec": "ms",
    "msecs": "ms",
    "milliseconds": "ms",
    "millisecond": "ms",
    "microsecond": "us",
    "microseconds": "us",
    "nanosecond": "ns",
    "nanoseconds": "ns",
    "min": "min",
    "minute": "min",
    "minutes": "min",
    "day": "d",
    "days": "d",
    "std": "h",
    "std.": "h",
    "hour": "h",
    "hours": "h",
    "deg c": "degC",
    "u/min": "rpm",
    "nm": "N*m",
}
_SHORTEST_WORD = 3  # letters of a name that is read as a unit, such as Amps
_KEPT = {"nm": "nm"}  # a nanometre, where Nm is none


def plain_unit(text: str) -> str | None:
    """Return the name of a unit in pint; None for a sign of no unit.

    Parameters
    ----------
    text : str
        Name in the file, such as ``VDC``, ``V vs. Ref.`` or ``#``. An unknown name is returned
        unchanged.

    Returns
    -------
    str or None
    """
    bare = _IN_BRACKETS.fullmatch(text.strip())
    unit = _REFERRED.sub("", bare[1] if bare else text.strip())
    since = _SINCE.fullmatch(unit)
    unit = since[1] if since else unit
    return _KEPT.get(unit) or _SPELLED.get(unit.casefold(), unit)


def is_unit(text: str) -> bool:
    """Return whether a text is a usual unit of measured files."""
    unit = plain_unit(text)
    return unit is not None and _UNIT.fullmatch(unit) is not None


def unit_in_name(name: str) -> str:
    """Return the unit that a name is (``Amps``) or ends in (``I_mA``); else an empty text."""
    if len(name) >= _SHORTEST_WORD and is_unit(name):
        return plain_unit(name) or ""
    stem, _, last = name.rpartition("_")
    return (plain_unit(last) or "") if stem and is_unit(last) else ""


def are_units(cells: Sequence[str]) -> bool:
    """Return whether all cells are units or signs of no unit, and at least one is a unit."""
    return any(map(is_unit, cells)) and all(
        is_unit(cell) or plain_unit(cell) is None for cell in cells
    )


def read_header_cell(cell: str) -> tuple[str, str | None]:
    """Split a header cell of a file into name and unit.

    In square brackets any text is a unit, elsewhere only a usual unit, see :func:`is_unit`.

    Parameters
    ----------
    cell : str
        ``name [unit]``, ``name (unit)``, ``name/unit`` or ``name in unit``.

    Returns
    -------
    tuple of (str, str or None)
        Name, and unit or None where there is none.
    """
    name, unit = _split(cell.strip())
    if unit == "C" and "temp" in name.casefold():
        unit = "degC"
    return name, unit


def _split(text: str) -> tuple[str, str | None]:
    """Return name and unit by the form of a header cell."""
    bracketed = _BRACKETED.fullmatch(text)
    if bracketed:
        return bracketed["name"], plain_unit(bracketed["unit"])
    parenthesised = _PARENTHESISED.fullmatch(text)
    if parenthesised and parenthesised["name"]:
        if is_unit(parenthesised["unit"]):
            return parenthesised["name"], plain_unit(parenthesised["unit"])
        if _TIME_OF_DAY.fullmatch(parenthesised["unit"].casefold()):
            return parenthesised["name"], None
    for slash in re.finditer("/", text):
        name = text[: slash.start()].strip()
        unit = text[slash.end() :].strip()
        if name and is_unit(unit):
            return name, plain_unit(unit)
    timed = _TIME_IN_UNIT.fullmatch(text)
    if timed:
        return text, plain_unit(timed["unit"].lower())
    worded = _WORDED.fullmatch(text)
    if worded and is_unit(worded["unit"]):
        return worded["name"], plain_unit(worded["unit"])
    return text, None
