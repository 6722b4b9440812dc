"""Claims: of a cell with two RC pairs and hysteresis, and a model with one pair and no effects of
its own, ``ppy diagnose`` names a second pair first, and the same beside busy processes.

The oracle is the cell that made the record (`tests.support.cell_record`).
"""

import json
from pathlib import Path

import numpy as np
import pytest
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

FAMILY = Path(__file__).parents[2] / "examples" / "lithium_cell.py"
# a lag of what drives the first pair, or of its voltage, beside it or ahead of it
SECOND_PAIRS = {
    f"{law}({signal})"
    for law in ("voltage_drop", "pair_rate")
    for signal in ("current", "pair_voltage")
}


def diagnosed(folder, seed, clock=IN_SECONDS):
    """Return the JSON that the default command writes of a drawn record."""
    family = FAMILY.read_text(encoding="utf-8")
    (folder / "cell.py").write_text(f"{family}\nEFFECTS.clear()\n", encoding="utf-8")
    current, voltage, _ = record(seed)
    write_german(folder / "record.csv", current, voltage, clock)
    columns = ("--map", "Strom=current", "--map", "Spannung=voltage")
    model = ("--model", "cell.py:LithiumCell")
    done = ppy("diagnose", "record.csv", *model, *columns, "--json", "cell.json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "cell.json").read_text(encoding="utf-8"))


def lagged(current, constant):
    """A current behind a lag, both held for a second."""
    kept = np.exp(-1.0 / constant)
    return lfilter([0.0, 1.0 - kept], [1.0, -kept], current)


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
def test_the_second_pair_comes_first(tmp_path, seed):
    """One of each profile."""
    first = diagnosed(tmp_path, seed)["group"][0]
    assert {first["effect"], *first["aliases"]} & SECOND_PAIRS


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_drive_cycle_tells_both_time_constants_beside_the_hysteresis(tmp_path):
    """With those of the cell that made the record.

    A lag of what the first pair holds back, fed back to it, is a second pair in other parameters:
    its time constants are those of the poles.
    """
    figures = diagnosed(tmp_path, 4002)
    assert figures["verdict"] == "cause"
    (first,) = figures["causes"]
    assert [part["memory"] for part in first["with"]] == ["dahl"]
    value = {name: p["value"] for name, p in figures["parameters"].items()}
    (own,) = (value[name] for name in first["parameters"] if name.endswith("_time"))
    (gain,) = (value[name] for name in first["parameters"] if not name.endswith("_time"))
    fed_back = gain if first["signal"] == "pair_voltage" else 0.0
    rates = [[-1.0 / (value["R1"] * value["C1"]), fed_back], [1.0 / own, -1.0 / own]]
    constants = np.sort(-1.0 / np.linalg.eigvals(rates).real)
    true = sorted(constant for _, constant in record(4002)[2].pairs)
    np.testing.assert_allclose(constants, true, rtol=0.15)


@pytest.mark.slow
@pytest.mark.timeout(2400)
def test_it_is_the_same_beside_busy_processes(tmp_path):
    alone, beside = tmp_path / "alone", tmp_path / "beside"
    alone.mkdir()
    beside.mkdir()
    before = diagnosed(alone, 4001)
    with busy(8, 1200.0):
        after = diagnosed(beside, 4001)
    for name in ("verdict", "group", "parameters", "gain"):
        assert after[name] == before[name]


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_german_dates_are_the_same_record(tmp_path):
    dated, seconds = tmp_path / "dated", tmp_path / "seconds"
    dated.mkdir()
    seconds.mkdir()
    figures = diagnosed(dated, 4001, DATED)
    assert figures["group"] == diagnosed(seconds, 4001)["group"]
