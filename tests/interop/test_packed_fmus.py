"""Claims: a packed system with FMUs of somebody else computes what its master does.

The oracles are solutions on paper, and the master's run of the same files.
"""

from __future__ import annotations

import re
from dataclasses import replace
from math import exp

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from fmus import component
from fmus.kit import UserError
from fmus.kit.build import build, host_platform
from orchestration import master
from orchestration.fmu.check import check_fmu
from orchestration.fmu.model import find_model
from orchestration.system import Member, Port, System, connect, library, ssp
from tests.support.archive import anonymous, edited
from tests.support.hosts import extracted, run_c_host, run_fmpy, run_libcosim
from tests.support.machines import MACHINES
from tests.support.master.samples import build_member
from tests.support.packed import MIXED, Amplifier, H, chain, circle, mixed

pytestmark = pytest.mark.slow
HERE = [host_platform()]


def staircase(count, seed=1):
    return np.repeat(np.random.default_rng(seed).uniform(0.0, 2.0, count // 5 + 1), 5)[:count]


def packed(system, folder):
    path = folder / f"{system.name}.fmu"
    path.write_bytes(master.pack(system, HERE))
    return path


def without_equations(system, folder, runtime="native", platforms=HERE):
    """The same system of FMU files that do not tell what they were made from."""
    members = []
    for member in system.members:
        own = folder / f"{member.name}_own.fmu"
        own.write_bytes(build(member.cls, runtime, platforms))
        path = edited(own, folder / f"{member.name}.fmu", anonymous)
        assert find_model(str(path)).cls is None
        members.append(Member(member.name, path, member.parameters))
    return replace(system, members=tuple(members))


def lags(u, tau):
    """Values of lags in a row, each of which holds its input over a step."""
    values = np.zeros((len(tau), u.size))
    for k in range(u.size - 1):
        fed = u[k]
        for i, one in enumerate(tau):
            before = values[i, k]
            values[i, k + 1] = fed + (before - fed) * exp(-H / one)
            # members step in turn, and each receives what the one before it has reached
            fed = 2.0 * values[i, k + 1] - 0.5 if i == 0 else values[i, k + 1]
    return dict(zip(MIXED, values, strict=True))


@pytest.mark.parametrize("run", [run_fmpy, run_libcosim])
def test_a_row_of_lags_is_that_on_paper(tmp_path, run):
    time = H * np.arange(31)
    u = staircase(time.size)
    found = run(packed(mixed(tmp_path), tmp_path), time, {"u": u}, list(MIXED))
    for name, wanted in lags(u, (0.4, 0.3, 0.7, 0.5)).items():
        assert np.abs(found[name] - wanted)[1:].max() < 1e-10


def test_parameters_and_steps_of_another_size(tmp_path):
    time = H * np.arange(31)
    u = np.repeat(staircase(7), 5)[:31]
    path = packed(mixed(tmp_path), tmp_path)
    found = run_fmpy(path, time[::5], {"u": u[::5]}, ["third", "last"], {"second.tau": 0.1})
    wanted = lags(u, (0.4, 0.1, 0.7, 0.5))
    for name, values in found.items():
        assert np.abs(values - wanted[name][::5]).max() < 1e-10


def test_a_tunable_parameter_acts_from_where_it_is_moved(tmp_path):
    time = H * np.arange(11)
    tau = np.where(time < 0.45, 0.4, 0.1)
    path = packed(without_equations(chain(), tmp_path), tmp_path)
    found = run_fmpy(path, time, {"u": 1.0, "first.tau": tau}, ["v1"])
    rest = np.append(1.0, np.exp(-np.cumsum(H / tau[:-1])))
    assert np.abs(found["v1"] - (1.0 - rest)).max() < 1e-10


def test_the_last_of_a_row_begins_with_what_came_through_the_others(tmp_path):
    """`member.c`: y = u through the first two, and the third begins with its input."""
    fmu = build_member(tmp_path)
    through = {"c": 0.0, "d": 1.0}
    members = (
        Member("third", fmu, {"follow": 1.0}),
        *(Member(n, fmu, through) for n in ("b", "a")),
    )
    wires = connect("a.y -> b.u", "b.y -> third.u")
    outputs = {"x": Port("third", "x")}
    system = System("row", members, wires, {"u": (Port("a", "u"),)}, outputs, step=H)
    found = run_fmpy(packed(system, tmp_path), H * np.arange(3), {"u": 1.5}, ["x"])
    assert found["x"] == pytest.approx(1.5, abs=1e-12)


def test_a_parameter_set_after_outputs_were_read_acts(tmp_path):
    """`member.c` looks at `follow` where it ends its initialization, and not later."""
    inputs = {"u": (Port("m", "u"),)}
    system = System("late", (Member("m", build_member(tmp_path)),), (), inputs, step=H)
    path = packed(system, tmp_path)
    description = fmpy.read_model_description(str(path))
    reference = {v.name: v.valueReference for v in description.modelVariables}
    with extracted(path) as folder:
        fmu = fmpy.fmi2.FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="late",
        )
        fmu.instantiate()
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.setReal([reference["u"]], [1.5])
        assert fmu.getReal([reference["m.x"]]) == [0.0]
        fmu.setReal([reference["m.follow"]], [1.0])
        fmu.exitInitializationMode()
        assert fmu.getReal([reference["m.x"]]) == [1.5]
        fmu.terminate()
        fmu.freeInstance()


@pytest.mark.parametrize("make", [chain, circle])
def test_booleans_tables_and_loops_are_as_with_laws(tmp_path, make):
    """The packed system with laws is that on paper (`test_packed_systems`)."""
    system = make()
    time = H * np.arange(31)
    (name,) = system.inputs
    inputs = {name: staircase(time.size)}
    outputs = list(system.outputs) or ["a.y", "b.y"]
    with_laws = run_fmpy(packed(system, tmp_path), time, inputs, outputs)
    found = run_fmpy(packed(without_equations(system, tmp_path), tmp_path), time, inputs, outputs)
    for output in outputs:
        assert np.abs(found[output] - with_laws[output]).max() <= 1e-12


def test_a_bench_of_files_equals_the_run_of_its_archive(tmp_path):
    system = without_equations(library.system("dma_bench"), tmp_path)
    ssp.write(system, tmp_path / "bench.ssp")
    bench = ssp.read(tmp_path / "bench.ssp", tmp_path / "unpacked")
    time = system.step * np.arange(401)
    inputs = {"force_reference": staircase(time.size), "current": 0.5 * staircase(time.size, 2)}
    wanted = master.run(bench, time, inputs).signals
    found = run_fmpy(packed(bench, tmp_path), time, inputs, list(system.outputs))
    for output, port in system.outputs.items():
        scale = np.abs(wanted[str(port)]).max()
        assert np.abs(found[output] - wanted[str(port)]).max() <= 1e-12 * max(scale, 1e-300)


@pytest.mark.parametrize(
    "machine", [m for m in MACHINES.values() if m.runners], ids=lambda m: m.name
)
def test_another_platform_gives_the_numbers_of_this_one(machine, tmp_path):
    if machine.lacks():
        pytest.skip(machine.lacks())
    platforms = ("linux64", machine.name)
    system = without_equations(library.system("dma_bench"), tmp_path, platforms=platforms)
    path = tmp_path / "packed.fmu"
    path.write_bytes(master.pack(system, platforms))
    time = system.step * np.arange(50)
    inputs = {"force_reference": staircase(time.size), "current": 0.5 * staircase(time.size, 2)}
    wanted = run_c_host(path, time, inputs, list(system.outputs))
    found = run_c_host(path, time, inputs, list(system.outputs), machine=machine)
    for output, values in wanted.items():
        assert np.abs(found[output] - values).max() <= 1e-12 * np.abs(values).max()


def test_a_member_in_python_finds_its_resources(tmp_path):
    """Its laws lie in its own resources, here in a folder whose name has a space."""
    member = Member.of("a", component("ppy_actuator"))
    system = System("one", (member,), (), {"current": (Port("a", "current"),)}, step=H)
    folder = tmp_path / "a space"
    folder.mkdir()
    python = without_equations(system, folder, "python")
    time = H * np.arange(11)
    inputs = {"current": staircase(time.size)}
    wanted = master.run(python, time, inputs).signals["a.voltage"]
    path = packed(python, folder)
    found = run_fmpy(path, time, inputs, ["a.voltage"])["a.voltage"]
    assert np.ptp(wanted) > 0.1
    assert np.abs(found - wanted).max() <= 1e-12
    assert fmpy.read_model_description(str(path)).coSimulation.needsExecutionTool


def test_it_is_a_valid_fmu_that_says_what_it_cannot_do(tmp_path):
    path = packed(mixed(tmp_path), tmp_path)
    assert validate_fmu(str(path)) == []
    assert not [finding for finding in check_fmu(path) if finding.severity == "error"]
    description = fmpy.read_model_description(str(path))
    assert not description.coSimulation.canGetAndSetFMUstate
    assert description.coSimulation.canHandleVariableCommunicationStepSize
    assert not description.coSimulation.canBeInstantiatedOnlyOncePerProcess
    names = {v.name for v in description.modelVariables if v.causality == "parameter"}
    assert {"second.tau", "third.tau", "last.tau"} <= names


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"status": 3.0, "when": 0.15}, r"two: fmi2DoStep ended with error"),
        ({"init": 3.0}, r"two: fmi2ExitInitializationMode ended with error"),
        (
            {"nan": 1.0, "when": 0.15, "status": 0.0},
            r"two: 'y' is not a finite number at t = 0\.2 s",
        ),
    ],
)
def test_what_fails_in_a_member_has_its_name(tmp_path, capfd, wrong, message):
    fmu = build_member(tmp_path)
    members = (Member("one", fmu), Member("two", fmu, wrong))
    system = System("pair", members, connect("one.y -> two.u"), {"u": (Port("one", "u"),)}, step=H)
    with pytest.raises(fmpy.fmi1.FMICallException):
        run_fmpy(packed(system, tmp_path), H * np.arange(4), {"u": 1.0}, ["two.y"])
    assert re.search(message, capfd.readouterr().out)


def test_an_fmu_that_runs_once_makes_a_system_that_does(tmp_path):
    once = build_member(tmp_path, canBeInstantiatedOnlyOncePerProcess=True)
    path = packed(System("alone", (Member("one", once),), ()), tmp_path)
    assert fmpy.read_model_description(str(path)).coSimulation.canBeInstantiatedOnlyOncePerProcess


def test_an_fmu_of_fmi_3_is_refused(tmp_path):
    own = tmp_path / "own.fmu"
    own.write_bytes(build(Amplifier, "native", HERE, fmi=3))
    other = edited(own, tmp_path / "other.fmu", anonymous)
    refused = (
        r"^system new: member one cannot be packed: other\.fmu has no equations, and is not for"
    )
    with pytest.raises(UserError, match=refused):
        master.pack(System("new", (Member("one", other),), ()), HERE)
