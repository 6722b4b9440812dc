"""A file with two inputs and one output, and the model that is identified from it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import orchestration as ppy

STEP = 0.5


@pytest.fixture(scope="package")
def signals():
    """Return inputs (600, 2) and the output (600,) of two paths, with little noise."""
    rng = np.random.default_rng(1)
    u = np.column_stack([rng.normal(size=600), 3.0 + rng.normal(size=600)])
    # two denominators; one input is felt at once, the other two samples late
    y = lfilter([0.4, 0.5], [1.0, -0.8], u[:, 0]) + lfilter(
        [0.0, 0.0, 0.2, 0.1], [1.0, -1.2, 0.5], u[:, 1]
    )
    return u, y + 0.01 * rng.normal(size=600)


@pytest.fixture(scope="package")
def file(signals, tmp_path_factory):
    path = tmp_path_factory.mktemp("black_box") / "two inputs.csv"
    u, y = signals
    table = np.column_stack([STEP * np.arange(600), u, y])
    np.savetxt(
        path, table, delimiter=",", header="time [s],drive [V],for [N],lambda [mm]", comments=""
    )
    return path


@pytest.fixture(scope="package")
def found(file):
    return ppy.black_box(
        file, "lambda", structures=["OE"], path_orders=[1, 2], noise_orders=[1], delays=[0, 2]
    )
