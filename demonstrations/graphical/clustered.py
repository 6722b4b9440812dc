"""Covariance of parameters in noise of any kind, from stretches of a record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array, Indices
from orchestration.identify.uncertainty import Covariance

# highest leverage that is granted: a sample that is fitted exactly says nothing of its noise
_LEVERAGE = 0.9


def clustered_covariance(
    bread: Covariance, jacobian: Array, residual: Array, stretches: Indices
) -> Covariance:
    """Return the covariance of parameters from the influence of single stretches of a record.

    The residual may be coloured, of changing level or systematic: only its repetitions from stretch
    to stretch count as independent. Stretches have to be longer than its memory. Sources: CR2 of
    Bell and McCaffrey, Survey Methodology 28, 2002; Cameron and Miller, J. Human Resources 50,
    2015.

    Parameters
    ----------
    bread : Covariance
        Inverse of the normal matrix J'J that was fitted with.
    jacobian : ndarray, shape (m, p)
        Of the residual, weighted as it was fitted.
    residual : ndarray, shape (m,)
        Weighted alike.
    stretches : ndarray of int, shape (m,)
        Number of the stretch that a sample belongs to.

    Returns
    -------
    Covariance
    """
    middle = np.zeros_like(bread.matrix)
    for stretch in np.unique(stretches):
        within = stretches == stretch
        slopes = jacobian[within]
        errors = residual[within]
        frame, triangle = np.linalg.qr(slopes)
        leverage, directions = np.linalg.eigh(triangle @ bread.matrix @ triangle.T)
        # the fit has taken a part of a stretch out of its residual: (I - H)^(-1/2) restores it;
        # along each eigenvector of H it adds `growth` times the residual
        growth = 1.0 / np.sqrt(1.0 - np.clip(leverage, 0.0, _LEVERAGE)) - 1.0
        missing = directions @ (growth * (directions.T @ (frame.T @ errors)))
        score = slopes.T @ errors + triangle.T @ missing
        middle += np.outer(score, score)
    return replace(bread, matrix=bread.matrix @ middle @ bread.matrix)
