"""Claims: ``ppy frequency`` prints, draws and writes responses of a record, a model's beside."""

import csv
import json

import numpy as np
import pytest

from orchestration.records import write_record
from tests.support import frequency as made
from tests.support.command import PNG, refused, works


@pytest.fixture
def square(tmp_path):
    current = made.square(600)
    voltage = made.noisy(np.random.default_rng(1), made.voltage(current), 1e-3)
    signals = {"current": current, "voltage": voltage}
    time = made.STEP * np.arange(600)
    write_record(tmp_path / "square.csv", time, signals, {"current": "A", "voltage": "V"})
    return tmp_path


def test_an_impedance_is_printed_drawn_and_written(square):
    printed = works(
        *("frequency", "square.csv", "--of", "voltage/current", "--band", "50mHz..2Hz"),
        *("--plot", "z.png", "--out", "z.csv"),
        cwd=square,
    )
    assert "voltage/current [Ω]" in printed
    assert "current repeats every 10 s, 6 times" in printed
    assert (square / "z.png").read_bytes().startswith(PNG)
    rows = list(csv.DictReader((square / "z.csv").read_text(encoding="utf-8").splitlines()))
    assert [float(row["frequency [Hz]"]) for row in rows[:2]] == pytest.approx([0.1, 0.3])
    assert float(rows[0]["magnitude"]) == pytest.approx(abs(made.held_impedance(0.1)), rel=0.01)


def test_a_model_stands_beside_it(square):
    figures = json.loads(
        works(
            *("frequency", "square.csv", "--model", "ppy_actuator", "--set", "R1=430mohm"),
            *("--period", "20s", "--json", "-"),
            cwd=square,
        )
    )
    one = figures["responses"]["voltage/current"]
    assert one["model_magnitude"][:3] == pytest.approx(one["magnitude"][:3], rel=0.01)
    assert np.mean(one["model_agrees"]) > 0.8


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "--of: name ratios of columns, such as voltage/current, or a model with --model"),
        (("--of", "voltage/current", "--with", "diffusion"), "--with: there is no model"),
        (("--of", "voltage/current", "--period", "7.77777s"), "--period 7.77777s: no multiple"),
        (("--of", "voltage/current", "--band", "2..1"), "--band '2..1': the first frequency"),
        (("--of", "voltage/current", "--out", "z.txt"), "its name must end in .csv"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(square, arguments, said):
    refused(square, "frequency", "square.csv", *arguments, parts=[said])
