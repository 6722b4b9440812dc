"""ARX, ARMAX, output-error and Box-Jenkins models by the prediction-error method (Ljung, chapter 7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.black_box.data import InputOutputData, check_varies
from orchestration.identify.black_box.excitation import check_excitation
from orchestration.identify.black_box.orders import Count, Orders, orders
from orchestration.identify.black_box.polynomial_model import PolynomialModel
from orchestration.identify.black_box.prediction_error import PredictionError
from orchestration.identify.black_box.result import Identification, Parameter
from orchestration.identify.black_box.search import Minimum, minimise
from orchestration.identify.black_box.start_values import least_squares, starts
from orchestration.identify.covariance import covariance

Array = NDArray[np.float64]
_HOPELESS = 10.0  # times what BIC grants an offset: if a linear estimate costs more without it, no search is made
_INTEGRATES = 1e-9  # of its coefficients: an A whose sum is less has a root at one


def arx(data: InputOutputData, na: int, nb: Count, nk: Count = 1) -> Identification:
    """Identify ``A y = sum_i B_i u_i + e`` by least squares.

    Parameters
    ----------
    data : InputOutputData
    na : int
        Order of A.
    nb : int or sequence of int
        Coefficients of every B, at least 1; one number stands for all inputs.
    nk : int or sequence of int
        Delays in samples, at least 0.

    Returns
    -------
    Identification

    Raises
    ------
    UserError
        If orders are impossible, samples too few, or an input is constant or does not excite the model.
    """
    return identify(data, "ARX", orders(data, nb, nk, na=na))


def armax(data: InputOutputData, na: int, nb: Count, nc: int, nk: Count = 1) -> Identification:
    """Identify ``A y = sum_i B_i u_i + C e``.

    Parameters
    ----------
    data, na, nb, nk
        As of :func:`arx`.
    nc : int
        Order of C.

    Returns
    -------
    Identification

    Raises
    ------
    UserError
        As of :func:`arx`.
    """
    return identify(data, "ARMAX", orders(data, nb, nk, na=na, nc=nc))


def output_error(data: InputOutputData, nb: Count, nf: Count, nk: Count = 1) -> Identification:
    """Identify ``y = sum_i B_i/F_i u_i + e``.

    Standard errors hold for white noise; see :func:`box_jenkins` for any other.

    Parameters
    ----------
    data, nb, nk
        As of :func:`arx`.
    nf : int or sequence of int
        Order of every F.

    Returns
    -------
    Identification

    Raises
    ------
    UserError
        As of :func:`arx`.
    """
    return identify(data, "OE", orders(data, nb, nk, nf=nf))


def box_jenkins(
    data: InputOutputData, nb: Count, nf: Count, nc: int, nd: int, nk: Count = 1
) -> Identification:  # fmt: skip
    """Identify ``y = sum_i B_i/F_i u_i + C/D e``, every path with a denominator of its own (thesis, eq. 3.14).

    Parameters
    ----------
    data, nb, nk
        As of :func:`arx`.
    nf : int or sequence of int
        Order of every F.
    nc, nd : int
        Orders of C and D.

    Returns
    -------
    Identification

    Raises
    ------
    UserError
        As of :func:`arx`.
    """
    return identify(data, "BJ", orders(data, nb, nk, nf=nf, nc=nc, nd=nd))


def identify(data: InputOutputData, structure: str, wanted: Orders, first: int = 0) -> Identification:
    """Identify a polynomial model.

    Signals are taken as deviations from their means, and a constant is estimated with the parameters, because the mean
    of an output that is still under way is no operating point. Where BIC does not tell the constant from one that makes
    the output zero where all inputs are, it is that one.

    Parameters
    ----------
    data : InputOutputData
    structure : str
        What the model is called.
    wanted : Orders
    first : int
        First sample whose error counts, so that models of different orders are judged by the same samples.

    Returns
    -------
    Identification

    Raises
    ------
    UserError
        As of :func:`arx`.
    """
    check_varies(data)
    messages = check_excitation(data, tuple(wanted.excitation(i) for i in range(len(wanted.nb))))
    about = data.inputs.mean(axis=0), float(data.output.mean())
    problem = PredictionError(data.inputs - about[0], data.output - about[1], wanted, first)
    found = _search(problem)
    plain = PredictionError(data.inputs, data.output, wanted, first, offset=False)
    if (through_zero := _through_zero(plain, found, wanted.parameters)) is not None:
        return _result(data, structure, plain, through_zero, (np.zeros(len(about[0])), 0.0), messages)
    return _result(data, structure, problem, found, about, messages)


def _through_zero(plain: PredictionError, found: Minimum, offset: int) -> Minimum | None:
    """Search without the offset, which is at that place of the parameters; None where BIC wants it."""
    start, worth = np.delete(found.theta, offset), np.log(plain.samples) / plain.samples
    e, slopes = plain.errors(start), plain.jacobian(start)
    near = e - slopes @ np.linalg.lstsq(slopes, e, rcond=None)[0]
    if float(near @ near) > found.cost * np.exp(_HOPELESS * worth):
        return None
    refined = _refined(plain, start)
    return refined if refined.cost <= found.cost * np.exp(worth) else None


def _is_linear(wanted: Orders) -> bool:
    return not (wanted.nc or wanted.nd or any(wanted.nf))


def _refined(problem: PredictionError, theta: Array) -> Minimum:
    if not _is_linear(problem.orders):
        return minimise(problem, theta)
    solution = least_squares(problem)
    e = problem.errors(solution)
    return Minimum(solution, float(e @ e), True)


def _search(problem: PredictionError) -> Minimum:
    if _is_linear(problem.orders):
        return _refined(problem, np.zeros(problem.size))
    return min((minimise(problem, start) for start in starts(problem)), key=lambda found: found.cost)


def _result(
    data: InputOutputData, structure: str, problem: PredictionError, found: Minimum, about: tuple[Array, float],
    messages: tuple[str, ...],
) -> Identification:  # fmt: skip
    wanted, parts = problem.orders, problem.coefficients(found.theta)
    variance = found.cost / max(problem.samples - problem.size, 1)
    jacobian = problem.jacobian(found.theta)
    spread = covariance(jacobian.T @ jacobian)
    p = wanted.parameters
    errors = np.sqrt(variance) * spread.standard_errors
    # the constant is that of the whole equation; the output's is what A makes of it
    gain = parts.a.sum()
    level = parts.offset / gain if abs(gain) > _INTEGRATES * np.abs(parts.a).sum() else 0.0
    inputs, output = about[0], about[1] + level
    numerators = tuple(np.concatenate([np.zeros(k), b]) for b, k in zip(parts.b, wanted.nk, strict=True))
    model = PolynomialModel(
        structure, data.step, data.input_names, data.output_name, inputs, output, variance, wanted,
        parts.a, numerators, parts.c, parts.d, parts.f,
    )  # fmt: skip
    values = zip(wanted.names(), found.theta, errors, strict=False)
    return Identification(
        model, data, tuple(Parameter(name, float(x), float(s)) for name, x, s in values),
        variance * spread.matrix[:p, :p], p + problem.offset, problem.errors(found.theta), found.converged,
        (*_offsets(model), *messages, *_doubts(model, found)),
    )  # fmt: skip


def _offsets(model: PolynomialModel) -> list[str]:
    if not model.output_offset and not model.input_offsets.any():
        return [f"no offset: {model.output_name} is zero where all inputs are, as far as the data tell"]
    at = ", ".join(f"{name} = {x:.6g}" for name, x in zip(model.input_names, model.input_offsets, strict=True))
    return [f"offset: the model is about {model.output_name} = {model.output_offset:.6g} at {at}"]


def _doubts(model: PolynomialModel, found: Minimum) -> list[str]:
    doubts = [] if model.is_stable() else ["the model is unstable: a free run will not stay near the record"]
    return doubts if found.converged else [*doubts, "the search used up its iterations; a lower order may do"]
