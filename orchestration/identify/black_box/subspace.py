"""State-space models by a subspace method, past-output MOESP, with the Kalman gain that predicts best.

Sources: Verhaegen, Automatica 30 (1994); Ljung, System Identification, section 10.6; where the noise makes a model
unstable, Maciejowski, Systems & Control Letters 26 (1995).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.linalg import block_diag

from fmus.kit.errors import UserError
from orchestration.identify.black_box.data import InputOutputData, check_varies
from orchestration.identify.black_box.excitation import check_excitation
from orchestration.identify.black_box.models.state_space import (
    StateSpaceModel,
    free_responses,
    states,
)
from orchestration.identify.black_box.orders import Count, orders, whole
from orchestration.identify.black_box.polynomials import solved
from orchestration.identify.black_box.result import Identification
from orchestration.identify.black_box.search.kalman_gain import kalman_gain

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array, Array]  # A, B, C, D and K
_HORIZONS = (10, 20, 40)  # block rows, of which the best are kept; at least two more than the order
_COLUMNS = 4  # samples for each row of the data matrix, at least
_WORK = 5e8  # samples times rows squared, about a second of work


def state_space(data: InputOutputData, order: int, nk: Count = 1, first: int = 0) -> Identification:
    """Identify a state-space model in innovations form.

    Parameters
    ----------
    data : InputOutputData
    order : int
        States, at least 1, without those that keep delayed inputs.
    nk : int or sequence of int
        Delays in samples; an input with a delay of 0 acts directly on the output, too.
    first : int
        First sample whose error counts, so that models of different orders are judged by the same samples.

    Returns
    -------
    Identification
        Without parameters, because states have no coordinates of their own. Of several horizons of the method it is
        the one with the smallest prediction errors.

    Raises
    ------
    UserError
        If the order or a delay is impossible, samples too few, or an input is constant or does not excite the model.
    """
    order = whole("order", order, 1)
    delays = orders(data, nb=order, nk=nk, na=order).nk
    check_varies(data)
    weak = check_excitation(data, (2 * order,) * len(delays))
    about, level = data.inputs.mean(axis=0), float(data.output.mean())
    # an input that acts after one sample is what a state-space model has without more
    later = [max(delay - 1, 0) for delay in delays]
    u, y = _delayed(data.inputs - about, later), data.output - level
    begin = max(first, *later)
    found = []
    for horizon in _horizons(order, len(y), u.shape[1]):
        matrices, offset = _matrices(u, y, order, horizon, [delay == 0 for delay in delays])
        named = "SS", data.step, data.input_names, data.output_name
        model = StateSpaceModel(*named, about, level + offset, 1.0, *_with_delays(matrices, later))
        residual = model.prediction_errors(data)[begin:]
        found.append((float(residual @ residual), model, residual))
    _, model, residual = min(found, key=lambda candidate: candidate[0])
    count = order * (2 + len(delays)) + delays.count(0) + 1
    variance = float(residual @ residual) / max(len(residual) - count, 1)
    model = replace(model, noise_variance=variance)
    at = ", ".join(f"{name} = {x:.6g}" for name, x in zip(model.input_names, about, strict=True))
    messages = [
        f"offset: the model is about {model.output_name} = {model.output_offset:.6g} at {at}",
        *weak,
    ]
    if not model.is_stable():
        messages.append("the model is unstable: a free run will not stay near the record")
    return Identification(model, data, (), np.empty((0, 0)), count, residual, True, tuple(messages))


def _delayed(u: Array, lags: list[int]) -> Array:
    """Every input so many samples later, held at its first value before."""
    held = [
        np.concatenate([np.full(lag, column[0]), column])[: len(u)]
        for column, lag in zip(u.T, lags, strict=True)
    ]
    return np.stack(held, axis=1)


def _horizons(order: int, samples: int, inputs: int) -> Iterator[int]:
    least = order + 2
    longest = samples // (_COLUMNS * 2 * (inputs + 1))
    if longest < least:
        raise UserError(
            f"{samples} samples are too few for {order} states and {inputs} inputs: "
            f"at least {_COLUMNS * 2 * (inputs + 1) * least} are needed"
        )
    longest = min(longest, max(least, int((_WORK / samples) ** 0.5) // (2 * (inputs + 1))))
    yield from sorted({min(max(least, horizon), longest) for horizon in _HORIZONS})


def _observability(u: Array, y: Array, order: int, horizon: int) -> Array:
    """Extended observability matrix (horizon, order) of future outputs, along future inputs, from past data.

    One QR factorisation holds all of it (Verhaegen, 1994).
    """
    inputs = np.stack([sliding_window_view(column, 2 * horizon) for column in u.T], axis=1)
    outputs = sliding_window_view(y, 2 * horizon)
    future, past = (
        part.reshape(len(outputs), -1) for part in (inputs[:, :, horizon:], inputs[:, :, :horizon])
    )
    # with the ones goes what is constant: the mean of a record that is under way is no operating point
    rows = [np.ones((len(outputs), 1)), future, past, outputs]
    triangle = np.asarray(np.linalg.qr(np.hstack(rows), mode="r")).T
    first = 1 + future.shape[1]
    last = first + past.shape[1] + horizon
    left, singular, _ = np.linalg.svd(triangle[last:, first:last], full_matrices=False)
    return np.asarray(left[:, :order] * np.sqrt(singular[:order]), dtype=np.float64)


def _matrices(
    u: Array, y: Array, order: int, horizon: int, direct: list[bool]
) -> tuple[Matrices, float]:
    """A, B, C, D and K, and the offset of the output."""
    gamma = _observability(u, y, order, horizon)
    a, c = solved(gamma[:-1], gamma[1:]), gamma[0]
    if np.abs(np.linalg.eigvals(a)).max() >= 1.0:
        # as if nothing were to be seen after the horizon, which no unstable state would agree with
        a = solved(gamma, np.vstack([gamma[1:], np.zeros(order)]))
    # with A and C, the simulation is linear in B, D, the offset and the initial state
    paths = [states(a.T, np.outer(column, c), np.zeros(order)) for column in u.T]
    through = u[:, np.flatnonzero(direct)]
    columns = np.hstack([*paths, through, np.ones((len(y), 1)), free_responses(a, c, len(y))])
    solution = solved(columns, y)
    size = order * len(paths)
    b, d = solution[:size].reshape(len(paths), order).T, np.zeros(len(paths))
    d[np.flatnonzero(direct)] = solution[size : size + through.shape[1]]
    offset = float(solution[size + through.shape[1]])
    return (a, b, c, d, kalman_gain(a, c, y - columns @ solution)), offset


def _with_delays(matrices: Matrices, later: list[int]) -> Matrices:
    """Keep inputs in shift registers for as many samples as they act later."""
    a, b, c, d, k = matrices
    kept = [np.eye(r, k=-1) for r in later if r]
    if not kept:
        return matrices
    n, size = len(a), sum(later)
    whole, entry = block_diag(a, *kept), np.zeros((n + size, b.shape[1]))
    at = n
    for i, r in enumerate(later):
        if r:
            whole[:n, at + r - 1], entry[at, i] = b[:, i], 1.0
            at += r
        else:
            entry[:n, i] = b[:, i]
    return whole, entry, np.r_[c, np.zeros(size)], d, np.r_[k, np.zeros(size)]
