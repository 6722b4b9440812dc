"""Tables in the manner of instruments, each with what is in it, made without code of the product.

Every table holds the same course of a current and a voltage. A table that does not tell what it
means has the words that its refusal contains, and the options that settle it.
"""

from __future__ import annotations

import gzip
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

COUNT = 40
STEP = 0.5
TIME = [STEP * k for k in range(COUNT)]
CURRENT = [round(math.sin(0.3 * k), 4) for k in range(COUNT)]
VOLTAGE = [round(3.7 + 0.01 * math.cos(0.2 * k), 5) for k in range(COUNT)]
HEADER = "time [s],current [A],voltage [V]"
NAN = math.nan
UNITS = {"current": "A", "voltage": "V"}


@dataclass(frozen=True)
class OddTable:
    """A table and what is in it.

    Attributes
    ----------
    name : str
        Of the file.
    content : bytes
    time, current, voltage : list of float
        s, A and V, time from the first row on; NaN for a missing value.
    says : tuple of str
        Parts of repairs and notices.
    asks : str
        Part of the refusal without options, if the table does not tell what it means.
    mapping : Mapping of str to str
    reading : Mapping of str to Any
        Options with which the table is read.
    """

    name: str
    content: bytes
    time: list[float] = field(default_factory=lambda: TIME)
    current: list[float] = field(default_factory=lambda: CURRENT)
    voltage: list[float] = field(default_factory=lambda: VOLTAGE)
    says: tuple[str, ...] = ()
    asks: str = ""
    mapping: Mapping[str, str] = field(default_factory=dict)
    reading: Mapping[str, Any] = field(default_factory=dict)


def rows(
    time: Callable[[int], str] = lambda k: f"{TIME[k]:g}",
    current: Callable[[int], str] = lambda k: f"{CURRENT[k]}",
    voltage: Callable[[int], str] = lambda k: f"{VOLTAGE[k]}",
    between: str = ",",
    count: int = COUNT,
) -> list[str]:
    return [between.join((time(k), current(k), voltage(k))) for k in range(count)]


def text(header: str, lines: list[str], *below: str) -> bytes:
    return "\n".join([header, *lines, *below, ""]).encode()


def table(name: str, header: str, lines: list[str], *below: str, **known: Any) -> OddTable:
    return OddTable(f"{name}.csv", text(header, lines, *below), **known)


def _without(values: list[float], *gone: int) -> list[float]:
    return [NAN if k in gone else value for k, value in enumerate(values)]


def _cell(values: list[float], at: int, written: str) -> Callable[[int], str]:
    return lambda k: written if k == at else f"{values[k]}"


def _stamps(form: str, step: float, start: datetime) -> Callable[[int], str]:
    return lambda k: (start + timedelta(seconds=step * k)).strftime(form)


def _local(zone: str, step: float, start: datetime, form: str = "%d.%m.%Y %H:%M:%S") -> Any:
    """Return stamps at the clock on a wall; `start` is in UTC."""
    known = ZoneInfo(zone)
    return lambda k: (
        (start.replace(tzinfo=UTC) + timedelta(seconds=step * k)).astimezone(known).strftime(form)
    )


_DAY = datetime(2026, 1, 31, 23, 59, 50)
_BEFORE_END = datetime(2026, 10, 25, 0, 50)  # 02:50 of summer time in Berlin
_BEFORE_START = datetime(2026, 3, 29, 0, 50)  # 01:50 in Berlin
_NEW_YORK = datetime(2026, 11, 1, 5, 50)
_MINUTE = [60.0 * k for k in range(COUNT)]
_TWELFTH = [5.0 * k for k in range(COUNT)]


def clocks() -> list[OddTable]:
    """Return tables whose times are not what they seem."""
    header = "Zeit,current [A],voltage [V]"
    seconds_of_60 = lambda k: f"10:00:{k:02d}" if k < 60 else ""  # noqa: E731
    berlin = "mapping={'Zeit': 'time[Europe/Berlin]'}"
    plain = "time,current [A],voltage [V]"
    lines = [
        table(
            "leap_second",
            header,
            rows(lambda k: f"10:{9 + k}:60" if k > 0 and k % 5 == 0 else f"10:{10 + k}:00"),
            time=_MINUTE,
        ),
        table("whole_stamps", header, rows(seconds_of_60), time=[float(k) for k in range(COUNT)]),
        table(
            "minutes_only",
            header,
            rows(_stamps("%Y-%m-%d %H:%M", 5.0, datetime(2026, 1, 31, 10, 0))),
            time=_TWELFTH,
            asks="rate='0.2Hz' counts the rows",
            reading={"rate": 0.2},
        ),
        table(
            "seconds_only",
            header,
            rows(_stamps("%d.%m.%Y %H:%M:%S", 0.5, _DAY)),
            asks="coarser than the rows",
            reading={"rate": 2.0},
        ),
        table(
            "days",
            plain,
            rows(lambda k: f"{45000 + 60 * k / 86400:.9f}"),
            time=_MINUTE,
            asks="mapping={'time': 'time[d]'}",
            mapping={"time": "time[d]"},
        ),
        table(
            "matlab_days",
            plain,
            rows(lambda k: f"{738000 + 60 * k / 86400:.9f}"),
            time=_MINUTE,
            asks="mapping={'time': 'time[d]'}",
            mapping={"time": "time[d]"},
        ),
        table("seconds_from_45000", plain, rows(lambda k: f"{45000 + TIME[k]}")),
        table("seconds_since_1970", plain, rows(lambda k: f"{1700000000 + TIME[k]}")),
    ]
    for unit, factor in (("ms", 10**3), ("us", 10**6), ("ns", 10**9)):
        ticks = lambda k, f=factor: str(1700000000 * f + k * f // 2)  # noqa: E731
        lines.append(
            table(
                f"since_1970_in_{unit}",
                plain,
                rows(ticks),
                asks=f"mapping={{'time': 'time[{unit}]'}}",
                mapping={"time": f"time[{unit}]"},
            )
        )
        lines.append(
            table(
                f"named_{unit}",
                f"time_{unit},current [A],voltage [V]",
                rows(lambda k, f=factor: str(k * f // 2)),
            )
        )
    for name, words, factor in (
        ("battery", ("test_time_second", "current [A]", "voltage [V]"), 1),
        ("preferred", ("Test Time / s", "current / A", "voltage / V"), 1),
        ("elapsed", ("Elapsed Time (ms)", "current (A)", "voltage (V)"), 1000),
    ):
        lines.append(table(name, ",".join(words), rows(lambda k, f=factor: f"{TIME[k] * f:g}")))
    for zone, start in (
        ("Europe/Berlin", _BEFORE_END),
        ("Europe/Berlin", _BEFORE_START),
        ("Europe/London", datetime(2026, 3, 29, 0, 40)),
        ("America/New_York", _NEW_YORK),
    ):
        lines.append(
            table(
                f"{zone.replace('/', '_')}_{start:%m}",
                header,
                rows(_local(zone, 60.0, start)),
                time=_MINUTE,
                asks=berlin,
                mapping={"Zeit": f"time[{zone}]"},
                says=(f"local time of {zone}",),
            )
        )
    for form in ("%Y-%m-%d %H:%M:%S%z", "%Y-%m-%d %H:%M:%S %Z", "%Y-%m-%dT%H:%M:%S.%f%z"):
        lines.append(
            table(
                f"zone_stated_{len(lines)}",
                header,
                rows(_local("Europe/Berlin", 60.0, _BEFORE_END, form)),
                time=_MINUTE,
            )
        )
    lines.append(
        table(
            "pause_at_night",
            header,
            rows(_stamps("%d.%m.%Y %H:%M:%S", 60.0, datetime(2026, 6, 14, 1, 50))),
            time=_MINUTE,
        )
    )
    return lines


_NO_VALUES = """9.91E37
9.9E+37
-9.9E37
9.910000e+37
-9999
-999.25
99999
OL
OVERLOAD
∞
-∞
----
#DIV/0!
Error
nan(ind)
1.#IO
****"""


def missing() -> list[OddTable]:
    """Return tables with values that are none."""
    said = "treated as missing (row 12)"
    found = [
        table(
            f"no_value_{k}",
            HEADER,
            rows(voltage=_cell(VOLTAGE, 10, word)),
            voltage=_without(VOLTAGE, 10),
            says=(said,),
        )
        for k, word in enumerate(_NO_VALUES.splitlines())
    ]
    large = [round(-9000.0 + 400.0 * k, 1) for k in range(COUNT)]
    found.append(
        OddTable(
            "no_mark.csv",
            text(HEADER, rows(voltage=_cell(large, 10, "-9999"))),
            voltage=[-9999.0 if k == 10 else v for k, v in enumerate(large)],
        )
    )
    pulse = [999.0 if k % 7 == 0 else 0.0 for k in range(COUNT)]
    found.append(
        OddTable("pulse.csv", text(HEADER, rows(voltage=lambda k: f"{pulse[k]}")), voltage=pulse)
    )
    return found


def decimals() -> list[OddTable]:
    """Return tables whose decimal mark is open, and such as tell it."""
    whole = [float(1200 + 7 * k) for k in range(COUNT)]
    header = "time [s];current [A];voltage [V]"
    found = []
    for mark, word in ((",", "comma"), (".", "point")):
        other = "point" if word == "comma" else "comma"
        written = lambda k, m=mark: f"{whole[k] / 1000:.3f}".replace(".", m)  # noqa: E731
        lines = rows(lambda k: str(k), written, written, ";")
        for stated, values in ((word, [v / 1000 for v in whole]), (other, whole)):
            found.append(
                OddTable(
                    f"open_{word}_{stated}.csv",
                    text(header, lines),
                    [float(k) for k in range(COUNT)],
                    values,
                    values,
                    asks=f"decimal='{stated}' for {values[0]:g}",
                    reading={"decimal": stated},
                )
            )
    german = lambda values: lambda k: f"{values[k]}".replace(".", ",")  # noqa: E731
    found.append(
        OddTable(
            "german.csv", text(header, rows(german(TIME), german(CURRENT), german(VOLTAGE), ";"))
        )
    )
    return found


def forms() -> list[OddTable]:
    """Return tables of every form: delimiters, lines among rows, notations of numbers."""
    bare = "time current voltage"
    minus = lambda k: f"{CURRENT[k]}".replace("-", "\u2212")  # noqa: E731
    fortran = lambda k: f"{CURRENT[k]:.4e}".replace("e", "D")  # noqa: E731
    ranged = lambda k: f"{CURRENT[k] * 1e3:.1f} mA" if k % 2 == 0 else f"{CURRENT[k]} A"  # noqa: E731
    aligned = [f"{TIME[k]:8.1f}  {CURRENT[k]:12.4f}  {VOLTAGE[k]:12.5f}" for k in range(COUNT)]
    spaced = rows(between=" ")
    late = [*rows()[:20], "# pause", *rows()[20:]]
    again = [*rows()[:20], HEADER, *rows()[20:]]
    both = "Time,Channel A,Channel B"
    pico = [*rows(lambda k: f"{1e3 * TIME[k]:.6f}", lambda k: f"{1e3 * CURRENT[k]:.1f}")]
    channels = {"Channel A": "current", "Channel B": "voltage"}
    freq = ["f [Hz],Z [ohm]", *(f"{10 * k},{k + 1}" for k in range(30))]
    return [
        table("spaces", bare, spaced),
        table("aligned", "    time [s]  current [A]   voltage [V]", aligned),
        table("pipes", bare.replace(" ", "|"), rows(between="|")),
        table("commas_in_spaces", bare, [line.replace(".", ",") for line in spaced]),
        table("hash_header", f"# {bare}", spaced),
        table("percent_header", f"% {HEADER}", rows()),
        table("footer", HEADER, rows(), "", "End of data", "Operator: M. Maier", says=("no rows",)),
        table("comment", HEADER, late, says=("1 lines that are no rows skipped (row 22)",)),
        table("header_again", HEADER, again, says=("(row 22)",)),
        table("minus", HEADER, rows(current=minus)),
        table("fortran", HEADER, rows(current=fortran)),
        table("cell_units", "time [s],current,voltage [V]", rows(current=ranged)),
        table(
            "all_cells_with_units",
            bare.replace(" ", ","),
            rows(lambda k: f"{TIME[k]} s", ranged, lambda k: f"{VOLTAGE[k]} V"),
        ),
        table("units_below", f"{both}\n(ms),(mA),(V)\n", pico, mapping=channels),
        table("units_below_bare", f"{both}\nms,mA,V", pico, mapping=channels),
        table("units_below_square", f"{both}\n[ms],[mA],[V]", pico, mapping=channels),
        table(
            "no_header",
            rows()[0],
            rows()[1:],
            asks="columns=",
            reading={"columns": ("time=s", "current=A", "voltage=V")},
        ),
        table(
            "no_time",
            "current [A],voltage [V]",
            [f"{CURRENT[k]},{VOLTAGE[k]}" for k in range(COUNT)],
            asks="no time column",
            reading={"rate": 2.0},
        ),
        table(
            "two_tables",
            HEADER,
            rows(),
            "",
            *freq,
            asks="there are 2 tables",
            reading={"table": "1"},
        ),
        table(
            "two_tables_last",
            "\n".join([*freq, "", HEADER]),
            rows(),
            asks="there are 2 tables",
            reading={"table": "2"},
        ),
        OddTable("packed.csv.gz", gzip.compress(text(HEADER, rows()))),
    ]


def all_tables() -> list[OddTable]:
    """Return all tables of text, of different names."""
    return [*clocks(), *missing(), *decimals(), *forms()]
