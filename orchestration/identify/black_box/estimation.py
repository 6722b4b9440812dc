"""Identification of a polynomial model of any structure: the search, the offset, and what is told of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.black_box.data import InputOutputData, check_varies
from orchestration.identify.black_box.excitation import check_excitation
from orchestration.identify.black_box.models.polynomial import PolynomialModel
from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.prediction_error import Coefficients, PredictionError
from orchestration.identify.black_box.result import Identification, Parameter
from orchestration.identify.black_box.search.gauss_newton import Minimum, minimise
from orchestration.identify.black_box.search.start_values import least_squares, starts
from orchestration.identify.covariance import Covariance, covariance, sandwich
from orchestration.identify.noise.autoregression import autoregression
from orchestration.identify.noise.model import Noise

Array = NDArray[np.float64]
_HOPELESS = 10.0  # times what BIC grants an offset: if a linear estimate costs more without it, no search is made
_INTEGRATES = 1e-9  # of its coefficients: an A whose sum is less has a root at one


def identify(
    data: InputOutputData, structure: str, wanted: Orders, first: int = 0
) -> Identification:
    """Identify a polynomial model.

    Signals are taken as deviations from their means, and a constant is estimated with the parameters, because the mean
    of an output that is still under way is no operating point. Where BIC does not tell the constant from the one that
    makes the output zero where all inputs are, it is that one.

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
        return _result(data, structure, plain, through_zero, messages)
    return _result(data, structure, problem, found, messages)


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
    return min(
        (minimise(problem, start) for start in starts(problem)), key=lambda found: found.cost
    )


def _result(
    data: InputOutputData,
    structure: str,
    problem: PredictionError,
    found: Minimum,
    messages: tuple[str, ...],
) -> Identification:
    wanted, p = problem.orders, problem.orders.parameters
    variance = found.cost / max(problem.samples - problem.size, 1)
    jacobian = problem.jacobian(found.theta)
    residual = problem.errors(found.theta)
    spread = _spread(problem, jacobian, residual, variance)
    model = _model(data, structure, problem, problem.coefficients(found.theta), variance)
    values = zip(wanted.names(), found.theta, spread.standard_errors, strict=False)
    return Identification(
        model,
        data,
        tuple(Parameter(name, float(x), float(s)) for name, x, s in values),
        spread.matrix[:p, :p],
        p + problem.offset,
        residual,
        found.converged,
        (_offset(model, problem.offset), *messages, *_doubts(model, found)),
    )


def _spread(
    problem: PredictionError, jacobian: Array, residual: Array, variance: float
) -> Covariance:
    """Covariance of the estimates (Ljung, section 9.4); where no noise is modelled, of noise as coloured as is left."""
    bread, n = covariance(jacobian.T @ jacobian), problem.orders
    if n.na or n.nc or n.nd:
        return replace(bread, matrix=variance * bread.matrix)
    coefficients, innovation = autoregression(residual)
    return sandwich(bread, [jacobian], [Noise(coefficients, float(np.sqrt(innovation)))])


def _model(
    data: InputOutputData,
    structure: str,
    problem: PredictionError,
    parts: Coefficients,
    variance: float,
) -> PolynomialModel:
    delays = problem.orders.nk
    b = tuple(np.concatenate([np.zeros(k), b]) for b, k in zip(parts.b, delays, strict=True))
    named = structure, data.step, data.input_names, data.output_name
    mean = data.inputs.mean(axis=0)
    model = PolynomialModel(
        *named, mean, 0.0, variance, problem.orders, parts.a, b, parts.c, parts.d, parts.f
    )
    if problem.offset:
        # the constant is that of the whole equation; the output's is what A makes of it
        gain = parts.a.sum()
        integrates = abs(gain) <= _INTEGRATES * np.abs(parts.a).sum()
        return replace(
            model,
            output_offset=float(data.output.mean()) + (0.0 if integrates else parts.offset / gain),
        )
    level = model.static_output(mean)
    return (
        replace(model, output_offset=level)
        if np.isfinite(level)
        else replace(model, input_offsets=0.0 * mean)
    )


def _offset(model: PolynomialModel, estimated: bool) -> str:
    at = ", ".join(
        f"{name} = {x:.6g}" for name, x in zip(model.input_names, model.input_offsets, strict=True)
    )
    said = f"offset: the model is about {model.output_name} = {model.output_offset:.6g} at {at}"
    return said if estimated else f"{said}, and zero where all inputs are, as far as the data tell"


def _doubts(model: PolynomialModel, found: Minimum) -> list[str]:
    doubts = (
        []
        if model.is_stable()
        else ["the model is unstable: a free run will not stay near the record"]
    )
    return (
        doubts
        if found.converged
        else [*doubts, "the search used up its iterations; a lower order may do"]
    )
