"""The system of a plant and its controller: the loop that runs, and its files."""

import numpy as np
import pytest

import ppy_rig as ppy

SIGNALS = {"command": "current", "measured": "displacement"}
AT = {"sample_period": "20ms", "crossover": "0.5Hz"}
HELD = {"trim": True, "fix": {"displacement": "0.05mm"}, "free": ["current"]}


def test_the_loop_that_runs_is_the_loop_of_the_design():
    """From the equilibrium on, within the limits, with the FMUs of both."""
    found = ppy.design("ppy_actuator", **SIGNALS, **AT, **HELD, limits="-0.2A..0.3A")
    size = 2.0 * found.step_size
    step = found.step(size)
    inputs = {"reference": np.full(found.time.size, 5e-5 + size)}
    run = ppy.run(found.system, found.time, inputs)
    np.testing.assert_allclose(run.signals["plant.displacement"], step.measured, rtol=1e-9)
    assert step.measured[0] == pytest.approx(5e-5, rel=1e-9)
    assert step.command.min() == -0.2, "the limit acts"
    assert step.command.max() <= 0.3


def test_the_loop_that_is_cut_has_the_margins_of_the_design():
    """By the Jacobians of the joined laws, of which the design knows nothing."""
    found = ppy.design("ppy_actuator", **SIGNALS, **AT)
    cut = ppy.linearise(found.system, cut="plant.displacement").margins()
    np.testing.assert_allclose(cut, found.margins(), rtol=1e-9)


def test_a_system_that_is_sampled_gives_its_period_and_its_step():
    pulled = {"settings": {"force_reference": 1.0}, "at": ["1s"]}
    asked = {"phase_margin": 80.0, "controller": "pi", "limits": (0.0, 3.0)}
    found = ppy.design(
        "dma_bench", command="force_reference", measured="actuator.tension", **pulled, **asked
    )
    assert found.plant.period == pytest.approx(1.0 / 30.0)
    assert found.margins().phase == pytest.approx(80.0, abs=0.1)
    assert found.system.step == pytest.approx(1e-4, rel=0.01)
    time = found.system.step * np.arange(334 * 60)
    wanted = np.full(time.size, 1.0 + found.step_size)
    run = ppy.run(found.system, time, {"reference": wanted})
    tension = run.signals["actuator.tension"]
    assert tension[0] == pytest.approx(1.0, rel=1e-3)
    assert tension[-1] == pytest.approx(wanted[-1], rel=1e-3)


def test_the_files_are_component_fmu_system_and_experiment(tmp_path):
    found = ppy.design("ppy_actuator", **SIGNALS, **AT, limits=(-1.3, 1.3))
    written = [path.name for path in found.write(tmp_path / "loop")]
    assert written == ["controller.py", "controller.fmu", "loop.ssp", "step.toml"]
    run = ppy.run(tmp_path / "loop" / "step.toml")
    expected = found.step(found.step_size).measured
    measured = np.asarray(run["plant.displacement"])
    np.testing.assert_allclose(measured, expected[: measured.size], rtol=0, atol=1e-14)
    own = ppy.simulate(f"{tmp_path}/loop/controller.py:Controller", {"reference": 1e-6}, stop=0.1)
    assert own["command"][-1] > 0.0
