"""Identification of ARX, ARMAX, output-error and Box-Jenkins models (Ljung, chapter 7)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.black_box.data import InputOutputData, check_varies
from orchestration.identify.black_box.excitation import check_excitation
from orchestration.identify.black_box.gauss_newton import GaussNewtonMinimum, minimise
from orchestration.identify.black_box.models import PolynomialModel
from orchestration.identify.black_box.orders import Count, Orders, orders
from orchestration.identify.black_box.prediction_error import Coefficients, PredictionError
from orchestration.identify.black_box.result import Identification, Parameter
from orchestration.identify.black_box.start_values import least_squares, starts
from orchestration.identify.noise import Noise, fit_autoregression
from orchestration.identify.uncertainty import Covariance, parameter_covariance, sandwich_covariance

# If a linear estimate without the offset costs more than BIC grants an offset, times this factor,
# no search without it is made.
_HOPELESS = 10.0
# sum of the coefficients of A, relative to that of their absolute values, below which A has a root
# at one
_INTEGRATES = 1e-9


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
        If orders are impossible, samples too few, or an input is constant or does not excite the
        model.
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

    Standard errors allow for the colour of the residual; :func:`box_jenkins` makes use of it.

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
) -> Identification:
    """Identify ``y = sum_i B_i/F_i u_i + C/D e`` (thesis, eq. 3.14).

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


def identify(
    data: InputOutputData, structure: str, chosen: Orders, first: int = 0
) -> Identification:
    """Identify a polynomial model.

    Signals are taken as deviations from their means, and a constant is estimated with the
    parameters, because the mean of an output that has not settled is no operating point. Where BIC
    does not prefer it to the constant that makes the output zero where all inputs are, it is that
    one.

    Parameters
    ----------
    data : InputOutputData
    structure : str
        Name of the structure.
    chosen : Orders
    first : int
        First sample whose error counts, so that models of different orders are judged by the same
        samples.

    Returns
    -------
    Identification

    Raises
    ------
    UserError
        As of :func:`arx`.
    """
    check_varies(data)
    messages = check_excitation(data, tuple(chosen.excitation(i) for i in range(len(chosen.nb))))
    inputs = data.inputs - data.inputs.mean(axis=0)
    output = data.output - float(data.output.mean())
    problem = PredictionError(inputs, output, chosen, first)
    best = _search(problem)
    plain = PredictionError(data.inputs, data.output, chosen, first, offset=False)
    through_zero = _through_zero(plain, best, chosen.parameters)
    if through_zero is not None:
        return _result(data, structure, plain, through_zero, messages)
    return _result(data, structure, problem, best, messages)


def _search(problem: PredictionError) -> GaussNewtonMinimum:
    """Find the parameters with the least prediction errors, from all starting points."""
    if _is_linear(problem.orders):
        return _refined(problem, np.zeros(problem.size))
    searches = (minimise(problem, start) for start in starts(problem))
    return min(searches, key=lambda search: search.cost)


def _is_linear(chosen: Orders) -> bool:
    """Tell whether the prediction errors are linear in the parameters."""
    return not (chosen.nc or chosen.nd or any(chosen.nf))


def _refined(problem: PredictionError, theta: Array) -> GaussNewtonMinimum:
    """Return the minimum that a search from one starting point ends at."""
    if not _is_linear(problem.orders):
        return minimise(problem, theta)
    solution = least_squares(problem)
    e = problem.errors(solution)
    return GaussNewtonMinimum(solution, float(e @ e), True)


def _through_zero(
    plain: PredictionError, best: GaussNewtonMinimum, offset: int
) -> GaussNewtonMinimum | None:
    """Search without an offset; return None where BIC prefers one.

    Parameters
    ----------
    plain : PredictionError
        Without an offset.
    best : GaussNewtonMinimum
        With an offset.
    offset : int
        Index of the offset among its parameters.
    """
    start = np.delete(best.theta, offset)
    granted = np.log(plain.samples) / plain.samples
    e = plain.errors(start)
    slopes = plain.jacobian(start)
    linear = e - slopes @ np.linalg.lstsq(slopes, e, rcond=None)[0]
    if float(linear @ linear) > best.cost * np.exp(_HOPELESS * granted):
        return None
    refined = _refined(plain, start)
    return refined if refined.cost <= best.cost * np.exp(granted) else None


def _result(
    data: InputOutputData,
    structure: str,
    problem: PredictionError,
    best: GaussNewtonMinimum,
    messages: tuple[str, ...],
) -> Identification:
    """Assemble the result: model, standard errors, residual and messages."""
    count = problem.orders.parameters
    variance = best.cost / max(problem.samples - problem.size, 1)
    jacobian = problem.jacobian(best.theta)
    residual = problem.errors(best.theta)
    spread = _spread(problem, jacobian, residual, variance)
    model = _model(data, structure, problem, problem.coefficients(best.theta), variance)
    values = zip(problem.orders.names(), best.theta, spread.standard_errors, strict=False)
    return Identification(
        model=model,
        data=data,
        parameters=tuple(Parameter(name, float(x), float(s)) for name, x, s in values),
        covariance=spread.matrix[:count, :count],
        count=count + problem.offset,
        residual=residual,
        converged=best.converged,
        messages=(
            _describe_offset(model, problem.offset),
            *messages,
            *_doubts(model, best.converged),
        ),
    )


def _spread(
    problem: PredictionError, jacobian: Array, residual: Array, variance: float
) -> Covariance:
    """Return the covariance of the estimates (Ljung, section 9.4).

    Where the model has no noise model, it allows for the colour of the residual.
    """
    bread = parameter_covariance(jacobian.T @ jacobian)
    n = problem.orders
    if n.na or n.nc or n.nd:
        return replace(bread, matrix=variance * bread.matrix)
    coefficients, innovation_variance = fit_autoregression(residual)
    noise = Noise(coefficients, float(np.sqrt(innovation_variance)))
    return sandwich_covariance(bread, [jacobian], [noise])


def _model(
    data: InputOutputData,
    structure: str,
    problem: PredictionError,
    parts: Coefficients,
    variance: float,
) -> PolynomialModel:
    """Return the model with its operating point."""
    delays = problem.orders.nk
    mean = data.inputs.mean(axis=0)
    model = PolynomialModel(
        structure=structure,
        step=data.step,
        input_names=data.input_names,
        output_name=data.output_name,
        input_offsets=mean,
        output_offset=0.0,
        noise_variance=variance,
        orders=problem.orders,
        a=parts.a,
        b=tuple(np.concatenate([np.zeros(k), b]) for b, k in zip(parts.b, delays, strict=True)),
        c=parts.c,
        d=parts.d,
        f=parts.f,
    )
    if problem.offset:
        # the constant is that of the whole equation; the output's is the constant over A at rest
        gain = parts.a.sum()
        integrates = abs(gain) <= _INTEGRATES * np.abs(parts.a).sum()
        level = float(data.output.mean()) + (0.0 if integrates else parts.offset / gain)
        return replace(model, output_offset=level)
    static = model.static_output(mean)
    if np.isfinite(static):
        return replace(model, output_offset=static)
    return replace(model, input_offsets=0.0 * mean)


def _describe_offset(model: PolynomialModel, estimated: bool) -> str:
    """Describe the operating point about which the model is linear, and whence it is known."""
    text = model.describe_operating_point()
    return text if estimated else f"{text}, and zero where all inputs are, as far as the data tell"


def _doubts(model: PolynomialModel, converged: bool) -> list[str]:
    """Return messages on an unstable model and on a search that did not converge."""
    doubts = []
    if not model.is_stable():
        doubts.append("the model is unstable: a free run will not stay near the record")
    if not converged:
        doubts.append("the search used up its iterations; a lower order may do")
    return doubts
