"""Persistence of excitation: the number of parameters of its path that an input can determine.

Sources: thesis, eq. 3.16; Ljung, section 13.2.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.identify.black_box.data import InputOutputData

# Singular values, relative to the largest, that do not count: the cut-off of the thesis, section
# 3.3.2, and values that only rounding keeps from zero.
CUTOFF = 0.01
SINGULAR = 1e-9
_HIGHEST = 50  # default order of the autocovariance matrix


def autocovariance_matrix(values: ArrayLike, order: int) -> Array:
    """Return R_n of eq. 3.16 of the thesis, (order, order), in the unit of the values squared.

    The mean is subtracted. Expectations are means over the samples for which all delayed samples
    are on record, so that the matrix of a sum of k sinusoids has rank 2k even in a short record. In
    the limit of a long record it is the equation's Toeplitz matrix.

    Parameters
    ----------
    values : array_like, shape (n,)
    order : int
        At most half as many as samples.

    Raises
    ------
    UserError
        If there are too few samples.
    """
    u = np.asarray(values, dtype=np.float64)
    if u.ndim != 1 or not 1 <= order <= u.size // 2:
        raise UserError(f"order = {order}: must be from 1 to half of the {u.size} samples")
    delayed = sliding_window_view(u, order)
    delayed = delayed - delayed.mean(axis=0)
    return delayed.T @ delayed / len(delayed)


def pexcit(values: ArrayLike, cutoff: float = CUTOFF, highest: int | None = None) -> int:
    """Return the order to which a signal excites persistently, as the thesis computes it.

    Parameters
    ----------
    values : array_like, shape (n,)
        In any unit.
    cutoff : float
        Singular values of the autocovariance matrix count that are above this share of the largest.
    highest : int, optional
        Order of the matrix, and so the highest that can be found; by default 50, or a third of the
        samples if less.

    Returns
    -------
    int
        0 for a constant.

    Raises
    ------
    UserError
        If the cut-off is not between 0 and 1, or there are too few samples.
    """
    if not 0.0 < cutoff < 1.0:
        raise UserError(f"cutoff = {cutoff:g}: must be between 0 and 1")
    u = np.asarray(values, dtype=np.float64)
    size = max(1, min(_HIGHEST, u.size // 3)) if highest is None else highest
    spread = float(np.ptp(u)) if u.size else 1.0
    if spread == 0.0:
        return 0
    singular = np.linalg.svd(autocovariance_matrix(u / spread, size), compute_uv=False)
    return int(np.count_nonzero(singular > cutoff * singular[0]))


def check_excitation(data: InputOutputData, needed: tuple[int, ...]) -> tuple[str, ...]:
    """Check that every input excites persistently to the order that a model needs.

    Parameters
    ----------
    data : InputOutputData
    needed : tuple of int, length m
        Order to which every input must excite.

    Returns
    -------
    tuple of str
        A line for every input that excites the model weakly: to less than is needed, by the cut-off
        of the thesis.

    Raises
    ------
    UserError
        If an input does not excite the model: its matrix is singular.
    """
    weak = []
    for name, values, order in zip(data.input_names, data.inputs.T, needed, strict=True):
        highest = max(order, min(_HIGHEST, len(data) // 3))
        possible = pexcit(values, SINGULAR, highest)
        if possible < order:
            raise UserError(
                f"input {name} is persistently exciting of order {possible} only, and the orders"
                f" ask for {order}: lower them (nb + nf, or nb + na), or excite with more"
                " frequencies"
            )
        strong = pexcit(values, CUTOFF, highest)
        if strong < order:
            weak.append(
                f"input {name} excites weakly: to order {strong} where singular values below"
                f" {CUTOFF:g} of the largest do not count, and the orders ask for {order}"
            )
    return tuple(weak)
