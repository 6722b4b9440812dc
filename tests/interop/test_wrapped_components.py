"""Claims: the builds of FMI 3.0 of our components are FMUs like any other here: they give the bits
of those of FMI 2.0, are found without fault, and are known again.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus import component
from fmus.kit import stack
from fmus.kit.build import build_cached
from orchestration.fmu import Fmu, find_model
from orchestration.fmu.check import check_fmu
from orchestration.fmu.model.effects import find_effects
from orchestration.fmu.simulation import simulate_instance
from tests.support.fmu_faults import lines
from tests.support.stimuli import STIMULI


@pytest.mark.parametrize("name", STIMULI)
def test_it_gives_the_bits_of_the_build_of_fmi_2(fmu, name):
    stop, step, stimuli = STIMULI[name]
    time = np.arange(0.0, stop, step)
    inputs = {
        signal: mean + size * np.sin(speed * time)
        for signal, (mean, size, speed) in stimuli.items()
    }
    results = []
    for version in (2, 3):
        with Fmu(fmu(name, "native", version)) as instance:
            instance.start()
            results.append(simulate_instance(instance, time, inputs))
    assert results[0].keys() == results[1].keys()
    for output, values in results[0].items():
        np.testing.assert_array_equal(results[1][output], values)


@pytest.mark.parametrize("name", STIMULI)
def test_it_is_described_as_the_build_of_fmi_2(fmu, name):
    of_2, of_3 = (find_model(str(fmu(name, "native", version))) for version in (2, 3))
    for group in ("inputs", "outputs", "parameters"):
        assert getattr(of_3, group) == getattr(of_2, group)


@pytest.mark.parametrize("name", STIMULI)
def test_the_check_has_no_fault_to_tell_of(fmu, name):
    assert lines(check_fmu(fmu(name, "native", 3)), "error", "warning") == []


def test_its_equations_are_known_again(fmu):
    cls = component("ppy_actuator")
    assert find_model(str(fmu("ppy_actuator", "native", 3))).cls is not None
    stacked = stack(cls, *find_effects(cls, ["strain_saturation"], "ppy_actuator"))
    model = find_model(str(build_cached(stacked, "native", 3)))
    assert model.notes == ()
    assert model.cls is not None
    assert model.cls.layout.names == stacked.layout.names
