"""Claims: a system packed into one FMU computes what its members and the master compute, in any
host.

The oracles are solutions on paper, and the master's run of the members' own FMUs.
"""

from __future__ import annotations

from math import exp

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from orchestration import master
from orchestration.fmu import Fmu
from orchestration.fmu.check import check_fmu
from orchestration.system import library, ssp
from tests.support.hosts import run_fmpy, run_libcosim
from tests.support.pace import slow_but
from tests.support.packed import H, chain, circle

SYSTEMS = [name for name in library.NAMES if not name.startswith("hil_")]
TOLERANCE = 1e-12  # of the largest value


@pytest.fixture
def packed(tmp_path):
    """Path of the FMU that a system becomes."""

    def write(system):
        path = tmp_path / f"{system.name}.fmu"
        path.write_bytes(master.pack(system))
        return path

    return write


def same(found, wanted, tolerance=TOLERANCE):
    assert np.abs(found - wanted).max() <= tolerance * max(np.abs(wanted).max(), 1e-300)


def solution(u, tau=(0.4, 0.5), period=3):
    """The chain on paper: each section has the held voltage of the one before, the newest."""
    v1, v2, mean, high = (np.zeros(u.size) for _ in range(4))
    for k in range(u.size - 1):
        v1[k + 1] = u[k] + (v1[k] - u[k]) * exp(-H / tau[0])
        v2[k + 1] = v1[k + 1] + (v2[k] - v1[k + 1]) * exp(-H / tau[1])
        mean[k + 1], high[k + 1] = mean[k], high[k]
        if k % period == 0:  # sampled at the beginning of the step, with what the second has then
            received = 1000.0 * v2[k + 1] + 20.0
            mean[k + 1] = 0.5 * (mean[k] + received)
            high[k + 1] = mean[k + 1] > 400.0
    return {"v1": v1, "v2": v2, "mean": mean, "light": 60.0 * (1.0 - high)}


def staircase(count, seed=1):
    return np.repeat(np.random.default_rng(seed).uniform(0.0, 2.0, count // 5 + 1), 5)[:count]


@pytest.mark.slow
def test_a_chain_is_that_on_paper(packed):
    time = H * np.arange(31)
    u = staircase(time.size)
    found = run_fmpy(packed(chain()), time, {"u": u}, ["v1", "v2", "mean", "light"])
    wanted = solution(u)
    for name, values in found.items():
        same(values, wanted[name], 1e-10)  # of the integration of the sections
    assert 0 < np.count_nonzero(found["light"]) < time.size


@pytest.mark.slow
def test_a_longer_step_of_the_host_is_made_in_steps_of_the_system(packed):
    time = H * np.arange(31)
    u = np.repeat(staircase(7), 5)[:31]
    found = run_fmpy(packed(chain()), time[::5], {"u": u[::5]}, ["v2", "mean"])
    for name, values in found.items():
        same(values, solution(u)[name][::5], 1e-10)
    at_once = run_fmpy(
        packed(chain()), time[::5], {"u": u[::5]}, ["v2"], {"communication_step": 1.0}
    )
    assert np.abs(at_once["v2"] - found["v2"]).max() > 0.01


@pytest.mark.slow
def test_parameters_of_members_can_be_set_and_come_back_by_a_reset(packed):
    time = H * np.arange(11)
    path = packed(chain())
    found = run_fmpy(path, time, {"u": 1.0}, ["v2"], {"first.tau": 0.2, "second.tau": 1.5})
    same(found["v2"], solution(np.ones(11), (0.2, 1.5))["v2"], 1e-10)
    with pytest.raises(fmpy.fmi1.FMICallException):
        run_fmpy(path, time, {"u": 1.0}, ["v2"], {"first.tau": 0.0})
    with Fmu(path, {"first.tau": 0.2}, "one") as one:
        assert one.variables["first.tau"].start == "0.4"


@pytest.mark.slow
def test_a_tunable_parameter_of_a_member_acts_from_where_it_is_moved(packed):
    time = H * np.arange(11)
    tau = np.where(time < 0.45, 0.4, 0.1)
    found = run_fmpy(packed(chain()), time, {"u": 1.0, "first.tau": tau}, ["v1"])
    rest = np.append(1.0, np.exp(-np.cumsum(H / tau[:-1])))
    same(found["v1"], 1.0 - rest, 1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("gains", [(0.5, -0.8), (3.0, 2.0)])
def test_an_algebraic_loop_is_solved(packed, gains):
    time = H * np.arange(20)
    w = staircase(time.size)
    found = run_fmpy(packed(circle(*gains)), time, {"w": w}, ["a.y", "b.y"])
    a = (w + gains[0] * 0.25) / (1.0 - gains[0] * gains[1])
    same(found["a.y"], a)
    same(found["b.y"], gains[1] * a + 0.25)


def driven(system, count):
    """Inputs that jump every few steps, of the size that they have."""
    sizes = {"mass": 0.2, "zero": 0.0, "reference": 2e-5, "next_reference": 2e-5}
    return {
        name: sizes.get(name, 1.0) * 0.5 * staircase(count, seed)
        for seed, name in enumerate(system.inputs)
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(SYSTEMS, "dma_bench"))
def test_a_packed_system_equals_the_run_of_its_members(packed, name):
    system = library.system(name)
    time = system.step * np.arange(401)
    inputs = driven(system, time.size)
    path = packed(system)
    wanted = master.run(system, time, inputs).signals
    found = run_fmpy(path, time, inputs, list(system.outputs))
    for output, port in system.outputs.items():
        same(found[output], wanted[str(port)])


@pytest.mark.slow
def test_samples_count_from_the_start_time(packed):
    system = chain()
    time = 7.13 + H * np.arange(31)
    inputs = {"u": staircase(time.size)}
    found = run_fmpy(packed(system), time, inputs, ["mean", "light"])
    for name, wanted in solution(inputs["u"]).items():
        assert name not in found or np.abs(found[name] - wanted).max() < 1e-6


@pytest.mark.slow
def test_libcosim_runs_it(packed):
    system = library.system("dma_bench")
    time = system.step * np.arange(201)
    inputs = {"force_reference": np.full(time.size, 1.0), "current": np.full(time.size, 0.5)}
    outputs = ["position", "tension", "voltage"]
    found = run_libcosim(packed(system), time, inputs, outputs)
    wanted = master.run(system, time, inputs).signals
    for output in outputs:
        same(found[output][1:], wanted[str(system.outputs[output])][1:])


@pytest.mark.slow
def test_a_file_gives_the_same_fmu_as_the_system(packed, tmp_path):
    system = library.system("dma_bench")
    ssp.write(system, tmp_path / "bench.ssp")
    again = ssp.read(tmp_path / "bench.ssp", tmp_path / "unpacked")
    assert master.pack(again) == packed(system).read_bytes()


@pytest.mark.slow
def test_it_is_a_valid_fmu(packed):
    path = packed(chain())
    assert validate_fmu(str(path)) == []
    assert not [finding for finding in check_fmu(path) if finding.severity == "error"]
    description = fmpy.read_model_description(str(path))
    names = {v.name for v in description.modelVariables if v.causality == "parameter"}
    assert names == {
        "communication_step",
        *("first.tau", "first.v_start", "second.tau", "second.v_start"),
        *("mean.period", "mean.x_start", "mean.high_start"),
    }
    known = {u.variable.name: [v.name for v in u.dependencies] for u in description.outputs}
    assert known == {"v1": [], "v2": [], "mean": [], "light": []}


@pytest.mark.slow
def test_what_fails_in_a_member_is_told_with_its_name(packed, capfd):
    with pytest.raises(fmpy.fmi1.FMICallException):
        run_fmpy(packed(chain()), H * np.arange(3), {"u": 1e308}, ["v2"])
    assert "first: " in capfd.readouterr().out
