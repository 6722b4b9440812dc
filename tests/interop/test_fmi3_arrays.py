"""Claims: an array of FMI 3.0 has the numbers that its elements have in FMI 2.0, in every host, and
is read, set and differentiated as a whole; a wrong number of values is refused in one line.
"""

from __future__ import annotations

import ctypes
import re
import zipfile

import fmpy
import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Model, FMU3Slave
from scipy.linalg import expm

from fmus.controllers.learning_controller import LearningController
from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from tests.support import fmusim, hosts
from tests.support.kit_samples import Wall
from tests.support.stimuli import STIMULI

STARTS = [3.0, 1.0, -2.0]
EXCHANGE = [0.5, 2.0, 1.5]
LAPLACE = np.array([[-2.0, 1.0, 0.0], [1.0, -2.0, 1.0], [0.0, 1.0, -2.0]])  # of `Wall.warming`
RATES = np.diag(EXCHANGE) @ LAPLACE
HEAT = np.array([1.0, -1.0, 0.5])
ERROR = 3


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """Paths of `Wall` by version of FMI."""
    folder = tmp_path_factory.mktemp("wall")
    paths = {fmi: folder / str(fmi) / "wall.fmu" for fmi in (2, 3)}
    for fmi, path in paths.items():
        path.parent.mkdir()
        path.write_bytes(build(Wall, "native", [host_platform()], fmi=fmi))
    return paths


class Opened:
    """An instance in fmpy, with the log of its messages."""

    def __init__(self, path, folder, kind=FMU3Slave):
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        description = read_model_description(str(path))
        self.messages = []
        self.names = {v.name: v.valueReference for v in description.modelVariables}
        self.fmu = kind(
            guid=description.guid,
            modelIdentifier=description.modelName,
            unzipDirectory=str(folder),
            instanceName="one",
        )
        keep = fmpy.fmi3.fmi3LogMessageCallback(
            lambda environment, status, category, text: self.messages.append(text.decode())
        )
        self.fmu.instantiate(logMessage=keep)
        self.fmu.setFloat64([self.names["exchange"]], EXCHANGE)
        self.fmu.setFloat64([self.names["temperature_start"]], STARTS)
        self.fmu.enterInitializationMode()
        self.fmu.setFloat64([self.names["heat"]], HEAT.tolist())
        self.fmu.exitInitializationMode()

    def refused(self, call, *arguments):
        """Return the line of a call that must be refused."""
        self.messages.clear()
        with pytest.raises(FMICallException) as caught:
            call(*arguments)
        assert caught.value.status == ERROR
        (line,) = self.messages
        return line


@pytest.fixture
def one(wall, tmp_path):
    opened = Opened(wall[3], tmp_path / "unpacked")
    yield opened
    opened.fmu.freeInstance()


def elements(values, name):
    """Values of an array in a row of results, by the names of its elements in FMI 2.0."""
    values = np.asarray(values)
    return {
        f"{name}[{','.join(str(i + 1) for i in place)}]": values[place]
        for place in np.ndindex(values.shape)
    }


def in_both(paths, starts, output, **options):
    """Run both versions; return the columns of FMI 2.0, and those of 3.0 by their names."""
    shared = {"fmi_type": "CoSimulation", **options}
    flat = {k: v for name, values in starts.items() for k, v in elements(values, name).items()}
    of_3 = simulate_fmu(str(paths[3]), start_values=starts, output=output, **shared)
    columns = {}
    for name in output:
        stacked = of_3[name].reshape(len(of_3), -1)
        names = elements(of_3[name][0], name) if of_3[name].ndim > 1 else [name]
        columns |= dict(zip(names, stacked.T, strict=True))
    of_2 = simulate_fmu(str(paths[2]), start_values=flat, output=list(columns), **shared)
    return of_2, columns


def test_fmpy_gets_the_bits_of_fmi_2(wall):
    starts = {
        "exchange": EXCHANGE,
        "temperature_start": STARTS,
        "heat": HEAT,
        "count_start": [3, 4],
    }
    output = ["temperature", "products", "count", "total", "heat"]
    of_2, of_3 = in_both(wall, starts, output, stop_time=2.0, output_interval=0.25)
    assert len(of_3) == 3 + 6 + 2 + 1 + 3
    for name, values in of_3.items():
        assert of_2[name].tobytes() == values.tobytes(), name
    assert of_3["count[2]"].tolist()[-1] == 4 + 4 * 10


def test_the_learning_controller_has_the_bits_of_fmi_2(fmu):
    starts = {"learnt_start": np.linspace(-0.1, 0.2, 41), "displacement": 1e-4}
    of_2, of_3 = in_both(
        {fmi: fmu("learning_controller", "native", fmi) for fmi in (2, 3)},
        {"learnt_start": starts["learnt_start"]},
        ["lesson", "learnt", "command"],
        stop_time=30.0,
        output_interval=0.25,
        input=np.array([(0.0, 1e-4), (30.0, -2e-4)], [("time", float), ("reference", float)]),
    )
    assert len(of_3) == 41 + 41 + 1
    for name, values in of_3.items():
        assert of_2[name].tobytes() == values.tobytes(), name
    assert np.ptp(of_3["learnt[41]"]) > 0.0


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_states_follow_their_closed_form(wall, kind):
    found = simulate_fmu(
        str(wall[3]),
        stop_time=1.5,
        output_interval=0.25,
        start_values={"exchange": EXCHANGE, "temperature_start": STARTS, "heat": HEAT.tolist()},
        output=["temperature", "products"],
        fmi_type=kind,
        relative_tolerance=1e-10,
    )
    rest = np.linalg.solve(RATES, -HEAT)
    expected = [rest + expm(RATES * t) @ (np.array(STARTS) - rest) for t in found["time"]]
    np.testing.assert_allclose(found["temperature"], expected, rtol=0, atol=1e-6)
    rows = np.stack([found["temperature"], 2.0 * found["temperature"]], axis=1)
    np.testing.assert_array_equal(found["products"], rows)


def test_several_variables_in_a_call_have_their_values_one_after_another(one):
    vr = [one.names[name] for name in ("total", "temperature", "time", "exchange", "temperature")]
    expected = [2.5, *STARTS, 0.0, *EXCHANGE, *STARTS]
    assert one.fmu.getFloat64(vr, len(expected)) == expected
    assert one.fmu.getInt32([one.names["count"]], 2) == [0, 0]
    assert one.fmu.getBoolean([one.names["counts"]], 2) == [True, True]
    one.fmu.setBoolean([one.names["counts"]], [True, False])
    assert one.fmu.getBoolean([one.names["counts"]], 2) == [True, False]


@pytest.mark.parametrize("count", [0, 1, 2, 4, 6])
def test_a_wrong_number_of_values_is_refused_by_name(one, count):
    vr = [one.names["heat"]]
    said = f"{count} values for 1 variables, which have 3; 'heat' has 3"
    assert said in one.refused(one.fmu.getFloat64, vr, count)
    assert said in one.refused(one.fmu.setFloat64, vr, [1.0] * count)
    assert one.fmu.getFloat64(vr, 3) == HEAT.tolist()


def test_an_element_has_no_reference_of_its_own(one):
    inside = [one.names["heat"] + 1]
    said = f"value reference {inside[0]} is inside of 'heat', whose reference is {inside[0] - 1}"
    assert said in one.refused(one.fmu.getFloat64, inside, 1)
    assert said in one.refused(one.fmu.setFloat64, inside, [1.0])


def test_of_an_array_all_or_nothing_is_set(one):
    bad = [7.0, 8.0, float("nan")]
    assert "'heat[3]' = nan" in one.refused(one.fmu.setFloat64, [one.names["heat"]], bad)
    assert one.fmu.getFloat64([one.names["heat"]], 3) == HEAT.tolist()


def test_arrays_that_are_missing_are_refused(one):
    vr = (ctypes.c_uint * 1)(one.names["heat"])
    for refs, values in ((vr, None), (None, (ctypes.c_double * 3)())):
        one.messages.clear()
        library = one.fmu.dll
        get, set_ = library.fmi3GetFloat64, library.fmi3SetFloat64
        for function in (get, set_):
            function.argtypes = None
            size = ctypes.c_size_t
            status = function(
                ctypes.c_void_p(one.fmu.component), refs, size(1), values, size(3 if refs else 1)
            )
            assert status == ERROR
        assert all(re.search(r"NULL though it should have \d", line) for line in one.messages)
        assert len(one.messages) == 2


def test_derivatives_are_those_of_the_matrix(one):
    unknowns, knowns = (
        [one.names["der(temperature)"], one.names["total"]],
        [one.names["temperature"]],
    )
    everything = np.vstack([RATES, np.ones(3)])
    for seed in np.eye(3):
        found = one.fmu.getDirectionalDerivative(unknowns, knowns, seed.tolist(), 4)
        np.testing.assert_allclose(found, everything @ seed, rtol=1e-15)
    for seed in np.eye(4):
        found = one.fmu.getAdjointDerivative(unknowns, knowns, seed.tolist(), 3)
        np.testing.assert_allclose(found, seed @ everything, rtol=1e-15)
    products = [one.names["products"]]
    assert one.fmu.getDirectionalDerivative(products, knowns, [1.0, 2.0, 3.0], 6) == [
        1,
        2,
        3,
        2,
        4,
        6,
    ]
    for few in (1, 3):
        said = one.refused(one.fmu.getDirectionalDerivative, unknowns, knowns, [1.0] * 3, few)
        assert f"{few} values for 2 variables, which have 4" in said
    said = one.refused(one.fmu.getDirectionalDerivative, unknowns, knowns, [1.0], 4)
    assert "1 values for 1 variables, which have 3; 'temperature' has 3" in said


def test_derivatives_of_outputs_are_of_all_elements(one):
    one.fmu.doStep(0.0, 0.25)
    temperature = np.array(one.fmu.getFloat64([one.names["temperature"]], 3))
    rates = RATES @ temperature + HEAT
    vr = (ctypes.c_uint * 2)(one.names["temperature"], one.names["products"])
    orders, values = (ctypes.c_int32 * 2)(1, 1), (ctypes.c_double * 9)()
    one.fmu.fmi3GetOutputDerivatives(one.fmu.component, vr, 2, orders, values, 9)
    np.testing.assert_allclose(values, [*rates, *rates, *(2.0 * rates)], rtol=1e-14)
    call = one.fmu.fmi3GetOutputDerivatives
    assert "'products' has 6" in one.refused(call, one.fmu.component, vr, 2, orders, values, 2)
    orders[1] = 2
    assert "order 2" in one.refused(call, one.fmu.component, vr, 2, orders, values, 9)


def test_a_state_that_was_saved_has_the_arrays(one):
    vr = [one.names["temperature"], one.names["products"]]
    state = one.fmu.getFMUState()
    before = one.fmu.getFloat64(vr, 9)
    one.fmu.doStep(0.0, 0.25)
    assert one.fmu.getFloat64(vr, 9) != before
    again = one.fmu.deserializeFMUState(one.fmu.serializeFMUState(state))
    one.fmu.setFMUState(again)
    assert one.fmu.getFloat64(vr, 9) == before


def test_states_of_model_exchange_are_the_elements(wall, tmp_path):
    opened = Opened(wall[3], tmp_path / "unpacked", FMU3Model)
    try:
        states, rates = (ctypes.c_double * 3)(), (ctypes.c_double * 3)()
        assert opened.fmu.getNumberOfContinuousStates() == 3
        opened.fmu.getContinuousStates(states, 3)
        assert list(states) == STARTS
        opened.fmu.getContinuousStateDerivatives(rates, 3)
        assert opened.fmu.getFloat64([opened.names["der(temperature)"]], 3) == list(rates)
        np.testing.assert_allclose(rates, RATES @ STARTS + HEAT, rtol=1e-15)
    finally:
        opened.fmu.freeInstance()


@pytest.mark.skipif(not fmusim.BINARY, reason=fmusim.MISSING)
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_fmusim_gets_the_numbers_of_fmpy(wall, kind):
    options = {
        "stop_time": 1.0,
        "output_interval": 0.25,
        "fmi_type": kind,
        "relative_tolerance": 1e-9,
    }
    output = ["temperature", "products", "total"]
    found = fmusim.simulate_fmu(
        str(wall[3]),
        start_values={"temperature_start": "3 1 -2", "exchange": "0.5 2 1.5"},
        output=output,
        **options,
    )
    expected = simulate_fmu(
        str(wall[3]),
        start_values={"temperature_start": STARTS, "exchange": EXCHANGE},
        output=output,
        record_events=False,
        **options,
    )
    flat = np.hstack([expected[name].reshape(len(expected), -1) for name in output])
    assert found.dtype.names[1:4] == ("temperature[0]", "temperature[1]", "temperature[2]")
    columns = np.array([found[name] for name in found.dtype.names[1:]]).T
    np.testing.assert_allclose(columns, flat, rtol=0, atol=1e-7)


@pytest.mark.slow
def test_ecos_steps_the_learning_controller_with_its_arrays(fmu):
    stop, step, stimuli = STIMULI["learning_controller"]
    time = np.arange(0.0, stop, step)
    columns = {
        name: mean + size * np.sin(speed * time) for name, (mean, size, speed) in stimuli.items()
    }
    of_2, of_3 = (
        hosts.run_ecos(fmu("learning_controller", "native", fmi), time, columns, ["command"])
        for fmi in (2, 3)
    )
    assert np.ptp(of_3["command"]) > 0.0
    np.testing.assert_array_equal(of_3["command"], of_2["command"])


def test_a_subclass_has_registers_of_another_size(tmp_path):
    class Quick(LearningController):
        """Of twelve samples a period."""

        name = "quick"
        samples = 12

    path = tmp_path / "quick.fmu"
    path.write_bytes(build(Quick, "native", [host_platform()], fmi=3))
    steps = 4 * Quick.samples
    time = 0.25 * np.arange(steps)
    period = 0.25 * Quick.samples
    table = np.zeros(steps, [("time", float), ("reference", float)])
    table["time"], table["reference"] = time, 1e-4 * np.sin(2.0 * np.pi * time / period)
    found = simulate_fmu(
        str(path),
        stop_time=time[-1],
        output_interval=0.25,
        input=table,
        start_values={"smoothing": 0.0, "learning_time": 0.0, "lead": 0},
        output=["learnt", "command"],
    )
    assert found["learnt"].shape == (steps, 13)
    # without smoothing and rate each period adds G e to the command of the period before
    size = 1160.0 * 1e-4
    late = found["command"].max()
    assert 2.5 * size < late <= 3.0 * size * (1.0 + 1e-12)
