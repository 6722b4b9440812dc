"""Tables of a study of laws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.tables import Table, Topic
from studies.hidden_laws import LawCase
from studies.judging.laws_answers import (
    GOOD,
    GROUP,
    LEAST,
    SAID,
    as_good,
    confirmed,
    excluded,
    named,
    wrongly_confirmed,
)
from studies.judging.study import Row, counted, grouped, share, title


def answer_line(row: Row) -> str:
    """Return the answer to a record as a line of text."""
    if excluded(row):
        reason = "it stands still" if row.get("still") else f"{row['widths']:.1f} widths"
        return f"not counted ({reason})"
    naive = (
        f"; naive {row['naive'][0]}{'' if row['naive_right'] else ' (wrong)'}"
        if row.get("naive")
        else ""
    )
    return f"{named(row)}: {words(row)}{naive} ({row['widths']:.1f} widths, {row['seconds']:.0f} s)"


def words(row: Row) -> str:
    """Return the first answer in words, with its alternatives."""
    if not row.get("said"):
        return row.get("refused") or "nothing"
    first = row["said"][0]
    sure = "confirmed" if first["confirmed"] else "not confirmed"
    group = f" | {' | '.join(e['label'] for e in row['alike'][:GROUP])}" if row["alike"] else ""
    more = f" | {len(row['alike']) - GROUP} more" if len(row["alike"]) > GROUP else ""
    return f"{first['label']}{group}{more}, {sure}, {first['gain']:.0f}"


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of the answers to records in which something is hidden."""
    those = [row for row in rows if not excluded(row)]
    still = [row for row in rows if row.get("still")]
    good, first = (sum(named(row) in kinds for row in those) for kinds in (GOOD, GOOD[:1]))
    naive = sum(row["naive_right"] for row in those)
    parts: list[str | Table] = [
        (
            f"{len(rows)} records: in {share(len(still), len(rows))} the signal stands still, and"
            f" {share(len(rows) - len(those) - len(still), len(rows))} leave less than {LEAST:g}"
            f" noise widths; {len(those)} count. The right law over the right signal is first, or"
            f" in a first group of at most {GROUP}, in {share(good, len(those))}, first in"
            f" {share(first, len(those))}; somewhere in the map in"
            f" {share(sum(row.get('in_map') is not None for row in those), len(those))}. The"
            f" naive signal is right in {share(naive, len(those))}; it names no law."
        ),
        (
            f"Confirmed by unseen data: {share(sum(map(confirmed, those)), len(those))};"
            f" confirmed and wrong: {share(sum(map(wrongly_confirmed, those)), len(those))}."
            " Not right, but within 2 % of the error of the truth on what was held out, so that"
            " the record hardly tells them apart:"
            f" {share(sum(map(as_good, those)), len(those))}."
        ),
    ]
    for axis in ("strength", "plant", "noise", "stimulus"):
        parts.append(_table(those, axis))
    of = [{**row, "kind of lack": f"{row['plant']}: {row['kind']}"} for row in those]
    parts += [_table(of, "kind of lack"), *_quality(those), *_excluded(rows), *_wrong(those)]
    return Topic("Hidden laws", parts)


def _table(rows: Sequence[Row], axis: str) -> Table:
    return counted(
        rows,
        axis,
        SAID,
        named,
        confirmed=confirmed,
        confirmed_and_wrong=wrongly_confirmed,
        added_for_multiplied=lambda row: row.get("another_way"),
        wrong_but_as_good=as_good,
        naive_signal_right=lambda row: row["naive_right"],
    )


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def _quality(rows: Sequence[Row]) -> list[str | Table]:
    """Return errors on held-out data, bands, closed forms, and time."""
    table = []
    for axis in ("strength", "plant", "noise"):
        for name, these in grouped(rows, axis).items():
            ratios = [row["ratio"] for row in these if "ratio" in row]
            before = [row["ratio_before"] for row in these if "ratio_before" in row]
            right = [row["ratio"] for row in these if "ratio" in row and named(row) == "first"]
            cover = [row["covered"] for row in these if row.get("covered") is not None]
            forms = [row["closed"] for row in these if row.get("closed") is not None]
            table.append(
                [
                    f"{axis} {name}",
                    len(ratios),
                    _median(before),
                    _median(ratios),
                    _median(right),
                    len(cover),
                    f"{100.0 * np.mean(cover):.0f} %" if cover else "",
                    share(sum(forms), len(forms)) if forms else "",
                ]
            )
    seconds = [row["seconds"] for row in rows]
    cover = [row["covered"] for row in rows if row.get("covered") is not None]
    forms = [row["closed"] for row in rows if row.get("closed") is not None]
    if not seconds:
        return []
    return [
        (
            "Held-out error over that of the truth: median"
            f" {_median([r['ratio'] for r in rows if 'ratio' in r]):.3f}. Where the right one is"
            " first, the 95 % band holds the true curve over"
            f" {100.0 * np.mean(cover) if cover else float('nan'):.1f} % of the range between the 1"
            f" % and 99 % quantiles of the signal ({len(cover)} curves, up to a line, which the"
            " model's parameters may have); a curve that has a closed form has it among the first"
            f" two shapes in {share(sum(forms), len(forms))}. Time: median {_median(seconds):.1f}"
            f" s, 90 % {np.quantile(seconds, 0.9):.1f} s, worst {max(seconds):.1f} s."
        ),
        Table(
            [
                "of",
                "records",
                "without / truth, median",
                "held out / truth, median",
                "where first",
                "bands",
                "cover",
                "closed form told",
            ],
            table,
        ),
    ]


def _excluded(rows: Sequence[Row]) -> list[str | Table]:
    of = [{**row, "of": f"{row['plant']}: {row['kind']}"} for row in rows]
    table = [
        [name, len(these), sum(map(excluded, these)), sum(bool(row.get("still")) for row in these)]
        for name, these in grouped(of, "of").items()
    ]
    return [
        "Not counted, by kind:",
        Table(["kind", "records", "not counted", "of these still"], table),
    ]


def _wrong(rows: Sequence[Row]) -> list[str | Table]:
    wrong = [row for row in rows if named(row) not in GOOD]
    table = [
        [
            title(row, LawCase),
            answer_line(row),
            str(row.get("rank") or ""),
            str(row.get("in_map") or ""),
            f"{row.get('ratio', np.nan):.2f}",
        ]
        for row in wrong
    ]
    columns = ["record", "said", "rank", "place in the map", "held out / truth"]
    return ["What was said of the others:", Table(columns, table)]
