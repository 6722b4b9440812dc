"""The effects of the controllers: exactly the base at neutral, and what their equation says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fmus
from fmus.controllers.effects import EFFECTS
from fmus.kit import stack
from fmus.kit.build.building import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.record.compiled import CompiledModel
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from tests.support.completeness import check_described
from tests.support.laws import check_neutral, in_graph
from tests.support.pace import slow_but
from tests.support.sampled import run

CONTROLLERS = [
    name
    for name in fmus.COMPONENTS
    if fmus.component(name).__module__.startswith("fmus.controllers.")
]
each = pytest.mark.parametrize("name", CONTROLLERS)


def late(name):
    """A controller with its effect, and the parameter that switches it."""
    (effect,) = fmus.effects(name).values()
    return stack(fmus.component(name), effect), effect.neutral


def random_values(cls, seed, size=None):
    """Any input and state, parameters about their defaults; what switches the effect is left
    alone.
    """
    rng = np.random.default_rng(seed)
    layout = cls.layout
    values = {p.name: p.start * rng.uniform(0.9, 1.0, size) for p in layout.parameters}
    values |= {p.name: p.start for p in layout.parameters if p.type != "real"}
    for v in (*layout.inputs, *layout.discretes):
        drawn = v.nominal * rng.normal(size=size)
        values[v.name] = drawn if v.type == "real" else drawn > 0.0
    return values


def test_catalogue():
    names = ("adaptive", "displacement", "impedance", "learning")
    controllers = {f"{name}_controller" for name in names}
    assert set(CONTROLLERS) == controllers | {"feedforward", "pid", "state_feedback"}
    check_described("controllers", EFFECTS)
    assert {effect for name in CONTROLLERS for effect in fmus.effects(name)} == set(EFFECTS)
    assert all(effect.declared[effect.neutral].start == 0.0 for effect in EFFECTS.values())


@each
@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_neutral_is_bit_identical_on_floats(name, seed):
    base = fmus.component(name)
    values = random_values(base, seed)
    check_neutral(base, late(name)[0], values)


@each
def test_neutral_is_bit_identical_on_arrays(name):
    base = fmus.component(name)
    check_neutral(base, late(name)[0], random_values(base, 1, size=1000))


@each
def test_neutral_is_bit_identical_in_the_graph(name):
    base = fmus.component(name)
    values = {k: float(v) for k, v in random_values(base, 2).items()}
    check_neutral(base, late(name)[0], values, in_graph)


def command_of(name):
    return fmus.component(name).layout.outputs[0].name


@each
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_a_command_is_late_by_a_share_of_a_sample(name, share):
    """The mean of this one and the one before, of the controller without the effect."""
    cls, switch = late(name)
    first = next(v for v in cls.layout.inputs if v.type == "real")
    signal = {first.name: first.nominal * np.random.default_rng(3).standard_normal(100)}
    punctual = run(fmus.component(name)(), signal, 100)[command_of(name)]
    found = run(cls(**{switch: share}), signal, 100)[command_of(name)]
    before = np.append(0.0, punctual[:-1])
    np.testing.assert_allclose(found, (1.0 - share) * punctual + share * before, rtol=1e-12)


def test_slope_at_neutral_is_the_change_of_the_command():
    cls, switch = late("pid")
    time = 0.01 * np.arange(50)
    inputs = {"reference": np.sin(time), "measured": 0.0 * time}
    model = CompiledModel(cls, [switch]).run(time, inputs)
    command = model.signals["command"]
    # a sample shows at the point after it
    change = np.append(0.0, command[:-1]) - command
    slope = model.sensitivities["command"][:, 0]
    assert np.abs(slope).max() > 0.0
    np.testing.assert_allclose(slope[2:], change[2:], rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("name", slow_but(CONTROLLERS, "pid"))
def test_builds_agree_on_the_effect(name, tmp_path):
    cls, switch = late(name)
    first = next(v for v in cls.layout.inputs if v.type == "real")
    period = cls().sample_period
    time = period * np.arange(60)
    signal = {first.name: first.nominal * np.random.default_rng(4).standard_normal(60)}
    found = []
    for runtime in RUNTIMES:
        path = tmp_path / f"{runtime}.fmu"
        path.write_bytes(build(cls, runtime, [host_platform()]))
        with Fmu(path, {switch: 0.4}) as one:
            one.start(0.0, float(time[-1]))
            found.append(simulate_instance(one, time, signal)[command_of(name)])
    assert np.ptp(found[0]) > 0.0
    np.testing.assert_allclose(*found, rtol=1e-9, atol=1e-12)
