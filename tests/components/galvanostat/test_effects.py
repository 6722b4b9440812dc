"""The effects of the galvanostat: exactly the base at neutral, what its equation says elsewhere,
and nothing else.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fmus
from fmus.galvanostat.effects import EFFECTS, CurrentSaturation
from fmus.galvanostat.model import Galvanostat
from fmus.kit import stack
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel
from tests.support.completeness import check_described
from tests.support.laws import check_neutral, in_graph

CLIPPED = stack(Galvanostat, CurrentSaturation)


def random_values(cls, seed, size=None):
    """Any input and state within what can occur, parameters about their defaults; the neutral one
    is left alone.
    """
    rng = np.random.default_rng(seed)
    values = {
        p.name: p.start * rng.uniform(0.3, 3.0, size)
        for p in cls.layout.parameters
        if p.type == "real"
    }
    for v in (*cls.layout.inputs, *cls.layout.states, *cls.layout.discretes):
        values[v.name] = rng.normal(size=size) * 3.0
    values["recovery_samples"] = np.floor(rng.uniform(0, 2, size)) * 5.0
    values["compliance_share"] = rng.uniform(0.1, 1.0, size)
    return values if size else {name: float(value) for name, value in values.items()}


def test_catalogue():
    assert fmus.effects("galvanostat") == EFFECTS
    check_described("galvanostat", EFFECTS)
    assert all(effect.declared[effect.neutral].start == 0.0 for effect in EFFECTS.values())


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), potentiostat=st.booleans())
def test_neutral_is_bit_identical_on_floats(seed, potentiostat):
    values = random_values(Galvanostat, seed) | {"potentiostat": potentiostat}
    check_neutral(Galvanostat, CLIPPED, values)


def test_neutral_is_bit_identical_on_arrays():
    check_neutral(Galvanostat, CLIPPED, random_values(Galvanostat, 1, size=1000))


def test_neutral_is_bit_identical_in_the_graph():
    for seed in range(50):
        check_neutral(Galvanostat, CLIPPED, random_values(Galvanostat, seed), in_graph)


def record():
    """A square wave at the limit of the instrument, as in section 4.3."""
    time = 0.05 * np.arange(400)
    command = np.where(time % 10.0 < 5.0, 1.3, -1.3)
    return time, {"current_command": command, "voltage": 0.8 * np.sin(0.3 * time)}


def test_neutral_runs_are_the_base_run():
    time, inputs = record()
    base, effect = (CompiledModel(cls).run(time, inputs).signals for cls in (Galvanostat, CLIPPED))
    for name, values in base.items():
        np.testing.assert_array_equal(effect[name], values)


@pytest.mark.parametrize("loss", [0.1, 0.5, 0.999])
def test_the_drive_clips_earlier_and_is_otherwise_the_same(loss):
    model = CLIPPED(current_limit_loss=loss)
    for command in np.linspace(-3.0, 3.0, 101):
        model.current_command = float(command)
        current, saturated, recovering = model.outputs()
        limit = (1.0 - loss) * 1.3
        assert current == pytest.approx(np.clip(command, -limit, limit), rel=1e-15)
        assert saturated == (abs(command) > limit)
        assert not recovering
    model.voltage, model.voltage_limit = 2.0, 1.0
    Integrator(model).advance(0.0, 0.495)
    assert model.recovering()
    assert model.current() == 0.0


def test_slope_at_neutral_is_that_of_the_limit():
    """With respect to the loss: -I where the command is at the limit or beyond; exact, beside
    central differences.
    """
    time, inputs = record()
    inputs = inputs | {"current_command": 1.2 * inputs["current_command"]}
    found = (
        CompiledModel(CLIPPED, ["current_limit_loss"])
        .run(time, inputs)
        .sensitivities["current"][:, 0]
    )
    assert found == pytest.approx(-1.3 * np.sign(inputs["current_command"]), rel=1e-12)
    ends = [
        CompiledModel(CLIPPED).run(time, inputs, {"current_limit_loss": 0.1 + s}).signals
        for s in (1e-4, -1e-4)
    ]
    assert (ends[0]["current"] - ends[1]["current"]) / 2e-4 == pytest.approx(found, rel=1e-9)
    inputs = inputs | {"current_command": 0.5 * inputs["current_command"]}
    below = (
        CompiledModel(CLIPPED, ["current_limit_loss"]).run(time, inputs).sensitivities["current"]
    )
    assert not below.any(), "below the limit nothing is seen of it"


OTHERS = stack(Galvanostat, *(EFFECTS[name] for name in ("current_offset", "current_gain")))


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), potentiostat=st.booleans())
def test_offset_and_gain_are_nothing_at_zero(seed, potentiostat):
    values = random_values(Galvanostat, seed) | {"potentiostat": potentiostat}
    check_neutral(Galvanostat, OTHERS, values)


def test_offset_and_gain_stay_within_the_limits_and_out_of_recovery():
    model = OTHERS(drive_offset=0.2, drive_gain_error=0.1)
    for command in np.linspace(-3.0, 3.0, 101):
        model.current_command = float(command)
        wanted = {1.1 * command + 0.2, 1.1 * (command + 0.2)}  # in either order
        assert min(abs(model.current() - np.clip(w, -1.3, 1.3)) for w in wanted) < 1e-12
    model.recovery_samples = 5.0
    assert model.current() == 0.0
