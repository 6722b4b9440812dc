"""The local polynomial method: frequency responses from spectra, line by line, with covariance.

Around a line k the spectrum of an output is ``Y(l) = sum_i G_i(l) U_i(l) + T(l) + V(l)``: responses
G and the transient T, which is the leakage of a record that does not end as it begins, are smooth
in l, and V is noise. Terms of both are found by least squares over the lines near k (Pintelon and
Schoukens, chapter 7; Schoukens et al., 2009). The terms are 1, r, r**2/l and r**3/l**2 with
r = l - k, which span 1, l, 1/l and 1/l**2: far from zero as good as a polynomial of the third
order, and near zero right for an integrator and good for a slow pole, for which a polynomial is
not.

An input that is periodic in the record is excited at every P-th line only. There its response has
one term, and the lines between tell transient and noise: the fast method of the same chapter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from fmus.kit.arrays import Array, Indices, Mask

Spectrum = NDArray[np.complex128]
TERMS = 4  # of a response that is smooth, and of the transient
FREEDOM = 8  # complex degrees of freedom of the noise in a window, at the least
WIDTH = 0.1  # of a window to either side, as a share of its frequency, if responses are smooth
_OVERLAP = 2  # responses in either half of such a window
_ROUGH = 0.01  # p-value of one more term below which a window is too wide
_TOO_ROUGH = 0.001  # below which the narrowest is; of smooth responses one line in a thousand
_MATERIAL = 0.01  # relative change of a response by one more term that is an error worth telling
_WEAK = 1e-4  # rms of an input near a line, over its strongest line, that is no excitation
_ABOVE_NOISE = 10.0  # power of an excited line over that of the lines between, at the least
_INFLATED = (
    1e4  # growth of variance by collinear inputs beyond which responses are not distinguished
)
_SINGULAR = 1e-15
_OFF_CENTRE = 2  # lines that a window may have more to one side of its line than to the other


@dataclass(frozen=True)
class Spectra:
    """Discrete Fourier transforms of a record; line l has l periods in it, l = 0, 1, ...

    Attributes
    ----------
    inputs : ndarray of complex, shape (lines, inputs)
    outputs : ndarray of complex, shape (lines, outputs)
        Those measured, and after them those of a model.
    measured : int
        Number of outputs that were measured.
    periods : sequence of int
        In the record, of every input; 0 if its response is to be smooth, not by harmonics.
    stride : int
        From one excited line to the next of inputs that are periodic, but excited at the same
        lines, so that only smoothness tells their responses apart; 1 if there are none.
    """

    inputs: Spectrum
    outputs: Spectrum
    measured: int
    periods: Sequence[int]
    stride: int = 1

    @property
    def smooth(self) -> list[int]:
        """The inputs whose response is smooth in every window."""
        return [i for i, periods in enumerate(self.periods) if not periods]

    @property
    def narrowest(self) -> int:
        """Number of lines in the narrowest window."""
        return self.stride * (TERMS * (1 + len(self.smooth)) + FREEDOM)

    @property
    def between(self) -> Indices:
        """The lines, from the first on, at which no harmonic of an input can be."""
        lines = np.arange(1, len(self.inputs))
        for periods in filter(None, self.periods):
            lines = lines[lines % periods != 0]
        return lines

    def harmonics(self, index: int) -> Indices:
        """Return the lines at which a periodic input is excited, clearly above the noise."""
        power = np.abs(self.inputs[:, index]) ** 2
        lines = np.arange(self.periods[index], len(power), self.periods[index])
        between = self.between
        around = [_nearest_lines(between, line, 2 * FREEDOM) for line in lines.tolist()]
        noise = np.array([power[nearest].mean() for nearest in around])
        least = np.maximum(_ABOVE_NOISE * noise, _WEAK**2 * power[1:].max())
        return lines[power[lines] > least]


@dataclass
class Estimates:
    """Responses of all outputs to one input, by line.

    Attributes
    ----------
    outputs : int
        Number of outputs, those of a model included.
    fits : dict of int to tuple of (_Fit, int)
        By line: the least squares, and the position of the input among those of the fit.
    weak, alike : list of int
        Lines without a response: the input is not excited there, or its response cannot be
        distinguished from that to another input or from the transient.
    """

    outputs: int
    fits: dict[int, tuple[_Fit, int]] = field(default_factory=dict)
    weak: list[int] = field(default_factory=list)
    alike: list[int] = field(default_factory=list)

    def add(self, line: int, fit: _Fit, position: int) -> None:
        """Add the response to the input at a position among those of a fit."""
        if fit.inflation[position] > _INFLATED:
            self.alike.append(line)
        else:
            self.fits[line] = fit, position

    @property
    def freedom(self) -> Array:
        """Complex degrees of freedom (n,) of the covariance."""
        return np.array([fit.freedom for fit, _ in self.fits.values()], dtype=float)

    @property
    def lines(self) -> list[int]:
        """The n lines that have a response."""
        return [*self.fits]

    @property
    def values(self) -> Spectrum:
        """Responses (n, outputs)."""
        values = [fit.values[position] for fit, position in self.fits.values()]
        return np.array(values, dtype=np.complex128).reshape(-1, self.outputs)

    def variance(self, derivatives: Spectrum) -> Array:
        """Return the variance (n,) of a function of the measured responses.

        Parameters
        ----------
        derivatives : ndarray of complex, shape (n, measured)
            Of the function, by each of the responses.
        """
        measured = derivatives.shape[1]
        each = [fit.covariance(position) for fit, position in self.fits.values()]
        covariance = np.array(each).reshape(-1, measured, measured)
        return np.einsum("ka,kab,kb->k", derivatives, covariance, derivatives.conj()).real

    def is_rough(self, outputs: Sequence[int]) -> Mask:
        """Return a mask (n,) of the lines at which the response of any of some outputs is rough."""
        rough = [fit.rough(position)[outputs].any() for fit, position in self.fits.values()]
        return np.array(rough, dtype=bool)


class _Fit(NamedTuple):
    """Least squares in a window, by the inputs that are active there.

    ``change`` is the change of the responses by one more term, and ``significance`` its p-value for
    each output. In a window that reaches far, terms are so few for it that the change counts as an
    error.
    """

    values: Spectrum  # (active, outputs)
    scale: Array  # (active,), variance for noise of variance one
    inflation: Array  # (active,), of the variance by collinear inputs
    noise: Spectrum  # (measured, measured), covariance
    freedom: int
    change: Spectrum  # (active, measured)
    significance: Array  # (measured,)
    reaches_far: bool

    @property
    def is_smooth(self) -> bool:
        return bool(np.all(self.significance >= _ROUGH))

    def covariance(self, position: int) -> Spectrum:
        by_noise = self.scale[position] * self.noise
        if not self.reaches_far:
            return by_noise
        return by_noise + np.outer(self.change[position], self.change[position].conj())

    def rough(self, position: int) -> Mask:
        large = np.abs(self.change[position]) > _MATERIAL * np.abs(
            self.values[position, : self.change.shape[1]]
        )
        return (self.significance < _TOO_ROUGH) & large


def estimate(spectra: Spectra, first: int, last: int) -> list[Estimates]:
    """Estimate the responses to every input.

    Parameters
    ----------
    spectra : Spectra
        With at least as many lines between harmonics as the narrowest window has.
    first, last : int
        Lines from and up to which responses are estimated.

    Returns
    -------
    list of Estimates
        One for each input.
    """
    estimates = [Estimates(spectra.outputs.shape[1]) for _ in spectra.periods]
    between = spectra.between
    if spectra.smooth:
        for line in _space_out(between[(between >= first) & (between <= last)]):
            fit, active = _fit_widest_window(spectra, line, between)
            for i in spectra.smooth:
                if i in active:
                    estimates[i].add(line, fit, active.index(i))
                else:
                    estimates[i].weak.append(line)
    periodic = [i for i, periods in enumerate(spectra.periods) if periods]
    excited = {i: set(spectra.harmonics(i).tolist()) for i in periodic}
    for line in sorted(set().union(*excited.values())):
        if first <= line <= last:
            one_term = [i for i in periodic if line in excited[i]]
            window = np.sort(np.append(_nearest_lines(between, line, spectra.narrowest), line))
            fit = _fit_window(spectra, line, window, _excited_inputs(spectra, window), one_term)
            for position, i in enumerate(one_term):
                estimates[i].add(line, fit, position)
    return estimates


def _space_out(lines: Indices) -> list[int]:
    """Return lines for responses, spaced by the usual width of a window over `_OVERLAP`."""
    chosen: list[int] = []
    for line in lines.tolist():
        if not chosen or line - chosen[-1] >= WIDTH * line / _OVERLAP:
            chosen.append(line)
    return chosen


def _nearest_lines(lines: Indices, line: int, count: int) -> Indices:
    """Return the ``count`` of some lines around a line, equally many on both sides if possible."""
    start = int(np.searchsorted(lines, line)) - count // 2
    start = min(max(start, 0), max(len(lines) - count, 0))
    return lines[start : start + count]


def _excited_inputs(spectra: Spectra, window: Indices) -> list[int]:
    """Return the indices of inputs of smooth response that are excited in a window."""
    strongest = np.abs(spectra.inputs[1:]).max(axis=0)
    here = np.sqrt(np.mean(np.abs(spectra.inputs[window]) ** 2, axis=0))
    return [i for i in spectra.smooth if here[i] > _WEAK * strongest[i]]


def _fit_widest_window(spectra: Spectra, line: int, between: Indices) -> tuple[_Fit, list[int]]:
    """Fit the widest window in which responses are smooth; return the fit, and excited inputs.

    Windows are halved from the usual width down to the narrowest.
    """
    ends = np.searchsorted(between, [(1.0 - WIDTH) * line, (1.0 + WIDTH) * line])
    count = max(int(ends[1] - ends[0]), spectra.narrowest)
    while True:
        window = _nearest_lines(between, line, count)
        active = _excited_inputs(spectra, window)
        fit = _fit_window(spectra, line, window, active, [])
        if fit.is_smooth or count == spectra.narrowest:
            return fit, active
        count = max(count // 2, spectra.narrowest)


def _regressors(
    spectra: Spectra, line: int, window: Indices, smooth: list[int], one_term: list[int]
) -> tuple[Spectrum, int, list[int]]:
    """Return the regressors of a window for inputs of smooth responses, and for those of one term.

    If there are any of one term, these are the responses of the result.

    Returns
    -------
    matrix : ndarray of complex, shape (n, columns)
        Terms of transient and responses, and after them one more term of each.
    fitted : int
        Number of columns without the latter.
    columns : list of int
        Those whose coefficients are the responses at the line.
    """
    terms = _smooth_terms(line, window)
    inputs = spectra.inputs[window]
    groups = [terms, *(terms * inputs[:, [i]] for i in smooth)]
    blocks = [*(group[:, :TERMS] for group in groups), inputs[:, one_term]]
    before = TERMS * len(groups)
    fitted = before + len(one_term)
    columns = list(range(before, fitted)) if one_term else list(range(TERMS, before, TERMS))
    matrix = np.hstack([*blocks, *(group[:, TERMS:] for group in groups)])
    return matrix, fitted, columns


def _fit_window(
    spectra: Spectra, line: int, window: Indices, smooth: list[int], one_term: list[int]
) -> _Fit:
    """Fit responses and transient in a window by least squares; see `_regressors`.

    A QR decomposition of all columns gives the fit without and with the higher terms: the former is
    that of its first columns.
    """
    matrix, fitted, columns = _regressors(spectra, line, window, smooth, one_term)
    lengths = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    orthonormal, triangle = np.linalg.qr(matrix / lengths)
    diagonal = np.einsum("ii->i", triangle)
    diagonal[np.abs(diagonal) < _SINGULAR] = _SINGULAR
    outputs = spectra.outputs[window]
    projected = orthonormal.conj().T @ outputs
    inverse = np.linalg.inv(triangle[:fitted, :fitted])[columns] / lengths[columns, np.newaxis]
    values = inverse @ projected[:fitted]
    with_higher_terms = np.linalg.solve(triangle, projected)[columns] / lengths[columns, np.newaxis]
    residual = (outputs - orthonormal[:, :fitted] @ projected[:fitted])[:, : spectra.measured]
    freedom = len(window) - fitted
    scale = np.sum(np.abs(inverse) ** 2, axis=1)
    return _Fit(
        values,
        scale,
        scale * lengths[columns] ** 2,
        residual.T @ residual.conj() / freedom,
        freedom,
        (with_higher_terms - values)[:, : spectra.measured],
        _significance_of_terms(residual, projected[fitted:, : spectra.measured], freedom),
        _reaches_far(line, window),
    )


def _reaches_far(line: int, window: Indices) -> bool:
    """Return whether a window extends below half its line, or has the line near an end."""
    before = int(np.searchsorted(window, line))
    after = len(window) - 1 - before
    return bool(2 * window[0] < line) or abs(after - before) > _OFF_CENTRE


def _smooth_terms(line: int, window: Indices) -> Array:
    """Return the terms of a smooth response and one higher (n, TERMS + 1), each 1 at most."""
    offset = window - line
    powers = offset[:, np.newaxis] * (offset / window)[:, np.newaxis] ** np.arange(TERMS)
    return np.column_stack([np.ones(len(window)), powers / np.abs(powers).max(axis=0)])


def _significance_of_terms(residual: Spectrum, explained: Spectrum, freedom: int) -> Array:
    """Return the p-value of the higher terms, for every output, by the F-test.

    Parameters
    ----------
    residual : ndarray of complex, shape (n, outputs)
    explained : ndarray of complex, shape (terms, outputs)
        The part that they explain.
    freedom : int
        Complex degrees of freedom of the residual.
    """
    terms = len(explained)
    gain = np.sum(np.abs(explained) ** 2, axis=0)
    remaining = np.maximum(np.sum(np.abs(residual) ** 2, axis=0) - gain, np.finfo(float).tiny)
    ratio = (gain / terms) / (remaining / (freedom - terms))
    return fdtrc(2 * terms, 2 * (freedom - terms), ratio)
