"""Claims: of a cell with two RC pairs and hysteresis, and a model with one pair, ``ppy diagnose``
names the second pair first, and the same beside busy processes.

Oracles: the cell that made the record (`tests.support.cell_record`), and a fit of a circuit with
two pairs by scipy, written out here, which knows what to look for.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.signal import lfilter

from tests.support.cell_record import (
    DATED,
    IN_SECONDS,
    Cell,
    open_circuit_voltage,
    record,
    write_german,
)
from tests.support.command import ppy
from tests.support.processes import busy

EXAMPLE = Path(__file__).parents[2] / "examples" / "battery_cell.py"
FITTED = 2400  # samples, of which the last third is held out
PAIR = "rc_pair"  # of the voltage lost over the current, as its parameters say


def diagnosed(folder, seed, clock=IN_SECONDS):
    """What the default command writes down of a drawn record."""
    shutil.copy(EXAMPLE, folder / "cell.py")
    current, voltage, _ = record(seed)
    write_german(folder / "record.csv", current, voltage, clock)
    columns = ("--map", "Strom=current", "--map", "Spannung=voltage")
    model = ("--model", "cell.py:BatteryCell")
    done = ppy("diagnose", "record.csv", *model, *columns, "--json", "cell.json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "cell.json").read_text(encoding="utf-8"))


def lagged(current, constant):
    """A current behind a lag, both held for a second."""
    kept = np.exp(-1.0 / constant)
    return lfilter([0.0, 1.0 - kept], [1.0, -kept], current)


def two_pairs(seed):
    """Resistances and time constants of two pairs, the faster first, by least squares in scipy."""
    current, voltage, _ = record(seed)
    charges = np.linspace(0.0, 1.0, 21)
    rest = CubicSpline(charges, open_circuit_voltage(charges))
    passed = np.concatenate([[0.0], np.cumsum(current[:-1])]) / 3600.0

    def error(q):
        start, capacity, series, *pairs = q
        drop = series * current
        for resistance, constant in zip(pairs[::2], pairs[1::2], strict=True):
            drop = drop + resistance * lagged(current, np.exp(constant))
        return (rest(start - passed / capacity) - drop - voltage)[:FITTED]

    starts = [[0.9, 2.5, 0.03, 0.015, np.log(10.0), 0.015, np.log(t)] for t in (80.0, 400.0)]
    size = [0.1, 1.0, 0.01, 0.01, 1.0, 0.01, 1.0]
    fits = [least_squares(error, start, x_scale=size) for start in starts]
    best = min(fits, key=lambda fit: fit.cost).x
    return sorted([(best[3], np.exp(best[4])), (best[5], np.exp(best[6]))], key=lambda p: p[1])


def pairs_of(figures):
    """The pairs of the extended model, the faster first."""
    value = {name: p["value"] for name, p in figures["parameters"].items()}
    own = value["voltage_drop_of_current_rc_pair"]
    constant = value["voltage_drop_of_current_rc_pair_constant"]
    return sorted([(value["R1"], value["R1"] * value["C1"]), (own, constant)], key=lambda p: p[1])


@pytest.mark.parametrize("profile", ["pulses", "drive", "steps"])
def test_a_record_obeys_the_equations_of_the_cell(profile):
    """Without hysteresis the drop is that of lags by scipy; with it, it is so much more."""
    current, _, cell = record({"pulses": 0, "drive": 1, "steps": 2}[profile])
    bare = Cell(cell.capacity, cell.series, cell.pairs, 0.0, cell.decay, cell.charge)
    passed = np.concatenate([[0.0], np.cumsum(current[:-1])]) / 3600.0
    drop = cell.series * current + sum(r * lagged(current, t) for r, t in cell.pairs)
    expected = open_circuit_voltage(cell.charge - passed / cell.capacity) - drop
    np.testing.assert_allclose(bare.voltage(current), expected, atol=1e-9)
    loop = bare.voltage(current) - cell.voltage(current)
    assert 0.5 * cell.hysteresis < np.abs(loop).max() <= cell.hysteresis


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("seed", [4001, 4002, 4003])
def test_the_second_pair_is_named_first(tmp_path, seed):
    """One of each profile; resistances and time constants as scipy has them, who knows the form."""
    figures = diagnosed(tmp_path, seed)
    assert figures["causes"][0]["effect"] == PAIR
    assert figures["verdict"] == "cause"
    assert not any(note["code"] == "time_spent" for note in figures["notes"])
    if len(figures["causes"]) == 1:  # beside others the pairs do not stand for the hysteresis
        np.testing.assert_allclose(pairs_of(figures), two_pairs(seed), rtol=0.5)


@pytest.mark.slow
@pytest.mark.timeout(2400)
def test_it_is_the_same_beside_busy_processes(tmp_path):
    alone, beside = tmp_path / "alone", tmp_path / "beside"
    alone.mkdir()
    beside.mkdir()
    before = diagnosed(alone, 4001)
    with busy(8, 1200.0):
        after = diagnosed(beside, 4001)
    for name in ("verdict", "causes", "alternatives", "parameters", "errors"):
        assert after[name] == before[name]


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_german_dates_are_the_same_record(tmp_path):
    dated, seconds = tmp_path / "dated", tmp_path / "seconds"
    dated.mkdir()
    seconds.mkdir()
    figures = diagnosed(dated, 4001, DATED)
    assert figures["causes"] == diagnosed(seconds, 4001)["causes"]
