"""Claims: JSON has the numbers of a correction, in plain types."""

from __future__ import annotations

import json

import numpy as np
import pytest

from orchestration.discrepancy.report.laws import summary
from tests.support.law_reports import ENDS, motor_report


@pytest.fixture
def row(monkeypatch):
    monkeypatch.setattr(summary, "shape_estimates", lambda correction: {})
    law_report, _ = motor_report("saturating")
    (row,) = summary.law_map(law_report)
    return row


def test_a_correction_is_written_with_its_curve_and_units(row):
    assert json.loads(json.dumps(row, allow_nan=False)) == row
    assert (row["effect"], row["law"], row["signal"]) == ("friction(omega)", "friction", "omega")
    assert (row["kind"], row["shape"], row["delta_bic"]) == ("add", "saturating", 12.0)
    assert row["units"] == {"law": "N*m", "signal": "rad/s"}
    assert row["curve"]["x"] == pytest.approx(np.linspace(*ENDS, 7))
    assert row["curve"]["y"] == pytest.approx(0.01 * np.linspace(*ENDS, 7))
    assert np.subtract(row["curve"]["high"], row["curve"]["low"]) == pytest.approx(0.2)


def test_what_was_not_held_against_unseen_data_is_null_and_others_are_named(row):
    assert row["confirmed"] is None
    assert row["alike"] == ["drop over current"]
    assert row["beside"] == []
