"""The base class of linear models of one output: free run, prediction, fit and s-plane."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit import UserError, quoting
from fmus.kit.arrays import Array
from fmus.kit.extras import optional
from orchestration.identify.black_box.data import InputOutputData, input_index
from orchestration.identify.black_box.orders import whole
from orchestration.identify.black_box.polynomials import Roots, columns_of, filtered, s_plane
from orchestration.identify.metrics import fit_percent

_RUNS_AWAY = 1e100  # larger than any signal, but its square is still a number


def _control() -> Any:
    """Return python-control, which takes a second to load."""
    with optional():
        import control

    return control


@dataclass(frozen=True)
class IdentifiedModel(ABC):
    """A linear, discrete-time model of one output, about an operating point.

    Attributes
    ----------
    structure : str
        ARX, ARMAX, OE, BJ or SS.
    step : float
        Sample period in seconds.
    input_names : tuple of str, length m
    output_name : str
    input_offsets : ndarray, shape (m,)
        Input values about which the model is linear, in the units of the inputs.
    output_offset : float
        The output there, in its unit.
    noise_variance : float
        Of the one-step prediction error, in the unit of the output squared.
    """

    structure: str
    step: float
    input_names: tuple[str, ...]
    output_name: str
    input_offsets: Array
    output_offset: float
    noise_variance: float

    def describe_operating_point(self) -> str:
        """Describe in a line the operating point about which the model is linear."""
        at = ", ".join(
            f"{name} = {x:.6g}"
            for name, x in zip(self.input_names, self.input_offsets, strict=True)
        )
        return f"offset: the model is about {self.output_name} = {self.output_offset:.6g} at {at}"

    @abstractmethod
    def _forced(self, deviations: Array) -> Array:
        """Return the response (n,) from rest to deviations of the inputs (n, m)."""

    @abstractmethod
    def _free(self, samples: int) -> Array:
        """Return the free responses (samples, states) to each initial state of one."""

    @abstractmethod
    def static_output(self, deviations: Array) -> float:
        """Return the deviation of the output at rest under deviations of the inputs (m,).

        It is not finite where the output cannot rest.
        """

    @abstractmethod
    def _innovations(self, deviations: Array, output: Array) -> Array:
        """Return the one-step prediction errors, from the first sample on that has a past."""

    @abstractmethod
    def noise_response(self, samples: int) -> Array:
        """Return the impulse response (samples,) from white noise to the output.

        Its first value is one.
        """

    @abstractmethod
    def poles(self, which: int | str = 0) -> Roots:
        """Return the poles in z of the path from an input.

        Parameters
        ----------
        which : int or str
            Number of the input, from 0, or its name.

        Returns
        -------
        ndarray of complex, shape (number of poles,)
            Without poles at the origin.

        Raises
        ------
        UserError
            If there is no such input.
        """

    @abstractmethod
    def zeros(self, which: int | str = 0) -> Roots:
        """Return the zeros in z of the path from an input, without those of delays."""

    @abstractmethod
    def _path(self, i: int) -> tuple[Array, Array]:
        """Return numerator and denominator in z of the path from input i."""

    @abstractmethod
    def _noise_path(self) -> tuple[Array, Array]:
        """Return numerator and denominator in z of the path from white noise."""

    @abstractmethod
    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """Return A, B, C and D of the paths from all inputs."""

    @abstractmethod
    def without_delays(self) -> tuple[IdentifiedModel, tuple[int, ...]]:
        """Return the model of inputs that were delayed before, and their delays in samples.

        One sample of a delay remains, as between a state and what drives it.
        """

    def transfer_function(self, which: int | str = 0) -> Any:
        """Return the path from an input as a discrete `control.TransferFunction`.

        Signals are deviations from the offsets.
        """
        i = self._index(which)
        names = self._names_in_control(self.input_names[i])
        return _control().TransferFunction(*self._path(i), self.step, **names)

    def noise_transfer_function(self) -> Any:
        """Return the path from white noise as a discrete `control.TransferFunction`."""
        names = self._names_in_control("e")
        return _control().TransferFunction(*self._noise_path(), self.step, **names)

    def state_space(self) -> Any:
        """Return the paths from all inputs as one discrete `control.StateSpace`.

        Signals are deviations from the offsets.
        """
        names = self._names_in_control(*self.input_names)
        return _control().StateSpace(*self.matrices(), self.step, **names)

    def _names_in_control(self, *inputs: str) -> dict[str, Any]:
        """Return the names of signals as arguments of a system of python-control."""
        outputs = quoting.control([self.output_name])
        return {"inputs": quoting.control(inputs), "outputs": outputs}

    def simulate(
        self, inputs: ArrayLike, output: ArrayLike | None = None, before: ArrayLike | None = None
    ) -> Array:
        """Simulate a free run over inputs, without feedback of the measured output.

        Parameters
        ----------
        inputs : array_like, shape (n, m) or (n,)
            In the units of the inputs.
        output : array_like, shape (n,), optional
            The measured output. The initial state is then the one that suits all of it best, by
            least squares; nothing else is taken from it.
        before : array_like, shape (m,), optional
            Inputs at which the system rested before the first sample; by default the offsets of the
            model, and if an output is given, those of the first sample.

        Returns
        -------
        ndarray, shape (n,)
            In the unit of the output; infinite where an unstable model has run away.

        Raises
        ------
        UserError
            If shapes do not agree, a value is not finite, or the system cannot rest where it is
            said to.
        """
        u = self._deviations(inputs)
        resting, level = self._rest(u, output is not None, before)
        simulated = self.output_offset + level + self._forced(u - resting)
        if output is None:
            return simulated
        y = np.asarray(output, dtype=np.float64)
        if y.shape != simulated.shape or not np.isfinite(y).all():
            raise UserError(
                f"output of shape {y.shape}: must be {simulated.shape} and finite, as the"
                " inputs are"
            )
        free = self._free(len(u))
        if not max(np.abs(simulated).max(), np.abs(free).max(initial=0.0)) < _RUNS_AWAY:
            # no initial state keeps it near the record
            return np.where(np.isnan(simulated), np.inf, simulated)
        return simulated + free @ np.linalg.lstsq(free, y - simulated, rcond=None)[0]

    def _rest(self, u: Array, from_first: bool, before: ArrayLike | None) -> tuple[Array, float]:
        """Return the deviations of inputs (m,) and output at rest before the first sample.

        Inputs rest at `before`, else at their first deviations ``u[0]`` or at the offsets. A model
        that integrates rests at the offsets alone.
        """
        resting = u[0] if from_first else np.zeros(u.shape[1])
        if before is not None:
            given = np.broadcast_to(np.asarray(before, dtype=np.float64), resting.shape)
            resting = given - self.input_offsets
        level = self.static_output(resting)
        if np.isfinite(level):
            return resting, level
        if before is not None:
            raise UserError(
                f"before = {before}: a model that integrates rests only at {self.input_offsets}"
            )
        return np.zeros(u.shape[1]), 0.0

    def prediction_errors(self, data: InputOutputData) -> Array:
        """Return the one-step prediction errors (r,) of the last r samples.

        The samples before are the past that the model needs.

        Raises
        ------
        UserError
            If the data have other inputs, another step, or too few samples.
        """
        self._check(data)
        return self._innovations(data.inputs - self.input_offsets, data.output - self.output_offset)

    def predict(self, data: InputOutputData, horizon: int = 1) -> Array:
        """Predict every sample from outputs up to ``horizon`` samples before it (Ljung, eq. 3.31).

        Parameters
        ----------
        data : InputOutputData
        horizon : int
            In samples, at least 1.

        Returns
        -------
        ndarray, shape (n,)
            In the unit of the output; the first samples, which have no past on record, are those of
            the free run.

        Raises
        ------
        UserError
            If the horizon is below 1, or as of :meth:`prediction_errors`.
        """
        steps = whole("horizon", horizon, 1)
        e = self.prediction_errors(data)
        first = len(data) - len(e)
        # innovations after the last known output, which the prediction lacks
        unpredicted = filtered(self.noise_response(min(steps, len(e))), np.ones(1), e)
        predicted = data.output.copy()
        predicted[first:] -= unpredicted
        if first:
            predicted[:first] = self.simulate(data.inputs, data.output)[:first]
        return predicted

    def fit(self, data: InputOutputData, horizon: int | None = None) -> float:
        """Return the fit of the free run, or of a prediction, in percent.

        It is ``100 (1 - ||y - yhat|| / ||y - mean(y)||)``. The free run starts from the initial
        state that suits the record best.

        Parameters
        ----------
        data : InputOutputData
        horizon : int, optional
            Of the prediction, in samples.

        Returns
        -------
        float
            100 is perfect, 0 no better than the mean, minus infinity an unstable model that runs
            away.
        """
        self._check(data)
        if horizon is None:
            simulated = self.simulate(data.inputs, data.output)
            runs_away = not np.abs(simulated).max() < _RUNS_AWAY
            return -np.inf if runs_away else fit_percent(data.output, simulated)
        return fit_percent(data.output, self.predict(data, horizon))

    def s_plane_poles(self, which: int | str = 0) -> Roots:
        """Return the poles of a path in the s-plane, rad/s (thesis, fig. 3-16)."""
        return s_plane(self.poles(which), self.step)

    def s_plane_zeros(self, which: int | str = 0) -> Roots:
        """Return the zeros of a path in the s-plane by the same rule, rad/s (thesis, fig. 3-16)."""
        return s_plane(self.zeros(which), self.step)

    def is_stable(self) -> bool:
        """Return whether all poles are within the unit circle."""
        return all(bool((np.abs(self.poles(i)) < 1.0).all()) for i in range(len(self.input_names)))

    def describe_instability(self) -> list[str]:
        """Return a line on an unstable model; none on a stable one."""
        if self.is_stable():
            return []
        return ["the model is unstable: a free run will not stay near the record"]

    def _index(self, which: int | str) -> int:
        return input_index(self.input_names, which)

    def _deviations(self, inputs: ArrayLike) -> Array:
        """Return the deviations of inputs (n, m) from the offsets; refuse others than numbers."""
        u = columns_of(inputs)
        m = len(self.input_names)
        if u.ndim != 2 or u.shape[1] != m or not len(u):
            raise UserError(
                f"inputs of shape {np.shape(inputs)}: must be (n, {m}), for"
                f" {', '.join(self.input_names)}"
            )
        bad = np.argwhere(~np.isfinite(u))
        if bad.size:
            sample, column = bad[0]
            raise UserError(
                f"input {self.input_names[column]}, sample {sample}: must be a finite number"
            )
        return u - self.input_offsets

    def _check(self, data: InputOutputData) -> None:
        """Refuse data with other inputs or another step."""
        if data.input_names != self.input_names:
            raise UserError(
                f"data have inputs {', '.join(data.input_names)}: must be"
                f" {', '.join(self.input_names)}"
            )
        if not np.isclose(data.step, self.step, rtol=1e-6, atol=0.0):
            raise UserError(
                f"data have a step of {data.step:g} s: must be the model's, {self.step:g} s"
            )
