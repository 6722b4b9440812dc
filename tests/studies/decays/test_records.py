"""Claims: decays are drawn once, with noise of a logger, and follow closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from studies.decays import DecayCase, cases, draw, write


@pytest.mark.parametrize(("kind", "constant"), [("capacitor", 20.0), ("cooling", 1800.0)])
def test_a_clean_first_order_decay_is_an_exponential(kind, constant):
    """Oracle: the time constant of a specimen, on paper."""
    record = draw(DecayCase(kind, False, 1, 5))
    p = record.truth
    own = p["capacitance"] * p["resistance"] if kind == "capacitor" else 900.0 / p["conductance"]
    assert own == pytest.approx(constant, rel=0.25)
    time, shown = record.runs[0]
    end = p.get("room", 0.0)
    form = np.exp(-time / own)
    start = (form @ (shown - end)) / (form @ form)
    assert np.std(shown - end - start * form) < 0.012 * np.std(shown)


def test_a_record_is_drawn_once_and_written_run_by_run(tmp_path):
    drawn = cases(3, 8)
    assert drawn == cases(3, 8) != cases(3, 9)
    assert {case.runs for case in drawn} == {1, 2}
    case = next(case for case in drawn if case.runs == 2 and case.hidden)
    first, second = (draw(case) for _ in range(2))
    assert all(np.array_equal(a[1], b[1]) for a, b in zip(first.runs, second.runs, strict=True))
    paths = write(first, tmp_path)
    table = np.genfromtxt(paths[1], delimiter=",", skip_header=1)
    assert table[:, 1] == pytest.approx(first.runs[1][1], rel=1e-8)
