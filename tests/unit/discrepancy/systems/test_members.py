"""Which member of a system has another parameter, and which: galvanostat, estimator and foot in their systems."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.systems.diagnose import diagnose_system
from orchestration.experiment.waveforms import multilevel
from orchestration.system import library as shipped
from orchestration.system import ssp
from tests.support.system.closed_loop import measure, watched

FEET = ("an", "po", "do", "pl")


def changes(diagnosis):
    """Parameters that are said to differ, by member; and nobody else is blamed."""
    assert {
        m.name for m in diagnosis.members if m.verdict not in ("consistent", "recalibrate")
    } == set()
    return {
        m.name: {n: p.value for n, p in m.parameters.items() if p.differs}
        for m in diagnosis.members
        if m.verdict == "recalibrate"
    }


def test_the_limit_of_the_galvanostat(tmp_path):
    diagnosis = watched(
        tmp_path,
        settings={"galvanostat.current_limit": 0.55},
        values={"galvanostat.current_limit": 0.45},
    )
    assert changes(diagnosis) == {"galvanostat": {"current_limit": pytest.approx(0.45, rel=0.002)}}


def test_the_voltage_limit_of_the_estimator(tmp_path):
    diagnosis = watched(tmp_path, values={"estimator.initial_voltage_limit": 1.1})
    assert changes(diagnosis) == {
        "estimator": {"initial_voltage_limit": pytest.approx(1.1, rel=0.002)}
    }


@pytest.mark.slow
def test_the_damping_of_the_foot(tmp_path):
    """Two seconds at 200 Hz of a foot that is pulled by its four actuators and pushed at the toe."""
    system, every = shipped.system("foot_gait"), 50
    grid = 5e-3 * np.arange(400)
    levels = {f"{a}_current": [-1.0, -0.3, 0.3, 1.0] for a in FEET}
    levels |= {f"toe_force_{axis}": [-1.0, 0.0, 1.0] for axis in "xy"}
    inputs = {
        n: np.repeat(multilevel(grid, v, (0.1, 0.4), k), every)
        for k, (n, v) in enumerate(levels.items())
    }
    columns = {name: "A" if name.endswith("current") else "N" for name in inputs}
    columns |= {f"{a}.tension": "N" for a in FEET} | {f"foot.{a}_length_change": "m" for a in FEET}
    columns |= {f"foot.{joint}_angle": "rad" for joint in ("ankle", "tm", "mtp")}
    time = 1e-4 * np.arange(grid.size * every)
    measure(
        tmp_path / "record.csv",
        system,
        columns,
        time,
        inputs,
        every,
        values={"foot.ankle_damping": 0.03},
    )
    ssp.write(system, tmp_path / "system.ssp")
    found = changes(diagnose_system(tmp_path / "record.csv", tmp_path / "system.ssp"))
    assert list(found) == ["foot"]
    assert found["foot"]["ankle_damping"] == pytest.approx(0.03, rel=0.06)  # instead of 0.02
