"""Identification of ARX, ARMAX, output-error and Box-Jenkins models (Ljung, chapter 7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array, single_threaded
from orchestration.identify.black_box.data import InputOutputData, check_varies
from orchestration.identify.black_box.excitation import check_excitation
from orchestration.identify.black_box.models import PolynomialModel
from orchestration.identify.black_box.orders import Count, Orders, orders
from orchestration.identify.black_box.polynomials import integrates
from orchestration.identify.black_box.prediction_error import Coefficients, PredictionError
from orchestration.identify.black_box.result import Identification, Parameter
from orchestration.identify.black_box.search import Optimum, optimum, refine
from orchestration.identify.noise import fit_autoregression
from orchestration.identify.uncertainty import Covariance, parameter_covariance, sandwich_covariance

# A model without an offset is not searched if it costs more than so many times what BIC grants for
# one parameter.
_HOPELESS_PENALTIES = 10.0
_NOT_CONVERGED = "the search used up its iterations; a lower order may do"
_THROUGH_ZERO = ", and zero where all inputs are, as far as the data tell"


def arx(data: InputOutputData, na: int, nb: Count, nk: Count = 1) -> Identification:
    """Identify ``A y = sum_i B_i u_i + e`` by least squares.

    Parameters
    ----------
    data : InputOutputData
    na : int
        Order of A.
    nb : int or sequence of int
        Coefficients of every B, at least 1; one number is that of all inputs.
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


@single_threaded
def identify(
    data: InputOutputData,
    structure: str,
    chosen: Orders,
    first: int = 0,
    contained: Sequence[Identification] = (),
) -> Identification:
    """Identify a polynomial model.

    Signals are taken as deviations from their means, and a constant is estimated with the
    parameters, because the mean of an output that still drifts is no operating point. Unless BIC
    prefers an estimated constant, the output is zero where all inputs are.

    Parameters
    ----------
    data : InputOutputData
    structure : str
        Name of the structure.
    chosen : Orders
    first : int
        First sample whose error counts, so that models of different orders are judged by the same
        samples.
    contained : sequence of Identification
        Models nested in this one, of the same data and samples; its loss is not above any of
        theirs.

    Returns
    -------
    Identification

    Raises
    ------
    UserError
        As of :func:`arx`.
    """
    check_varies(data)
    messages = check_excitation(data, chosen.excitation)
    inputs = data.inputs - data.inputs.mean(axis=0)
    output = data.output - float(data.output.mean())
    problem = PredictionError(inputs, output, chosen, first)
    known = [_as_optimum(smaller) for smaller in contained]
    best = optimum(problem, known)
    without_offset = PredictionError(data.inputs, data.output, chosen, first, offset=False)
    through_zero = _search_without_offset(without_offset, best, known)
    if through_zero is not None:
        return _assemble(data, structure, without_offset, through_zero, messages)
    return _assemble(data, structure, problem, best, messages)


def _as_optimum(identification: Identification) -> Optimum:
    """Return an identified polynomial model as an optimum of the search."""
    model = identification.model
    assert isinstance(model, PolynomialModel)
    return Optimum(
        orders=model.orders,
        parts=model.coefficients,
        cost=float(identification.residual @ identification.residual),
        converged=identification.converged,
    )


def _search_without_offset(
    without_offset: PredictionError, best: Optimum, contained: Sequence[Optimum]
) -> Optimum | None:
    """Return the optimum without an offset; None if BIC prefers an offset.

    None, too, if a nested model with an estimated offset would then be better than this one.

    Parameters
    ----------
    without_offset : PredictionError
        Without an offset.
    best : Optimum
        With an offset.
    contained : sequence of Optimum
    """
    # BIC per sample is log V + d log(N) / N: the loss may rise by this factor for a parameter less
    penalty = np.log(without_offset.samples) / without_offset.samples
    hopeless = best.cost * np.exp(_HOPELESS_PENALTIES * penalty)
    through_zero = refine(without_offset, best.parts, hopeless)
    limits = [smaller.cost for smaller in contained if smaller.cost >= best.cost]
    limit = min([best.cost * np.exp(penalty), *limits])
    return through_zero if through_zero and through_zero.cost <= limit else None


def _assemble(
    data: InputOutputData,
    structure: str,
    problem: PredictionError,
    best: Optimum,
    messages: tuple[str, ...],
) -> Identification:
    """Return the result at an optimum: model, standard errors, residual and messages."""
    count = problem.orders.parameters
    variance = best.cost / max(problem.samples - problem.size, 1)
    theta = problem.vector(best.parts)
    jacobian = problem.jacobian(theta)
    residual = problem.errors(theta)
    covariance = _estimate_covariance(problem, jacobian, residual, variance)
    model = _make_model(data, structure, problem, best.parts, variance)
    values = zip(problem.orders.names(), theta, covariance.standard_errors, strict=False)
    return Identification(
        model=model,
        data=data,
        parameters=tuple(Parameter(name, float(x), float(s)) for name, x, s in values),
        covariance=covariance.matrix[:count, :count],
        count=count + problem.offset,
        residual=residual,
        converged=best.converged,
        messages=(
            model.describe_operating_point() + ("" if problem.offset else _THROUGH_ZERO),
            *messages,
            *model.describe_instability(),
            *([] if best.converged else [_NOT_CONVERGED]),
        ),
    )


def _estimate_covariance(
    problem: PredictionError, jacobian: Array, residual: Array, variance: float
) -> Covariance:
    """Return the covariance of all estimates (Ljung, section 9.4).

    Where the model has no noise model, it allows for the colour of the residual.
    """
    bread = parameter_covariance(jacobian.T @ jacobian)
    if problem.orders.has_noise_model:
        return replace(bread, matrix=variance * bread.matrix)
    return sandwich_covariance(bread, [jacobian], [fit_autoregression(residual)])


def _make_model(
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
        above = 0.0 if integrates(parts.a) else parts.offset / float(parts.a.sum())
        return replace(model, output_offset=float(data.output.mean()) + above)
    static = model.static_output(mean)
    if np.isfinite(static):
        return replace(model, output_offset=static)
    return replace(model, input_offsets=0.0 * mean)
