"""Page and badges on the log of `tests.support.compatibility`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from xml.sax.saxutils import escape

PASSED, FAILED, NOT_RUN = "passed", "failed", "not run"
GOOD, BAD = "#2e7d32", "#b3261e"
_MARKS = {PASSED: "✓", FAILED: "✗", NOT_RUN: "–"}
_WAY = ("tool", "version", "fmi", "interface", "build")
_HEAD = """\
# Compatibility

Written by `python -m tests.support.compatibility --page docs/compatibility.md`: every component in
every tool that is here, by each interface, in both versions of FMI. A deviation is the largest of
any output over the largest value of that output, beside the same co-simulation through fmpy's bare
functions; what a master does with time, and a solver of its own, are allowed for. Builds for other
platforms are run by a program in C. Those for macOS are not run: their load commands are checked
(`tests/interop/test_platforms.py`).
"""

Entry = Mapping[str, Any]


def page(entries: Sequence[Entry]) -> str:
    """Write the page on the entries of a log, in Markdown.

    Parameters
    ----------
    entries : sequence of dict
        As of `tests.support.compatibility.log`.
    """
    names = list(dict.fromkeys(entry["component"] for entry in entries))
    ways: dict[tuple[str, ...], dict[str, Entry]] = {}
    for entry in entries:
        ways.setdefault(tuple(entry[key] for key in _WAY), {})[entry["component"]] = entry
    summary = [
        [str(number), *way, *_summary(list(of.values()))]
        for number, (way, of) in enumerate(ways.items(), start=1)
    ]
    marks = [[name, *(_MARKS[of[name]["outcome"]] for of in ways.values())] for name in names]
    reasons = dict.fromkeys(
        f"* {number}, {name if of[name]['outcome'] == FAILED else 'all'}: {_reason(of[name])}"
        for number, of in enumerate(ways.values(), start=1)
        for name in names
        if of[name]["outcome"] != PASSED
    )
    numbers = [str(number) for number in range(1, len(ways) + 1)]
    head = ["", *_WAY, "passed", "largest deviation", "allowed"]
    return "\n".join(
        [
            _HEAD,
            _table(head, summary),
            f"By component; {_MARKS[PASSED]} passed, {_MARKS[FAILED]} failed, {_MARKS[NOT_RUN]} not"
            " run:\n",
            _table(["", *numbers], marks),
            "Not passed:\n" if reasons else "",
            *reasons,
            "",
        ]
    )


def _summary(entries: Sequence[Entry]) -> list[str]:
    """Return how many passed, the largest deviation, and the one that is allowed."""
    passed = sum(entry["outcome"] == PASSED for entry in entries)
    largest = max((entry["deviation"] for entry in entries if "deviation" in entry), default=None)
    deviation = "" if largest is None else f"{largest:.2g}"
    return [f"{passed} of {len(entries)}", deviation, f"{entries[0]['allowed']:g}"]


def _reason(entry: Entry) -> str:
    """Return why a run did not pass."""
    return entry.get("reason") or f"deviation of {entry['deviation']:.2g}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join(lines) + "\n"


def badges(entries: Sequence[Entry]) -> dict[str, str]:
    """Draw a badge for each tool and version of FMI that was run, by file name."""
    outcomes: dict[tuple[str, str, str], list[str]] = {}
    for entry in entries:
        if entry["outcome"] != NOT_RUN:
            tool = entry["tool"], entry["version"], entry["fmi"]
            outcomes.setdefault(tool, []).append(entry["outcome"])
    drawn = {}
    for (name, version, fmi), of_it in outcomes.items():
        passed = of_it.count(PASSED)
        text = f"FMI {fmi}: {passed} of {len(of_it)}"
        colour = GOOD if passed == len(of_it) else BAD
        file = f"{name.lower().replace(' ', '-')}-fmi{fmi[0]}.svg"
        drawn[file] = _svg(f"{name} {version}".strip(), text, colour)
    return drawn


def _svg(left: str, right: str, colour: str) -> str:
    """Draw two fields beside each other."""
    a, b = (14 + 7 * len(text) for text in (left, right))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{a + b}" height="20" role="img"'
        f' aria-label="{escape(left)}: {escape(right)}">'
        f'<rect width="{a}" height="20" fill="#444"/>'
        f'<rect x="{a}" width="{b}" height="20" fill="{colour}"/>'
        '<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11"'
        ' text-anchor="middle">'
        f'<text x="{a / 2}" y="14">{escape(left)}</text>'
        f'<text x="{a + b / 2}" y="14">{escape(right)}</text></g></svg>\n'
    )
