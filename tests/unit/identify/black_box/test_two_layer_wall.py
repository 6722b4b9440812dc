"""Claims: models of a measured record predict its second half as well as is known.

It has two inputs (DaISy).
"""

import numpy as np
import pytest

from orchestration.identify.black_box import (
    armax,
    arx,
    box_jenkins,
    input_output_data,
    output_error,
    state_space,
)
from tests.support.black_box import fit


@pytest.fixture(scope="module")
def halves(public_data):
    table = np.loadtxt(public_data("two_layer_wall.csv"), delimiter=",", skiprows=1)
    return input_output_data(
        table[:, 1:3], table[:, 3], 1.0, ["internal", "external"], "heat_flux"
    ).split()


def test_box_jenkins(halves):
    estimation, validation = halves
    result = box_jenkins(estimation, 2, 2, 2, 2, 0)
    assert result.model.fit(validation) >= 84.6
    # run on from the first half, without a look at the second
    inputs = np.vstack([estimation.inputs, validation.inputs])
    assert fit(validation.output, result.model.simulate(inputs)[len(estimation) :]) >= 84.6
    assert result.residual_tests().passed


def test_arx(halves):
    estimation, validation = halves
    assert arx(estimation, 3, 3, 0).model.fit(validation) == pytest.approx(80.0, abs=1.5)
    assert arx(estimation, 4, 4, 0).model.fit(validation) == pytest.approx(80.0, abs=1.5)


@pytest.mark.parametrize(
    "find",
    [
        lambda d: armax(d, 3, 3, 1, 0),
        lambda d: output_error(d, 2, 2, 0),
        lambda d: state_space(d, 3, 0),
    ],
    ids=["ARMAX", "OE", "SS"],
)
def test_the_other_structures(halves, find):
    estimation, validation = halves
    assert find(estimation).model.fit(validation) >= 84.6
