"""Claims: records share parameters, and have those of each and start states by themselves.

Oracles: least squares of all records in one matrix; an exponential on paper.
"""

import numpy as np
import pytest

from orchestration.identify.fitting import FitData
from tests.support.linear_fits import Decay, columns, fitted, noisy, plane_data


def test_records_share_what_is_not_of_each():
    one, other = columns(40, 1), columns(70, 2)
    ys = [noisy(one, [2.0, -1.0, 0.5], 3), noisy(other, [2.0, -1.0, -0.8], 4)]
    data = [plane_data(one, ys[0], "one"), plane_data(other, ys[1], "other")]
    fit = fitted(data, each=("c",))
    offsets = np.zeros((110, 2))
    offsets[:40, 0] = offsets[40:, 1] = 1.0
    x = np.column_stack([np.vstack([one, other])[:, :2], offsets])
    expected = np.linalg.lstsq(x, np.concatenate(ys))[0]
    assert [*fit.values] == ["a", "b", "c@one", "c@other"]
    assert [*fit.values.values()] == pytest.approx(expected, rel=1e-7)
    assert fit.values_of("other")["c"] == fit.values["c@other"]


def test_start_states_are_of_each_record():
    time = np.linspace(0.0, 3.0, 50)
    data = [FitData(time, {}, {"y": k * np.exp(-0.7 * time)}, f"r{k}") for k in (1.0, 2.0, 5.0)]
    start = Decay.layout.start_of["x"]
    fit = fitted(data, ["rate", start], Decay)
    assert fit.values == pytest.approx(
        {"rate": 0.7, f"{start}@r1.0": 1.0, f"{start}@r2.0": 2.0, f"{start}@r5.0": 5.0}, rel=1e-6
    )
