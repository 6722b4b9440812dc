"""Claims: a tunable parameter that a host moves at every communication point gives the bits of an
input in its place, in C and in five tools, and models with discrete inputs run in solvers that set
them too early.
"""

from __future__ import annotations

import zipfile
from ctypes import c_uint

import numpy as np
import pytest
from fmpy import simulate_fmu

from fmus.kit import Component, Discrete, Input, Output, Parameter, State, maximum
from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from tests.contract.raw import OK, Instance, Library, doubles, unzipped
from tests.support import fmusim, hosts, pyfmi_host

STEP = 2.0**-6  # s, which sums of steps meet exactly
OUTPUTS = ["follower", "register", "command"]


class Followed(Component):
    """A state, a sampled state and an output with one gain, which subclasses declare."""

    period = Parameter(3.0 * STEP, "s", min=1e-3, max=1.0, doc="sample period")
    u = Input("1", start=0.5, doc="what is followed")
    follower = State("1", rate="follower_rate", output=True, doc="follows the input")
    register = Discrete("1", update="next", period="period", output=True, doc="sampled sum")

    def follower_rate(self):
        return self.gain * (self.u - self.follower)

    def next(self):
        return 0.9 * self.register + self.gain * self.period * self.u

    @Output("1/s")
    def command(self):
        """A magnitude."""
        return maximum(self.gain * self.follower, self.u) / (1.0 + self.gain * self.gain)


class OfParameter(Followed):
    """Whose gain is a tunable parameter."""

    name = "of_parameter"

    gain = Parameter(2.0, "1/s", min=0.1, max=9.0, tunable=True, doc="gain")


class OfInput(Followed):
    """Whose gain is an input."""

    name = "of_input"

    gain = Input("1/s", start=2.0, min=0.1, max=9.0, doc="gain")


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Paths of both models: ``pair(fmi)``."""
    folder = tmp_path_factory.mktemp("pair")

    def paths(fmi=2):
        files = []
        for cls in (OfParameter, OfInput):
            file = folder / f"{cls.name}_{fmi}.fmu"
            if not file.exists():
                file.write_bytes(build(cls, "native", [host_platform()], fmi=fmi))
            files.append(str(file))
        return files

    return paths


def courses(n):
    """Gains and inputs that jump at every point."""
    rng = np.random.default_rng(144)
    return rng.uniform(0.1, 9.0, n), rng.uniform(-1.0, 1.0, n)


@pytest.mark.slow
def test_a_million_steps_in_c(pair):
    count = 1_000_000
    values = [doubles(*row) for row in np.column_stack(courses(5000)).tolist()]
    with unzipped(pair()[0]) as first, unzipped(pair()[1]) as second:
        instances = [Instance(Library(folder)).initialize() for folder in (first, second)]
        calls = []
        for one in instances:
            given = one.references(["gain", "u"])
            read = (c_uint * len(OUTPUTS))(*one.references(OUTPUTS))
            cells = doubles(*[0.0] * len(OUTPUTS))
            dll = one.dll
            calls.append((dll.fmi2SetReal, dll.fmi2DoStep, dll.fmi2GetReal, one.component))
            calls[-1] += (given, read, cells)
        for k in range(count):
            row, time = values[k % len(values)], k * STEP
            for set_real, step, get_real, address, given, read, cells in calls:
                status = set_real(address, given, 2, row)
                status |= step(address, time, STEP, 1)
                status |= get_real(address, read, len(OUTPUTS), cells)
                assert status == OK
            assert bytes(calls[0][-1]) == bytes(calls[1][-1]), k
        for one in instances:
            one.free()


@pytest.mark.parametrize("fmi", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_fmpy_moves_it(pair, fmi):
    expect_the_bits(by_itself(simulate_fmu), pair(fmi))


def table(times):
    """Gain and input over time, as tools take them from a file."""
    rows = np.zeros(times.size, [("time", float), ("gain", float), ("u", float)])
    rows["time"] = times
    rows["gain"], rows["u"] = courses(times.size)
    return rows


def in_step(run):
    """A tool that a program of ours steps, with what is set before each step."""

    def simulate(path):
        times = STEP * np.arange(400)
        gains, inputs = courses(times.size)
        return run(path, times, {"gain": gains, "u": inputs}, OUTPUTS)

    return simulate


def by_itself(run, fmi_type="CoSimulation", **options):
    """A tool that steps by itself, with the table of its inputs."""

    def simulate(path, rows=None):
        times = STEP * np.arange(400)
        return run(
            path,
            fmi_type=fmi_type,
            stop_time=times[-1],
            output_interval=STEP,
            output=OUTPUTS,
            input=table(times) if rows is None else rows,
            **options,
        )

    return simulate


def expect_the_bits(simulate, paths):
    """Compare both models in a tool."""
    results = [simulate(path) for path in paths]
    for name in OUTPUTS:
        np.testing.assert_array_equal(results[0][name], results[1][name])
        assert np.nanmax(results[0][name]) - np.nanmin(results[0][name]) > 0.01


FMUSIM = pytest.mark.skipif(not fmusim.BINARY, reason=fmusim.MISSING)
PYFMI = pytest.mark.skipif(not pyfmi_host.INTERPRETER, reason=pyfmi_host.MISSING)
# not libcosim, which has no FMI 3, nor PyFMI, which has no co-simulation of it
MOVING = [
    pytest.param(2, in_step(hosts.run_libcosim), id="2-libcosim"),
    pytest.param(2, in_step(hosts.run_ecos), id="2-ecos"),
    pytest.param(3, in_step(hosts.run_ecos), id="3-ecos"),
    pytest.param(2, by_itself(fmusim.simulate_fmu), id="2-fmusim", marks=FMUSIM),
    pytest.param(3, by_itself(fmusim.simulate_fmu), id="3-fmusim", marks=FMUSIM),
    pytest.param(2, by_itself(pyfmi_host.simulate_fmu), id="2-pyfmi", marks=PYFMI),
]


@pytest.mark.slow
@pytest.mark.parametrize(("fmi", "simulate"), MOVING)
def test_masters_move_it(pair, fmi, simulate):
    expect_the_bits(simulate, pair(fmi))


@FMUSIM
@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_fmusim_moves_it_at_events_of_model_exchange(pair, fmi):
    """It holds a tunable parameter, and draws a line through an input unless its table jumps."""
    times = STEP * np.arange(400)
    held = np.repeat(table(times), 2)[1:-1]
    held["gain"][0::2], held["u"][0::2] = table(times)["gain"][:-1], table(times)["u"][:-1]
    held["gain"][1::2], held["u"][1::2] = held["gain"][0::2], held["u"][0::2]
    simulate = by_itself(fmusim.simulate_fmu, "ModelExchange", solver="Euler")
    expect_the_bits(lambda path: simulate(path, held), pair(fmi))


@PYFMI
@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_pyfmi_takes_none_from_a_table_in_model_exchange(pair, fmi):
    """Its table is of inputs alone: a tunable parameter is set between two of its simulations."""
    with pytest.raises(RuntimeError, match="Only variables specified to be inputs are allowed"):
        by_itself(pyfmi_host.simulate_fmu, "ModelExchange")(pair(fmi)[0])


def table_of(text):
    """A table as an archive has it, as fmpy takes it."""
    return np.genfromtxt(text.splitlines(), delimiter=",", names=True, dtype=None, encoding=None)


@pytest.mark.parametrize("fmi", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_the_test_stand_runs_its_reference_experiment_in_model_exchange(fmu, fmi):
    """fmpy's solver sets the Boolean input `zero` wherever it looks for roots."""
    path = fmu("isotonic_stand", "native", fmi)
    with zipfile.ZipFile(path) as archive:
        folder = next(n for n in archive.namelist() if n.endswith("isotonic_stand_in.csv"))
        stimuli = table_of(archive.read(folder).decode())
        expected = table_of(archive.read(folder.replace("_in.csv", "_ref.csv")).decode())
    types = [(n, bool if n == "zero" else float) for n in stimuli.dtype.names]
    found = simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=expected["time"][-1],
        output_interval=0.01,
        relative_tolerance=1e-9,
        input=stimuli.astype(types),
        record_events=False,
    )
    last = np.append(np.diff(expected["time"]) > 0.0, True)  # after a jump
    for name in expected.dtype.names[1:]:
        # the host looks at the inputs before an event, so that at a jump the result is either
        steady = np.interp(found["time"], expected["time"][last], expected[name][last])
        jumps = np.isin(found["time"].round(9), expected["time"][~last].round(9))
        scale = np.abs(expected[name]).max()
        assert np.abs(found[name] - steady)[~jumps].max() <= 1e-6 * scale, name
