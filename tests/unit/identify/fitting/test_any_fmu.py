"""Claims: an FMU without equations is fitted like one with them.

It is so whatever its solver's noise, by one process or two.

Oracles: closed forms, and the exact sensitivities of our own equations.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
from fmus.kit.record.compiled import CompiledModel
from fmus.ppy_actuator.model import PpyActuator
from orchestration.fmu.isolation.limits import Limits, isolating
from orchestration.identify.fitting.any_fmu import FmuWithDifferences
from orchestration.identify.fitting.simulation_input import SimulationInput
from tests.support import misbehaving
from tests.support.hosts import build_one_state_fmu, build_pythonfmu
from tests.support.processes import of_fmus

TIME = 0.1 * np.arange(101)
# substeps of Euler's method, as many as the time constant asks for: results jump where their number
# does
NOISY = """
from math import ceil
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Noisy(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.x, self.tau = 0.0, 0.0, 1.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(
            Real("tau", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
        )

    def do_step(self, current_time, step_size):
        if self.tau <= 0.0:
            raise ValueError("tau must be positive")
        substeps = ceil(step_size / (0.001 * self.tau))
        for _ in range(substeps):
            self.x += step_size / substeps * (self.u - self.x) / self.tau
        return True
"""


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    return ppy.find_model(str(build_one_state_fmu(tmp_path_factory.mktemp("lag"))))


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    return ppy.find_model(str(build_pythonfmu(tmp_path_factory.mktemp("noisy"), "noisy", NOISY)))


def rise(tau):
    return 1.0 - np.exp(-TIME / tau)


def slope(tau):
    return -TIME / tau**2 * np.exp(-TIME / tau)


def test_without_derivatives_a_simulation_is_one_run(lag):
    given = SimulationInput(TIME, {"u": np.ones(101)}, {"tau": 1.7})
    fmu = FmuWithDifferences(lag, ["tau"], ["x"])
    with fmu.opened(derivatives=False):
        ran = fmu.run(given)
    assert fmu.runs == 1
    assert ran.signals["x"] == pytest.approx(rise(1.7), abs=1e-6)
    assert not ran.sensitivities["x"].any()
    with fmu.opened():
        assert fmu.run(given).sensitivities["x"].any()


@pytest.mark.parametrize("tau", [0.02, 1.7, 300.0])
def test_the_derivative_of_a_lag_is_its_closed_form(lag, tau):
    with FmuWithDifferences(lag, ["tau"], ["x"]) as fmu:
        found = fmu.run(SimulationInput(TIME, {"u": np.ones(101)}, {"tau": tau}))
    assert found.signals["x"] == pytest.approx(rise(tau), abs=1e-12)
    exact = slope(tau)
    assert found.sensitivities["x"][:, 0] == pytest.approx(exact, abs=1e-5 * np.abs(exact).max())


@pytest.mark.parametrize("tau", [0.73, 1.0, 2.0])
def test_the_step_is_larger_where_a_solver_makes_noise(noisy, tau):
    """Choose a step above the solver's noise.

    About 1 and 2 s the number of substeps jumps: a step of 1e-6, as for the lag, makes 2 and 5
    times as much.
    """
    with FmuWithDifferences(noisy, ["tau"], ["x"]) as fmu:
        found = fmu.run(SimulationInput(TIME, {"u": np.ones(101)}, {"tau": tau}))
    exact = slope(tau)
    assert found.sensitivities["x"][:, 0] == pytest.approx(exact, abs=0.02 * np.abs(exact).max())


def test_derivatives_of_our_own_fmu_are_those_of_its_equations(fmu):
    names = ["R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2"]
    time = 0.05 * np.arange(400)
    inputs = {"current": 0.5 * np.sign(np.sin(time)), "force": 1.0 + 0.5 * np.sin(0.3 * time)}
    model = replace(ppy.find_model(str(fmu("ppy_actuator", "native"))), cls=None)
    at = {name: model.parameters[name].start for name in names}
    exact = CompiledModel(PpyActuator, names).run(time, inputs, at)
    with FmuWithDifferences(model, names, ["voltage", "displacement"]) as ours:
        found = ours.run(SimulationInput(time, inputs, at))
    for output in ("voltage", "displacement"):
        for k, name in enumerate(names):
            column = exact.sensitivities[output][:, k]
            close = (
                1e-5 * np.abs(column).max() + 1e-12 * np.abs(exact.signals[output]).max() / at[name]
            )
            assert found.sensitivities[output][:, k] == pytest.approx(column, abs=close), (
                output,
                name,
            )


def record_of(tau, folder, seed=1):
    noise = np.random.default_rng(seed).normal(0.0, 0.01, 101)
    path = folder / "record.csv"
    table = np.column_stack([TIME, np.ones(101), rise(tau) + noise])
    np.savetxt(path, table, delimiter=",", header="time,u,x", comments="")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_a_fit_finds_what_made_the_record(lag, tmp_path, workers):
    found = ppy.fit(record_of(0.73, tmp_path), lag, ["tau"], workers=workers)
    low, high = found.intervals["tau"]
    assert low < 0.73 < high
    # white noise of 0.01 through the closed form of the slope
    assert (high - low) / (2.0 * 1.96) == pytest.approx(0.01 / np.linalg.norm(slope(0.73)), rel=0.2)


@pytest.mark.slow
def test_however_many_processes_the_values_are_the_same(lag, tmp_path):
    path = record_of(0.73, tmp_path)
    one, two = (ppy.fit(path, lag, ["tau"], workers=workers) for workers in (1, 2))
    assert one.values == two.values


@pytest.mark.slow
def test_nothing_that_was_unpacked_stays(lag, tmp_path, monkeypatch):
    (tmp_path / "t").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "t"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "t"))  # for the processes
    ppy.fit(record_of(0.73, tmp_path), lag, ["tau"], workers=2)
    assert list((tmp_path / "t").iterdir()) == []


def test_an_fmu_with_a_noisy_solver_is_fitted(noisy, tmp_path):
    found = ppy.fit(record_of(0.73, tmp_path), noisy, ["tau"])
    low, high = found.intervals["tau"]
    assert low < 0.73 < high


def test_without_equations_the_fit_is_that_with_them(tmp_path):
    from demonstrations.records import draw, write

    write(draw(None, seed=3, duration=60.0), tmp_path / "record.csv")
    with_them = ppy.find_model("ppy_actuator")
    names = ["R1", "R2", "C", "k1"]
    fits = [
        ppy.fit(tmp_path / "record.csv", m, names)
        for m in (with_them, replace(with_them, cls=None))
    ]
    for name in names:
        low, high = fits[0].intervals[name]
        assert fits[1].values[name] == pytest.approx(fits[0].values[name], abs=0.01 * (high - low))
        assert fits[1].intervals[name] == pytest.approx(fits[0].intervals[name], rel=0.02)


def test_a_comparison_of_any_fmu_recalibrates_it(lag, tmp_path):
    compared = ppy.compare(record_of(0.73, tmp_path), lag, fit=["tau"])
    assert compared.after["x"].fit_percent > 90.0 > compared.before["x"].fit_percent
    assert compared.fit.evaluations > 10


def test_what_the_fmu_refuses_on_one_side_is_looked_at_from_the_other(noisy):
    """The FMU fails at a smaller value, though it declares no range."""
    with FmuWithDifferences(noisy, ["tau"], ["x"]) as fmu:
        point = SimulationInput(TIME, {"u": np.ones(101)}, {"tau": 1.0})
        found = fmu._slopes(point, rise(1.0)[:, np.newaxis], [("tau", 1.5)])
    assert found[0][:, 0] == pytest.approx((rise(2.5) - rise(1.0)) / 1.5, abs=2e-3)


def test_where_it_fails_itself_is_told_in_a_line(noisy):
    with (
        FmuWithDifferences(noisy, ["tau"], ["x"]) as fmu,
        pytest.raises(UserError, match=r"Noisy\.fmu: ") as refused,
    ):
        fmu.run(SimulationInput(TIME, {"u": np.ones(101)}, {"tau": -1.0}))
    assert "\n" not in str(refused.value)


@pytest.mark.slow
def test_a_process_that_ends_is_told_in_a_line(lag):
    with FmuWithDifferences(lag, ["tau"], ["x"], workers=2) as fmu:
        fmu.run(SimulationInput(TIME, {"u": np.ones(101)}, {"tau": 1.0}))
        for process in of_fmus():
            process.kill()
        with pytest.raises(UserError, match=r"one_state\.fmu: its process was ended by SIGKILL"):
            fmu.run(SimulationInput(TIME, {"u": np.ones(101)}, {"tau": 5.0}))


def test_in_a_process_of_its_own_a_fit_is_the_same(lag):
    with FmuWithDifferences(lag, ["tau"], ["x"]) as fmu:
        here = fmu.run(SimulationInput(TIME, {"u": np.ones(101)}, {"tau": 1.5}))
    with isolating(Limits()), FmuWithDifferences(lag, ["tau"], ["x"]) as fmu:
        there = fmu.run(SimulationInput(TIME, {"u": np.ones(101)}, {"tau": 1.5}))
    assert there.signals["x"].tobytes() == here.signals["x"].tobytes()
    assert there.sensitivities["x"].tobytes() == here.sensitivities["x"].tobytes()


def test_an_fmu_that_ends_its_process_in_a_fit_is_told_in_a_line(tmp_path):
    bad = ppy.find_model(str(misbehaving.build("exits", tmp_path)))
    with (
        isolating(Limits()),
        FmuWithDifferences(bad, ["tau"], ["x"]) as fmu,
        pytest.raises(UserError) as refused,
    ):
        fmu.run(SimulationInput(TIME, {"u": np.ones(101)}, {"tau": 1.5}))
    assert str(refused.value) == "exits.fmu: step from 1 s: its process ended (exit status 0)"
