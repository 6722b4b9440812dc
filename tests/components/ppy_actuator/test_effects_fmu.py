"""Both builds of the actuator with effects laid over it: all at once, and (slow) each alone."""

import numpy as np
import pytest

from fmus.kit import stack
from fmus.kit.build import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulate import simulate_instance
from tests.support.effect_samples import active, bases, effects


def check_that_builds_agree(cls, values, folder):
    """To 1e-9 over steps of any size, of each output's own size."""
    rng = np.random.default_rng(7)
    time = np.concatenate([[0.0], np.cumsum(rng.choice([0.001, 0.01, 0.1], 60))])
    second = ("force", 2.5) if issubclass(cls, PpyActuator) else ("length_change", 8e-4)
    inputs = {"current": rng.uniform(-1.0, 1.3, time.size), second[0]: rng.uniform(0.0, second[1], time.size)}
    results = {}
    for runtime in RUNTIMES:
        path = folder / f"{runtime}.fmu"
        path.write_bytes(build(cls, runtime, [host_platform()]))
        with Fmu(path, values) as one:
            one.start(0.0, float(time[-1]))
            results[runtime] = simulate_instance(one, time, inputs)
    for output in cls.layout.measurable:
        found, expected = (results[runtime][output.name] for runtime in RUNTIMES)
        assert np.ptp(expected) > 0.0
        assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max(), output.name


@bases
def test_builds_agree_on_all_effects(base, tmp_path):
    check_that_builds_agree(stack(base, *EFFECTS.values(), name="everything"), active(EFFECTS), tmp_path)


@pytest.mark.slow
@bases
@effects
def test_builds_agree_on_each_effect(base, name, tmp_path):
    check_that_builds_agree(stack(base, EFFECTS[name]), active([name]), tmp_path)
