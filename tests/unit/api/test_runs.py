"""Claims: an experiment is run with settings over it, a system over time; what fails on its
way leaves what was computed.
"""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.experiment import UnfinishedExperiment
from orchestration.system import Member, Port, System
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_pythonfmu


@pytest.fixture
def system(lag):
    first = Member("first", ppy.find_model(lag).path, {"tau": 2.0})
    return System("lags", (first,), (), {"u": (Port("first", "u"),)})


def test_an_experiment_is_run_with_settings_over_its_file(tmp_path, lag):
    (tmp_path / "lag.toml").write_text(
        f'component = "{lag}"\nduration = 5\nstep = 0.1\n[inputs]\nu = 1\n'
    )
    found = ppy.run(tmp_path / "lag.toml", settings={"tau": 2, "inputs.u": 3, "duration": "2 s"})
    exact = 3.0 * (1.0 - np.exp(-found.time.values / 2.0))
    assert found.x.values == pytest.approx(exact, abs=1e-12)
    assert found.time.values[-1] == 2.0


def test_a_system_is_run_over_time(system):
    time = np.linspace(0.0, 1.0, 11)
    found = ppy.run(system, time.tolist(), {"u": [3] * 11})
    assert found.signals["first.x"] == pytest.approx(3.0 * (1.0 - np.exp(-time / 2.0)), abs=1e-12)
    with pytest.raises(UserError, match=r"lags: time is needed to run a system, such as numpy"):
        ppy.run(system)


def test_what_a_system_has_no_use_for_is_refused_and_what_an_experiment_has_none_for(system):
    time = np.arange(0.0, 1.0, 0.1)
    for name, value in (("settings", {"u": 1.0}), ("folder", "part")):
        with pytest.raises(UserError, match=f"^{name}: a system has no use for it$"):
            ppy.run(system, time, **{name: value})
    for name, value in (("time", time), ("inputs", {"current": time}), ("tolerance", 1e-6)):
        with pytest.raises(UserError, match=f"^{name}: an experiment has no use for it$"):
            ppy.run("fig_3_4", **{name: value})


def test_an_fmu_that_fails_on_its_way_leaves_what_was_computed(tmp_path):
    step = "    def do_step(self, current_time, step_size):\n"
    source = MINIMAL_PYTHONFMU_SOURCE.replace(
        step, step + "        if current_time >= 0.45:\n            return False\n"
    )
    fmu = build_pythonfmu(tmp_path, "half_way", source.replace("Minimal", "HalfWay"))
    (tmp_path / "half.toml").write_text(f'component = "{fmu}"\nduration = 1\nstep = 0.1\n')
    with pytest.raises(UnfinishedExperiment, match=r"step from 0\.5 s to 0\.6 s failed") as stopped:
        ppy.run(tmp_path / "half.toml")
    assert stopped.value.result.time.values == pytest.approx(0.1 * np.arange(6))
