"""Input-output data at a fixed sample period, from which a black-box model is identified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion


@dataclass(frozen=True)
class InputOutputData:
    """Inputs and one output at a fixed sample period, as :func:`input_output_data` checks them.

    Attributes
    ----------
    inputs : ndarray, shape (n, m)
        Each column in the unit of its input.
    output : ndarray, shape (n,)
    step : float
        Sample period in seconds.
    input_names : tuple of str, length m
    output_name : str
    """

    inputs: Array
    output: Array
    step: float
    input_names: tuple[str, ...]
    output_name: str

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.output)

    def part(self, start: int, stop: int | None = None) -> InputOutputData:
        """Return the samples from ``start`` up to, and without, ``stop``.

        Raises
        ------
        UserError
            If there are none.
        """
        kept = slice(start, stop)
        if len(self.output[kept]) == 0:
            raise UserError(
                f"part from sample {start} to {stop}: there are none, of {len(self)} samples"
            )
        return replace(self, inputs=self.inputs[kept], output=self.output[kept])

    def split(self, share: float = 0.5) -> tuple[InputOutputData, InputOutputData]:
        """Divide the data into estimation and validation data, in the order of time.

        Parameters
        ----------
        share : float
            Of the samples, those to estimate from.

        Raises
        ------
        UserError
            If it is no share, or one of the two would be empty.
        """
        if not 0.0 < share < 1.0:
            raise UserError(f"share = {share:g}: must be between 0 and 1, neither of them")
        first = round(share * len(self))
        if not 0 < first < len(self):
            raise UserError(f"share = {share:g} of {len(self)} samples: both parts need samples")
        return self.part(0, first), self.part(first)


def input_output_data(
    inputs: ArrayLike,
    output: ArrayLike,
    step: float,
    input_names: Sequence[str] | None = None,
    output_name: str = "y",
) -> InputOutputData:
    """Make input-output data, and check them.

    Parameters
    ----------
    inputs : array_like, shape (n, m) or (n,)
        One column for each input.
    output : array_like, shape (n,)
    step : float
        Sample period in seconds.
    input_names : sequence of str, optional
        By default u1, u2 and so on.
    output_name : str

    Returns
    -------
    InputOutputData

    Raises
    ------
    UserError
        If shapes do not agree, a sample is not a finite number, the step is not above zero, or
        names are no names.
    """
    u = _as_numbers(inputs, "inputs")
    y = _as_numbers(output, f"output {output_name}")
    if u.ndim == 1:
        u = u[:, np.newaxis]
    if u.ndim != 2 or y.ndim != 1 or len(u) != len(y) or u.shape[1] < 1:
        raise UserError(
            f"inputs have shape {np.shape(inputs)} and the output {np.shape(output)}: must be (n,"
            " m) and (n,)"
        )
    if not (np.isfinite(step) and step > 0.0):
        raise UserError(f"step = {step:g} s: must be a finite number above 0")
    numbered = [f"u{i + 1}" for i in range(u.shape[1])]
    names = tuple(numbered if input_names is None else input_names)
    _check_names(names, output_name, u.shape[1])
    for name, column in zip(names, u.T, strict=True):
        _check_finite(f"input {name}", column)
    _check_finite(f"output {output_name}", y)
    return InputOutputData(u, y, float(step), names, output_name)


def _as_numbers(values: ArrayLike, label: str) -> Array:
    """Return a copy of values as an array of floats; refuse anything that is not a number."""
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UserError(f"{label}: must be an array of numbers ({error})") from None


def _check_names(names: tuple[str, ...], output_name: str, inputs: int) -> None:
    """Refuse names that are not one for each signal."""
    if len(names) != inputs:
        raise UserError(
            f"input names {', '.join(names)}: there are {len(names)}, for {inputs} inputs"
        )
    if output_name in names:
        raise UserError(f"{output_name} is an input and the output: name it once")
    for k, name in enumerate(names):
        if name in names[:k]:
            raise UserError(f"{name} is an input twice: name it once")


def _check_finite(label: str, values: Array) -> None:
    """Refuse a signal with a sample that is not a finite number."""
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise UserError(
            f"{label}, sample {bad[0]}: is {values[bad[0]]:g}, must be a finite number; fill gaps,"
            " or cut them out"
        )


def check_varies(data: InputOutputData) -> None:
    """Refuse data with a constant signal, from which nothing can be learnt.

    Raises
    ------
    UserError
        If an input or the output is constant.
    """
    for name, values in zip(data.input_names, data.inputs.T, strict=True):
        if np.ptp(values) == 0.0:
            raise UserError(
                f"input {name} is constant ({values[0]:g} in all {len(data)} samples): "
                "an input must vary for its dynamics to be identified; leave it out"
            )
    if np.ptp(data.output) == 0.0:
        raise UserError(
            f"output {data.output_name} is constant ({data.output[0]:g} in all {len(data)} samples)"
        )


def input_index(names: Sequence[str], which: int | str) -> int:
    """Return the index of an input that is given by number or name.

    Raises
    ------
    UserError
        If there is none.
    """
    if isinstance(which, str):
        if which not in names:
            raise UserError(f"input {which}: there is none{suggestion(which, names)}")
        return list(names).index(which)
    if not 0 <= which < len(names):
        raise UserError(f"input {which}: must be from 0 to {len(names) - 1}")
    return which
