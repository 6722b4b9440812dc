import math
import os
import subprocess
import sys
from array import array

import numpy as np
import pytest
from scipy.linalg import expm

import fmus
from fmus.kit import Component, State, sqrt, stack
from fmus.kit.build.package import python_package
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.slave import Slave
from fmus.ppy_actuator.effects import EFFECTS
from tests.support.kit_samples import Mixed, Thermostat
from tests.support.pace import slow_but


def slave(cls, start_time=0.0, **values):
    """Return an instance and its memory, filled as the C front-end does (``fmi/engine.h``)."""
    layout = cls.layout
    memory = array("d", [0.0] * (len(layout.names) + 4 + len(layout.sampled)))
    known = {v.name: v.start for v in (*layout.parameters, *layout.inputs)} | values
    known |= {s.name: known[f"{s.name}_start"] for s in (*layout.states, *layout.discretes)}
    for i, name in enumerate(layout.names):
        memory[i] = float(known.get(name, 0.0))
    memory[len(layout.names) : len(layout.names) + 4] = array(
        "d", [math.inf, start_time, cls.tolerance, 1.0]
    )
    instance = Slave(cls, memoryview(memory))
    assert instance.initialize() is None
    return instance, memory


def test_outputs_and_derivatives_are_evaluated_from_the_memory():
    instance, memory = slave(Thermostat, boost=True)
    names = Thermostat.layout.names
    assert instance.evaluate(0.0) is None
    assert instance.differentiate(0.0) is None
    assert memory[names.index("power")] == 30.0
    assert memory[names.index("der(temperature)")] == (30.0 - 0.5 * (290.0 - 280.0)) / 20.0
    assert memory[names.index("der(energy)")] == 30.0
    memory[names.index("boost")] = 0.0
    instance.evaluate(0.0)
    assert memory[names.index("power")] == 0.0


def test_advance_against_the_closed_form():
    instance, memory = slave(fmus.component("ppy_actuator"), current=0.9)
    for k in range(50):
        assert instance.advance(k * 0.1, 0.1) is None
    tau = (0.43 + 2.35) * 2.70
    charge = memory[fmus.component("ppy_actuator").layout.names.index("charge")]
    assert charge == pytest.approx(0.9 * 2.35 * 2.70 * (1 - math.exp(-5.0 / tau)), rel=1e-8)


def test_a_copy_of_the_memory_is_a_copy_of_the_instance():
    instance, memory = slave(Thermostat, boost=True, sampling=0.37)
    for k in range(7):
        instance.advance(k * 0.5, 0.5)
    saved = memory[:]
    for k in range(7, 20):
        instance.advance(k * 0.5, 0.5)
    instance.evaluate(10.0)
    instance.differentiate(10.0)
    first = memory.tobytes()
    memory[:] = saved
    memory[len(Thermostat.layout.names) + 3] = 1.0  # the front-end says so after restoring
    for k in range(7, 20):
        instance.advance(k * 0.5, 0.5)
    instance.evaluate(10.0)
    instance.differentiate(10.0)
    assert memory.tobytes() == first

    other, elsewhere = slave(Thermostat)
    elsewhere[:] = saved
    elsewhere[len(Thermostat.layout.names) + 3] = 1.0
    for k in range(7, 20):
        other.advance(k * 0.5, 0.5)
    other.evaluate(10.0)
    other.differentiate(10.0)
    assert elsewhere.tobytes() == first


def test_the_tolerance_of_the_host_is_used():
    instance, memory = slave(Thermostat)
    memory[len(Thermostat.layout.names) + 2] = 1e-11
    assert instance.initialize() is None
    assert instance.integrator.tolerance == 1e-11


def test_what_a_law_raises_becomes_a_sentence():
    class Broken(Component):
        name = "broken"
        x = State("1", rate="law", start=1.0)

        def law(self):
            return self.missing

    class Undefined(Component):
        name = "undefined"
        x = State("1", rate="law", start=1.0)

        def law(self):
            return sqrt(-self.x)

    memory = memoryview(array("d", [1.0, 1.0, 0.0, math.inf, 0.0, 1e-9, 1.0]))
    sentence = Slave(Broken, memory).differentiate(0.0)
    assert sentence is not None
    assert "AttributeError" in sentence
    assert "in law" in sentence
    assert "\n" not in sentence
    instance, _ = slave(Undefined)
    assert instance.advance(0.0, 1.0) == "not finite: x at 0 s"


def test_variables_may_have_the_names_that_the_machinery_uses():
    exact = expm(np.array([[-0.5, 0.0, 0.5], [2.0, -2.0, 0.0], [0.0, 0.0, 0.0]]) * 2.0) @ [
        0.0,
        0.3,
        1.0,
    ]
    sampled = sum(1.0 - math.exp(-0.5 * 0.25 * k) for k in range(8))
    instance, memory = slave(Mixed)
    for k in range(5):
        assert instance.advance(k * 0.4, 0.4) is None
    assert instance.evaluate(2.0) is None
    found = dict(zip(Mixed.layout.names, memory, strict=False))
    compiled = CompiledModel(Mixed).run(0.4 * np.arange(6), {}).signals
    for names in (found, {name: signal[-1] for name, signal in compiled.items()}):
        assert [names["m"], names["x0"]] == pytest.approx(exact[:2], rel=1e-7)
        assert names["n0"] == pytest.approx(exact[0] - exact[1], rel=1e-7)
        assert names["y"] == pytest.approx(sampled, rel=1e-7)
    assert [found["h"], found["w"], found["t"]] == [0.5, 2.0, 1.0]


def test_an_interrupt_ends_the_call_with_a_sentence_and_reaches_the_host():
    code = """
import _thread, signal, time
from array import array
from fmus.kit import Component, State
from fmus.kit.slave import Slave

class Interrupted(Component):
    name = "interrupted"
    x = State("1", rate="law")

    def law(self):
        signal.raise_signal(signal.SIGINT)
        return 1.0

instance = Slave(Interrupted, memoryview(array("d", [0.0, 0.0, 0.0, float("inf"), 0.0, 1e-8, 1.0])))
real, _thread.start_new_thread = _thread.start_new_thread, lambda *arguments: None
print("KeyboardInterrupt" in instance.advance(0.0, 1.0), flush=True)
_thread.start_new_thread = real
try:
    # the host may be interrupted at any instant from the end of this call
    instance.advance(0.0, 1.0)
    for _ in range(1000):
        time.sleep(0.01)
except KeyboardInterrupt:
    print("seen")
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=15
    )
    assert done.stdout.split() == ["True", "seen"]


def test_memory_is_released_on_close():
    instance, memory = slave(Thermostat)
    instance.close()
    memory.append(0.0)  # refused by Python while someone looks at it


@pytest.mark.parametrize(
    "name", slow_but(["ppy_actuator", "ppy_actuator_length_driven"], "ppy_actuator")
)
def test_what_a_python_fmu_carries_runs_without_any_package(name, tmp_path):
    cls = stack(fmus.component(name), *EFFECTS.values())
    for path, contents in python_package(cls).items():
        target = tmp_path / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(contents)
    package = tmp_path / "resources" / "python"
    package.rename(package.with_name("carried"))
    code = f"""
import sys
sys.path.insert(0, {str(tmp_path / "resources")!r})
import carried
from array import array
layout = carried.MODEL.layout
memory = array("d", [0.0] * (len(layout.names) + 4))
for i, v in enumerate((*layout.parameters, *layout.inputs)):
    memory[i] = v.start
memory[layout.names.index("current")] = 0.9
memory[len(layout.names):] = array("d", [float("inf"), 0.0, 1e-9, 1.0])
slave = carried.create(memoryview(memory), b"")
print(carried.MODEL.name, slave.initialize(), *(slave.advance(k * 0.5, 0.5) for k in range(10)),
      memory[layout.names.index("charge")])
"""
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=os.sep,
    )
    title, *messages, charge = done.stdout.split()
    assert title == cls.name
    assert messages == ["None"] * 11
    exact = expm(np.array([[-1 / (2.78 * 2.7), 0.9 * 2.35 / 2.78], [0, 0]]) * 5.0)[0, 1]
    assert float(charge) == pytest.approx(exact, rel=1e-8)


def test_slave_and_integrator_take_the_same_steps():
    instance, memory = slave(Thermostat, boost=True)
    model = Thermostat(boost=True)
    integrator = Integrator(model)
    for k in range(30):
        instance.advance(k * 0.7, 0.7)
        integrator.advance(k * 0.7, 0.7)
    index = Thermostat.layout.names.index
    assert memory[index("temperature")] == model.temperature
    assert memory[index("changes")] == model.changes
    assert memory[len(Thermostat.layout.names)] == integrator.hint
