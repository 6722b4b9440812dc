"""Claims: the types of arrays are those that computations return."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from fmus.kit import arrays


@pytest.mark.parametrize(
    ("alias", "made"),
    [
        (arrays.Array, np.linspace(0.0, 1.0, 3)),
        (arrays.Mask, np.linspace(0.0, 1.0, 3) > 0.5),
        (arrays.Indices, np.flatnonzero([0, 1])),
    ],
)
def test_a_type_is_that_of_what_is_computed(alias, made):
    (element,) = get_args(get_args(alias)[1])
    assert made.dtype == element
