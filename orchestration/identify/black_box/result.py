"""The result of an identification: a model, its uncertainty, and how well it fits."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.black_box.data import InputOutputData
from orchestration.identify.black_box.models import IdentifiedModel
from orchestration.identify.black_box.residual_tests import ResidualTests, residual_tests

_LAGS = 25  # default of residual tests
_LEAST = 1e-300  # smallest loss of which a logarithm is taken; data without noise have none


@dataclass(frozen=True)
class Parameter:
    """A coefficient of a model.

    Attributes
    ----------
    name : str
        ``a1``, or ``b2_3`` for the coefficient of q^-3 in the B of the second input.
    value, standard_error : float
        The latter infinite where the data do not determine the former.
    """

    name: str
    value: float
    standard_error: float


@dataclass(frozen=True)
class Identification:
    """An identified model.

    Attributes
    ----------
    model : IdentifiedModel
    data : InputOutputData
        Data it was identified from.
    parameters : tuple of Parameter
        Empty for a state-space model, whose coordinates are arbitrary.
    covariance : ndarray, shape (p, p)
        Of the parameters, in their order.
    count : int
        Number of parameters in AIC and BIC: the offset counts where it is estimated, initial states
        do not.
    residual : ndarray, shape (r,)
        One-step prediction errors of the last r samples, in the unit of the output.
    converged : bool
    messages : tuple of str
        One line each on offsets, weak excitation and instability.
    """

    model: IdentifiedModel
    data: InputOutputData
    parameters: tuple[Parameter, ...]
    covariance: Array
    count: int
    residual: Array
    converged: bool
    messages: tuple[str, ...]

    @property
    def loss(self) -> float:
        """Mean square of the residual, in the unit of the output squared."""
        return float(self.residual @ self.residual) / len(self.residual)

    @property
    def _log_loss(self) -> float:
        return log(max(self.loss, _LEAST))

    @property
    def aic(self) -> float:
        """Akaike's criterion per sample, ``log V + 2 d / N``: loss V, d parameters, N samples.

        Sources: Ljung, eq. 16.47; thesis, table 3-2.
        """
        return self._log_loss + 2.0 * self.count / len(self.residual)

    @property
    def bic(self) -> float:
        """Schwarz's criterion per sample, ``log V + d log(N) / N`` (Ljung, section 16.4).

        The symbols are those of `aic`.
        """
        samples = len(self.residual)
        return self._log_loss + self.count * log(samples) / samples

    @property
    def fit(self) -> float:
        """Free-run fit to the data it was identified from, in percent."""
        return self.model.fit(self.data)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Faults that make the model degenerate, a phrase for each."""
        doubts = []
        open_ended = [p.name for p in self.parameters if not np.isfinite(p.standard_error)]
        if open_ended:
            doubts.append(f"the record does not determine {', '.join(open_ended)}")
        offset, low, high = self.model.output_offset, *np.percentile(self.data.output, (0, 100))
        # a rise that is cut off half-way settles beyond the record by as much as the record spans
        if abs(2.0 * offset - low - high) > 3.0 * (high - low) and self._rests:
            doubts.append(
                f"its offset, {offset:.4g}, is beyond the record, {low:.4g} to {high:.4g}"
            )
        return tuple(doubts)

    @property
    def _rests(self) -> bool:
        """True if the output can rest, at the offset; a model that integrates rests anywhere."""
        return bool(np.isfinite(self.model.static_output(np.ones(len(self.model.input_names)))))

    @property
    def is_integrating(self) -> bool:
        """True if a pole is so close to one that the record ends before it decays by 1/e."""
        poles = np.concatenate([self.model.poles(name) for name in self.model.input_names])
        return bool((np.abs(1.0 - poles) * len(self.residual) < 1.0).any())

    @property
    def is_sound(self) -> bool:
        """True if the model neither is degenerate nor integrates."""
        return not (self.doubts or self.is_integrating)

    def parameter(self, name: str) -> Parameter:
        """Return the parameter of a name.

        Raises
        ------
        KeyError
            If there is none.
        """
        return {p.name: p for p in self.parameters}[name]

    def parameter_rows(self) -> list[list[str]]:
        """Return name, value and standard error of every parameter, for tables."""
        return [[p.name, f"{p.value:.6g}", f"{p.standard_error:.2g}"] for p in self.parameters]

    def residual_tests(self, lags: int | None = None, significance: float = 0.01) -> ResidualTests:
        """Test whether the residual is white and independent of the inputs.

        See :func:`residual_tests`. By default up to lag 25, or a quarter of the samples if less.
        """
        count = len(self.residual)
        if lags is None:
            lags = min(_LAGS, count // 4)
        return residual_tests(self.residual, self.data.inputs[-count:], lags, significance)

    def summary(self) -> str:
        """Describe the model: figures, parameters with standard errors, messages, line by line."""
        lines = [
            f"{self.model.structure} from {len(self.data)} samples every {self.data.step:g} s",
            f"free-run fit {self.fit:.1f} %, one-step fit {self.model.fit(self.data, 1):.1f} %, "
            f"AIC {self.aic:.3f}, BIC {self.bic:.3f}",
            *(f"{p.name:>6} = {p.value: .6g} ± {p.standard_error:.2g}" for p in self.parameters),
        ]
        return "\n".join([*lines, *self.messages])
