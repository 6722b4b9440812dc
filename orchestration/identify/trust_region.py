"""SciPy's least squares in a trust region, behind the face of `levenberg_marquardt.minimise`.

It costs several times as much, because every step decomposes the Jacobian, and ends in a better optimum where a search
starts far off and nothing else holds the parameters (docs/decisions/0014-one-fit.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from orchestration.identify.levenberg_marquardt import Minimum, residual_or_none

Array = NDArray[np.float64]
_ROUNDING = 1e-12  # relative change of the point, and size of the gradient, that ends a search


def minimise(
    residual: Callable[[Array], Array], jacobian: Callable[[Array], Array], q: Array, low: Array, high: Array,
    tolerance: float = 1e-6, trials: int = 200,
) -> Minimum:  # fmt: skip
    """Minimise a sum of squared residuals within bounds, as `levenberg_marquardt.minimise` does.

    Parameters
    ----------
    residual, jacobian, q, low, high, trials
        As there.
    tolerance : float
        Fall of the cost, relative to it, that ends the search.

    Returns
    -------
    Minimum

    Raises
    ------
    UserError
        If the residual raises it where the search starts.
    """
    nowhere = np.full(residual(q).size, np.inf)

    def finite(q: Array) -> Array:
        values = residual_or_none(residual, q)
        return nowhere if values is None else values

    solution = least_squares(
        finite, q, jacobian, (low, high), ftol=tolerance, xtol=_ROUNDING, gtol=_ROUNDING, max_nfev=trials
    )
    # it stays within the bounds by a rounding error
    ends = np.where(solution.active_mask < 0, low, high)
    return Minimum(np.where(solution.active_mask == 0, solution.x, ends), solution.success)
