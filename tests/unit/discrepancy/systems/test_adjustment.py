"""Parameters of an FMU whose equations nobody knows, and how uncertain they are."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.systems.adjustment import ParameterSearch
from orchestration.discrepancy.systems.cut import isolated_members
from orchestration.discrepancy.systems.member import choose_interpolation, opened
from orchestration.system import read_system_record
from tests.support.system.lags import lags


def test_the_error_of_a_parameter_is_that_of_the_best_point_whatever_was_tried_after_it(tmp_path):
    system = lags(tmp_path, 0.0, a=1.4)
    record, measured = read_system_record(tmp_path / "record.csv", system, {})
    isolated = isolated_members(system, measured, {})[0]
    with opened(isolated, record.time, 50, lambda used: None) as simulation:
        choose_interpolation(simulation, {})
        search = ParameterSearch(simulation, simulation.simulate({}))
        search.names = ["tau"]
        search.fit(search.start)
        error, best = search.standard_errors(), search.values(search.best.q)
        simulation.simulate({"tau": 20.0})
        search._rows(search.start + 3.0)
        assert search.standard_errors() == error
        # white noise of 0.003, and the slope by the logarithm of tau at the best point
        up, down = (
            simulation.simulate({"tau": best["tau"] * np.exp(sign * 0.01)})["x"]
            for sign in (1.0, -1.0)
        )
        slope = (up - down) / 0.02
        assert best["tau"] == pytest.approx(1.4, rel=0.01)
        assert error[0] == pytest.approx(0.003 / np.sqrt(slope @ slope), rel=0.1)
