"""Claims: every instance hears its own messages, and fmpy still hears its own."""

from __future__ import annotations

import gc

import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException

from fmus.kit import UserError
from orchestration.fmu.instance import Fmu


def test_every_instance_hears_its_own_messages_and_fmpy_still_hears_its_own(fmu, capfd):
    path = fmu("ppy_actuator", "native")
    with Fmu(path, {"R1": -1.0}) as first, Fmu(path, {"C": -2.0}) as second:
        for instance in (second, first):
            with pytest.raises(UserError, match="initialization failed"):
                instance.start()
        assert "'R1' = -1" in first.complaints
        assert "R1" not in second.complaints
        assert "'C' = -2" in second.complaints
    del first, second, instance
    gc.collect()
    with pytest.raises(FMICallException):
        simulate_fmu(str(path), stop_time=1.0, start_values={"R2": -3.0})
    assert "'R2' = -3" in capfd.readouterr().out
