"""Inputs and one output at a fixed sample period: what a black-box model is identified from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmus.kit.errors import UserError, suggestion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InputOutputData:
    """Inputs and one output at a fixed sample period; :func:`input_output_data` makes and checks it.

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
        """Count its samples."""
        return len(self.output)

    def part(self, start: int, stop: int | None = None) -> InputOutputData:
        """Return the samples from ``start`` up to, and without, ``stop``.

        Raises
        ------
        UserError
            If there are none.
        """
        kept = slice(start, stop)
        if not len(self.output[kept]):
            raise UserError(
                f"part from sample {start} to {stop}: there are none, of {len(self)} samples"
            )
        return replace(self, inputs=self.inputs[kept], output=self.output[kept])

    def split(self, share: float = 0.5) -> tuple[InputOutputData, InputOutputData]:
        """Divide it into estimation and validation data, in the order of time.

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
        If shapes do not agree, a sample is not a finite number, the step is not above zero, or names are no names.
    """
    u, y = _as_numbers(inputs, "inputs"), _as_numbers(output, f"output {output_name}")
    u = u[:, np.newaxis] if u.ndim == 1 else u
    if u.ndim != 2 or y.ndim != 1 or len(u) != len(y) or u.shape[1] < 1:
        raise UserError(
            f"inputs have shape {np.shape(inputs)} and the output {np.shape(output)}: must be (n, m) and (n,)"
        )
    if not (np.isfinite(step) and step > 0.0):
        raise UserError(f"step = {step:g} s: must be a finite number above 0")
    names = (
        tuple(f"u{i + 1}" for i in range(u.shape[1])) if input_names is None else tuple(input_names)
    )
    if len(names) != u.shape[1]:
        raise UserError(
            f"input names {', '.join(names)}: there are {len(names)}, for {u.shape[1]} inputs"
        )
    if output_name in names:
        raise UserError(f"{output_name} is an input and the output: name it once")
    if twice := [name for k, name in enumerate(names) if name in names[:k]]:
        raise UserError(f"{twice[0]} is an input twice: name it once")
    for kind, name, values in [
        *(("input", n, c) for n, c in zip(names, u.T, strict=True)),
        ("output", output_name, y),
    ]:
        if (bad := np.flatnonzero(~np.isfinite(values))).size:
            at, value = bad[0], values[bad[0]]
            raise UserError(
                f"{kind} {name}, sample {at}: is {value:g}, must be a finite number; fill gaps, or cut them out"
            )
    return InputOutputData(u, y, float(step), names, output_name)


def _as_numbers(values: ArrayLike, what: str) -> Array:
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UserError(f"{what}: must be an array of numbers ({error})") from None


def check_varies(data: InputOutputData) -> None:
    """Refuse data from which nothing can be learnt.

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
    """Return the number of an input that is given by number or name.

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
