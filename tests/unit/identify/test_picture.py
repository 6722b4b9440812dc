"""Claims: every output of a comparison is drawn with units, every parameter with its interval."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from fmus.kit import UserError
from orchestration.experiment.waveforms import multilevel
from orchestration.fmu.model import built, declared_model_of, find_model
from orchestration.identify import comparison as comparing
from orchestration.records import Record, read_record
from tests.support.kit_samples import Thermostat

UNITS = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
TIME: np.ndarray = 0.1 * np.arange(600)
INPUTS = {
    "current": multilevel(TIME, [-0.9, 0.0, 0.9], (2.0, 8.0), 1),
    "force": multilevel(TIME, [0.5, 1.0, 2.75], (5.0, 12.0), 2),
}


@pytest.fixture(scope="module")
def model():
    return find_model("ppy_actuator")


@pytest.fixture
def record():
    measured = EmulatedRig(RigParameters(R1=0.6, C=2.0), seed=1).run(TIME, **INPUTS)
    return Record(TIME, INPUTS | measured, UNITS, Path("record.csv"))


def test_a_comparison_is_drawn_and_written_if_wanted(model, record, tmp_path):
    plain = comparing.compare(model, record)
    assert [axis.get_ylabel() for axis in plain.plot().axes] == [
        "voltage\n[V]",
        "residual\n[V]",
        "displacement\n[mm]",
        "residual\n[mm]",
    ]
    fitted = comparing.compare(model, record, {}, ["R1", "C"])
    axes = fitted.plot(tmp_path / "c.png").axes
    assert (tmp_path / "c.png").stat().st_size > 10_000
    assert len(axes[0].lines) == 3
    with pytest.raises(UserError, match="must end in"):
        plain.plot(tmp_path / "c.txt")


@pytest.mark.parametrize(
    ("head", "first", "shown"),
    [("K", 290.0, "K"), ("°C", 16.85, "°C"), ("℃", 16.85, "°C"), ("degF", 62.33, "°F")],
)
def test_a_temperature_is_drawn_in_the_unit_of_the_record(head, first, shown, tmp_path):
    """Though the model displays it in degrees Celsius; its error is in K."""
    path = tmp_path / "room.csv"
    rows = "".join(f"{0.5 * k},{first}\n" for k in range(20))
    path.write_text(f"time [s],temperature [{head}]\n{rows}", encoding="utf-8")
    thermostat = built(declared_model_of(Thermostat))
    record = read_record(path, {"temperature": "K"})
    drawn = comparing.compare(thermostat, record).plot().axes
    assert [axis.get_ylabel() for axis in drawn] == [f"temperature\n[{shown}]", "residual\n[K]"]
    assert drawn[0].lines[0].get_ydata() == pytest.approx(first)
    (table,) = [part for part in record.overview() if hasattr(part, "columns")]
    assert [next(iter(column.cells)) for column in table.columns[1:3]] == [head, f"{first:g}"]


def test_a_fit_is_drawn_with_its_intervals(model, record):
    """An interval that is open ends at the edge of the picture."""
    record.signals["force"] = np.zeros(TIME.size)
    fit = comparing.compare(model, record, {}, ["R1", "k1"]).fit
    first, second = fit.plot().axes
    started, fitted, interval = first.lines
    assert started.get_xdata() == [0.43]
    assert fitted.get_xdata() == [fit.values["R1"]]
    assert tuple(interval.get_xdata()) == pytest.approx(fit.intervals["R1"])
    assert [axis.get_xlabel() for axis in (first, second)] == ["[Ω]", "[N/m]"]
    assert np.isfinite(second.lines[2].get_xdata()).all()
