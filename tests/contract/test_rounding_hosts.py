"""Hosts add up their steps: what that rounds must not count against them."""

from __future__ import annotations

import fmpy
import pytest

from tests.support import hosts


def test_a_host_that_adds_up_steps_reaches_its_stop_time(fmu, runtime):
    step, stop = 0.1, 2000.0
    with hosts.extracted(fmu("ppy_actuator", runtime)) as folder:
        model = hosts.slave(folder)
        model.instantiate()
        model.setupExperiment(startTime=0.0, stopTime=stop)
        model.enterInitializationMode()
        model.exitInitializationMode()
        time = 0.0
        for _ in range(round(stop / step)):
            model.doStep(time, step)
            time += step
        assert time != stop
        with pytest.raises(Exception, match="fmi2DoStep"):
            model.doStep(time, step)
        model.terminate()
        model.fmi2FreeInstance(model.component)


def test_a_state_that_is_an_output_follows_its_own_seed(fmu):
    with hosts.extracted(fmu("ppy_actuator", "native")) as folder:
        model = hosts.slave(folder)
        model.instantiate()
        model.setupExperiment(startTime=0.0)
        model.enterInitializationMode()
        model.exitInitializationMode()
        described = fmpy.read_model_description(folder).modelVariables
        charge = next(v.valueReference for v in described if v.name == "charge")
        assert model.getDirectionalDerivative([charge], [charge], [2.5]) == [2.5]
        model.terminate()
        model.fmi2FreeInstance(model.component)
