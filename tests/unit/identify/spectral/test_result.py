"""Claims: a result is text, table, file and figures, each with units, and says what it lacks."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.identify.spectral import FrequencyResponse, Response
from orchestration.records import Repair

FREQUENCY = np.geomspace(0.01, 10.0, 31)
REPAIR = Repair("order", "2 rows sorted")
VALUES = 6000.0 + 100j * FREQUENCY


@pytest.fixture
def result():
    every = np.ones(31)
    left_out = {"the record is too short": np.array([0.002, 0.004])}
    stiffness = Response(
        "force/displacement", "N/m", FREQUENCY, VALUES, 64 * every, 20 * every, VALUES, left_out
    )
    weak = Response("voltage/force", "V/N", FREQUENCY, 1e-3j * every, every, 20 * every, None, {})
    both = {one.name: one for one in (stiffness, weak)}
    return FrequencyResponse(
        "run.csv", "ppy_actuator", 600, 0.1, both, ("how it was made",), (REPAIR,)
    )


def test_its_text_has_a_table_of_each_response_and_what_is_left_out(result):
    text = str(result)
    assert text.startswith("run.csv against ppy_actuator: 600 samples of 0.1 s")
    assert "force/displacement [N/m]" in text
    assert re.search(r"\n10.0 mHz +6000 ± 12 ", text)  # 2.086 * sqrt(32)
    assert "loss tangent ± 95 %" in text
    assert "the model is within the 95 % region at 31 of 31 frequencies" in text
    assert "left out: 2 lines, 2.00 mHz … 4.00 mHz: the record is too short" in text
    assert "lost in noise at 31 of 31 frequencies" in text
    assert text.endswith("how it was made")
    assert repr(result) == (
        "<FrequencyResponse force/displacement, voltage/force: run.csv beside ppy_actuator>"
    )


def test_it_is_a_table_with_a_row_for_every_ratio_and_frequency(result):
    frame = result.to_frame()
    assert frame.shape[0] == 62
    row = frame.loc[("force/displacement", FREQUENCY[4])]
    assert row["storage"] == pytest.approx(6000.0)
    assert row["loss"] == pytest.approx(100 * FREQUENCY[4])
    assert row["storage_high"] - row["storage_low"] == pytest.approx(2 * 2.086 * 32**0.5, rel=1e-3)


def test_it_is_a_file_with_units(result, tmp_path):
    text = result.to_csv(tmp_path / "r.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    assert len(rows) == 62
    assert float(rows[3]["frequency [Hz]"]) == FREQUENCY[3]
    assert (rows[0]["response"], rows[0]["unit"]) == ("force/displacement", "N/m")
    assert float(rows[0]["phase [deg]"]) == pytest.approx(np.degrees(np.angle(VALUES[0])))
    assert rows[40]["storage"] == ""


def test_it_is_figures_for_json(result):
    figures = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    one = figures["responses"]["force/displacement"]
    assert one["frequency"] == FREQUENCY.tolist()
    assert one["left_out"] == {"the record is too short": [0.002, 0.004]}
    assert one["model_agrees"] == [True] * 31
    about = {"file": "run.csv", "samples": 600, "step": 0.1, "notes": ["2 rows sorted"]}
    assert figures["record"] == about


def test_a_name_that_is_wrong_is_told_the_right_one(result):
    assert result["voltage/force"].unit == "V/N"
    with pytest.raises(UserError, match="force/displacement"):
        result["force/displacment"]
