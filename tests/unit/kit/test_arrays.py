"""Claims: the types of arrays are those that computations return; a function is run with one thread
for products of matrices, and as it is otherwise.

Oracle: what the libraries of linear algebra say of themselves.
"""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from fmus.kit import arrays
from fmus.kit.arrays import single_threaded


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


LIBRARIES = ThreadpoolController()  # NumPy has loaded its own


def threads() -> set[int]:
    return {library.num_threads for library in LIBRARIES.lib_controllers}


@single_threaded
def solve(a: np.ndarray, *, b: float) -> tuple[set[int], float]:
    """Solve ``a x = b``."""
    return threads(), float(np.linalg.solve(a, [b])[0])


def test_inside_there_is_one_thread_and_outside_what_there_was() -> None:
    with LIBRARIES.limit(limits=2):
        assert solve(np.array([[4.0]]), b=2.0) == ({1}, 0.5)
        assert threads() == {2}


def test_an_error_leaves_no_limit_behind() -> None:
    with LIBRARIES.limit(limits=2):
        with pytest.raises(np.linalg.LinAlgError):
            solve(np.zeros((1, 1)), b=1.0)
        assert threads() == {2}


def test_name_and_docstring_stay() -> None:
    assert (solve.__name__, solve.__doc__) == ("solve", "Solve ``a x = b``.")
