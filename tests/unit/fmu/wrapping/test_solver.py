"""Claims: an FMU for model exchange alone is integrated with its events. Oracle: closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.fmu.simulation import RepeatedFmu
from tests.support import fmi3_fmus
from tests.support.archive import edited


def test_events_of_model_exchange_are_found(tmp_path):
    """A sawtooth, which falls at time events: its values and its count on paper."""

    def alone(name, contents):
        start, end = contents.find(b"<CoSimulation"), contents.find(b"/>", contents.find(b"<CoSim"))
        is_description = name == "modelDescription.xml"
        return name, contents[:start] + contents[end + 2 :] if is_description else contents

    path = edited(fmi3_fmus.foreign("sawtooth"), tmp_path / "alone.fmu", alone)
    time = 0.07 * np.arange(20)
    with RepeatedFmu(path) as fmu:
        found = fmu.run(time, {}, {"slope": 2.0}, ["x", "count"])
    assert found[:, 0] == pytest.approx(2.0 * (time % 0.3), abs=1e-5)
    assert found[:, 1].tolist() == (time // 0.3).tolist()
