"""Response of a linear time-varying system to forcing, exact for straight lines within a step."""

from __future__ import annotations

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.identify import autoregression

_SAME = 1e-12  # relative: steps and matrices that differ by less are the same
_TERMS = 10  # of a Taylor series
_DEPENDENT = 1e6  # condition number of eigenvectors, above which they are not used
_SMALL = 0.5  # norm of a matrix, up to which that many terms suffice


class StepMatrices:
    """Matrices that take the states of ``dS/dt = A S + w`` from each sample to the next.

    Within a step A is constant and w a straight line, and the step is exact (Van Loan, IEEE Trans.
    Automatic Control 23, 1978): stiff parts do no harm.

    Parameters
    ----------
    begin, end : ndarray, shape (n, states, states)
        A at the begin and at the end of every step, of which the mean is taken; the last one is of
        no step.
    steps : ndarray, shape (n - 1,)
        Seconds.

    Attributes
    ----------
    transition, first, second : ndarray, shape (n - 1, states, states)
        exp(A h), h phi_1(A h) and h phi_2(A h).

    Raises
    ------
    UserError
        If the states grow beyond every number in one step.
    """

    def __init__(self, begin: Array, end: Array, steps: Array):
        a = 0.5 * (begin + end)[:-1]
        n = len(steps)
        self._is_constant = False
        if not a.shape[-1] or not n:
            self.transition = self.first = self.second = a
            return
        is_constant = np.ptp(a, axis=0).max() <= _SAME * np.abs(a).max()
        is_even = np.ptp(steps) <= 1e-9 * steps.max()
        self._is_constant = bool(is_constant and is_even)
        chosen, h = (a[:1], steps[:1]) if self._is_constant else (a, steps)
        h = h[:, np.newaxis, np.newaxis]
        with np.errstate(over="ignore", invalid="ignore"):
            matrices = _phi(chosen * h)
        if not np.isfinite(matrices).all():
            raise UserError(
                "the model is too unstable along its simulation: within one sample a change of a"
                " state grows beyond every number"
            )
        scaled = (matrices[0], h * matrices[1], h * matrices[2])
        self.transition, self.first, self.second = (np.broadcast_to(m, a.shape) for m in scaled)

    def response(self, begin: Array, end: Array) -> Array:
        """Return the states (n, states, k) under forcing, which start from zero.

        Parameters
        ----------
        begin, end : ndarray, shape (n, states, k)
            w at the begin and at the end of every step.
        """
        if not begin.size or len(begin) < 2:
            return np.zeros_like(begin)
        return self.driven((self.first - self.second) @ begin[:-1] + self.second @ end[:-1])

    def driven(self, drive: Array) -> Array:
        """Return the states (n, states, k) that start from zero.

        Parameters
        ----------
        drive : ndarray, shape (n - 1, states, k)
            What is added to them in every step.
        """
        if self._is_constant:
            modes = _independent_modes(self.transition[0])
            if modes is not None:
                return _response_of_modes(*modes, drive)
        states = np.zeros((len(drive) + 1, *drive.shape[1:]))
        for k, transition in enumerate(self.transition):
            np.matmul(transition, states[k], out=states[k + 1])
            states[k + 1] += drive[k]
        return states


def _independent_modes(transition: Array) -> tuple[Array, Array] | None:
    """Return eigenvalues and eigenvectors of a matrix; None if these are nearly dependent."""
    values, vectors = np.linalg.eig(transition)
    return (values, vectors) if np.linalg.cond(vectors) < _DEPENDENT else None


def _response_of_modes(values: Array, vectors: Array, drive: Array) -> Array:
    """Return states (n, states, k) from what is added to them (n - 1, states, k) in every step."""
    # of a pair of conjugate modes one tells the other
    one = values.imag >= 0.0
    both = np.where(values.imag > 0.0, 2.0, 1.0)[one]
    into_modes = np.linalg.inv(vectors)[one] @ drive
    moved = np.zeros((len(drive) + 1, *into_modes.shape[1:]), dtype=into_modes.dtype)
    for i, value in enumerate(values[one]):
        moved[1:, i] = autoregression([1.0, -value], into_modes[:, i])
    if np.isrealobj(moved):
        return np.asarray(vectors @ moved)
    out = vectors[:, one] * both
    return np.asarray(out.real @ moved.real - out.imag @ moved.imag)


def _phi(z: Array) -> tuple[Array, Array, Array]:
    """Return exp(z), phi_1(z) and phi_2(z) of matrices (n, m, m), by scaling and doubling.

    Source: Higham, Functions of Matrices, section 10.7.4.
    """
    norm = float(np.abs(z).sum(axis=-1).max(initial=0.0))
    doublings = max(int(np.ceil(np.log2(norm / _SMALL))), 0) if norm > 0.0 else 0
    x = z / 2.0**doublings
    one = np.eye(z.shape[-1])
    phi_2 = np.zeros_like(x) + one / (_TERMS + 2)
    for k in range(_TERMS + 1, 1, -1):
        # phi_2 = (1 + x / 3 (1 + x / 4 (...))) / 2
        phi_2 = (one + x @ phi_2) / k
    phi_1 = one + x @ phi_2
    phi_0 = one + x @ phi_1
    for _ in range(doublings):
        phi_2 = 0.25 * (phi_1 @ phi_1 + 2.0 * phi_2)
        phi_1 = 0.5 * (phi_0 + one) @ phi_1
        phi_0 = phi_0 @ phi_0
    return phi_0, phi_1, phi_2
