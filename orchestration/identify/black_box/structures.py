"""ARX, ARMAX, output-error and Box-Jenkins models by the prediction-error method (Ljung, chapter 7)."""

from __future__ import annotations

from orchestration.identify.black_box.data import InputOutputData
from orchestration.identify.black_box.estimation import identify
from orchestration.identify.black_box.orders import Count, orders
from orchestration.identify.black_box.result import Identification


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

    Standard errors allow for the colour of what is left; :func:`box_jenkins` makes use of it.

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
