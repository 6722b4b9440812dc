"""Claims: a tunable parameter that a host moves at every communication point gives the bits of an
input in its place, and models with discrete inputs run in solvers that set them too early.
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
from tests.support import hosts

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
    table = np.zeros(400, [("time", float), ("gain", float), ("u", float)])
    table["time"] = STEP * np.arange(table.size)
    table["gain"], table["u"] = courses(table.size)
    results = [
        simulate_fmu(
            path,
            stop_time=table["time"][-1],
            output_interval=STEP,
            input=table,
            output=OUTPUTS,
            fmi_type="CoSimulation",
        )
        for path in pair(fmi)
    ]
    assert len(results[0]) == len(results[1]) == table.size
    for name in OUTPUTS:
        np.testing.assert_array_equal(results[0][name], results[1][name])
        assert np.ptp(results[0][name]) > 0.01


@pytest.mark.slow
def test_libcosim_moves_it(pair):
    times = STEP * np.arange(400)
    gains, inputs = courses(times.size)
    driven = {"gain": gains, "u": inputs}
    results = [hosts.run_libcosim(path, times, driven, OUTPUTS) for path in pair()]
    for name in OUTPUTS:
        np.testing.assert_array_equal(results[0][name], results[1][name])
        assert np.nanmax(results[0][name]) - np.nanmin(results[0][name]) > 0.01


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
