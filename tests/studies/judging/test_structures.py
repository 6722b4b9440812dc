"""Claims: what the page on table 3-2 says is what its tables say, and these are of the records that
it describes.

Oracles: the record without noise, which bounds every free run; the definitions of containment among
structures.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from studies.judging import structures

PAGE = Path(__file__).parents[3] / "docs" / "black-box-structures.md"
NAMES = ("ARX", "ARMAX", "OE", "SS", "BJ")


def tables():
    """Figures by table and record, and the order beside them."""
    found = []
    for text in PAGE.read_text(encoding="utf-8").split("\n## ")[1:4]:
        rows = re.findall(r"^\| ([a-z].*?) \| (.*) \| (.*?) \|$", text, re.M)
        found.append(
            {
                name: (dict(zip(NAMES, map(float, cells.split(" | ")), strict=True)), order)
                for name, cells, order in rows
                if name != "record"
            }
        )
    return found


def cases(part):
    return [values for name, (values, _) in tables()[part].items() if name != "printed"]


def test_the_printed_figures_are_those_of_the_thesis():
    printed = [table["printed"][0] for table in tables()]
    typed = {
        "ARX": (86.8, 80.1, -9.5),
        "ARMAX": (75.0, 58.7, -9.2),
        "OE": (95.8, 92.9, -7.6),
        "SS": (92.8, 86.4, -9.7),
        "BJ": (94.3, 90.1, -9.5),
    }
    assert {name: tuple(part[name] for part in printed) for name in NAMES} == typed
    assert [table["printed"][1] for table in tables()[:2]] == ["OE, BJ, SS, ARX, ARMAX"] * 2


def test_orders_and_counts_are_those_of_the_figures():
    fits, unseen, criteria = (cases(part) for part in range(3))
    assert [len(part) for part in (fits, unseen, criteria)] == [8, 8, 8]
    for table, sign in zip(tables(), (1, 1, -1), strict=True):
        for values, order in table.values():
            shown = [sign * values[name] for name in order.split(", ")]
            assert shown == sorted(shown, reverse=True)
    said = " ".join(PAGE.read_text(encoding="utf-8").split())
    first = [sum(max(v, key=v.get) == "OE" for v in part) for part in (fits, unseen)]
    assert (
        f"on identification data in {first[0]} of 8 cases, on validation data in {first[1]} of 8"
        in said
    )
    # ARMAX contains ARX, so that it is not behind by the criterion
    assert all(v["ARMAX"] <= v["ARX"] + 0.005 for v in criteria)
    assert "in 0 of 8 by the criterion" in said
    # OE minimises the error that it is judged by: nothing with paths of their own follows the same
    # data better
    assert all(v["OE"] >= v["BJ"] for v in fits)
    assert all(sorted(v, key=v.get)[-2:] in (["BJ", "OE"], ["OE", "BJ"]) for v in fits)


@pytest.mark.parametrize("case", [structures.CASES[0], structures.CASES[2]], ids=str)
@pytest.mark.slow
def test_no_free_run_is_nearer_than_the_truth_but_for_what_it_fits_of_the_noise(case):
    """The noise is all that a right model leaves, 22 µm; without a trend removed such a model is
    among those of OE.
    """
    found = structures.figures(case, 0)
    output = structures.record(case, 0).output
    ceiling = 100.0 * (1.0 - np.exp(-7.6 / 2.0) / np.std(output))
    for name, (fit, _, _) in found.items():
        assert fit < ceiling + 3.0, name
    assert found["OE"][0] > ceiling - 3.0
    assert found["ARX"][0] < found["OE"][0]


def test_noise_is_that_of_the_printed_criteria():
    """Of BJ's criterion and of OE's: the square root of the loss in mm², and how much of it a
    sample ahead is known.
    """
    assert pytest.approx(0.0224, abs=1e-4) == structures.RMS
    assert structures.RMS * np.sqrt(1.0 - structures.MEMORY**2) == pytest.approx(
        np.exp(-9.5 / 2.0), rel=1e-12
    )


@pytest.mark.slow
def test_a_row_of_each_table_is_up_to_date():
    """All of them take six minutes.

    Where a search ends depends on the processor's kernels of linear algebra: SS fits 89.0 % on one
    machine and 89.5 on another.
    """
    case = structures.CASES[0]
    found = structures.medians(case)
    for part, table in enumerate(tables()):
        values, _ = table[str(case)]
        digits = 2 if part == 2 else 1
        rows = {name: round(float(found[name][part]), digits) for name in NAMES}
        assert values == pytest.approx(rows, rel=0.01)
