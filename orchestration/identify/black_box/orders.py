"""The orders of a polynomial model, checked against the data (Ljung, section 4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import index

import numpy as np

from fmus.kit import UserError
from orchestration.identify.black_box.data import InputOutputData

Count = int | Sequence[int]
_SAMPLES_PER_PARAMETER = 2  # at least


@dataclass(frozen=True)
class Orders:
    """Orders of ``A y = sum_i B_i/F_i u_i + C/D e``, as Ljung names them.

    Attributes
    ----------
    na, nc, nd : int
        Coefficients of A, C and D after their leading one.
    nb : tuple of int, length m
        Coefficients of every B.
    nf : tuple of int, length m
        Coefficients of every F after its leading one.
    nk : tuple of int, length m
        Delays from every input to the output, in samples.
    """

    na: int
    nb: tuple[int, ...]
    nc: int
    nd: int
    nf: tuple[int, ...]
    nk: tuple[int, ...]

    @property
    def parameters(self) -> int:
        """The number of coefficients."""
        return self.na + sum(self.nb) + self.nc + self.nd + sum(self.nf)

    @property
    def first(self) -> int:
        """The first sample for which the record has all inputs and outputs of the equation."""
        return max(self.na, *(b + k - 1 for b, k in zip(self.nb, self.nk, strict=True)), 0)

    @property
    def highest(self) -> int:
        """Largest order of any polynomial."""
        return max(self.na, self.nc, self.nd, *self.nb, *self.nf)

    @property
    def has_noise_model(self) -> bool:
        """True if the disturbance is coloured noise."""
        return bool(self.na or self.nc or self.nd)

    @property
    def noise_order(self) -> int:
        """Order of the noise model C/(A D): that of ARX, 1/A, is that of its A."""
        return max(self.na + self.nd, self.nc)

    def contains(self, other: Orders) -> bool:
        """Return whether models of the other orders are nested in these, if their A is stable.

        A is a factor of every F and of D where there is no A: ``A y = B u + C e`` is
        ``y = B/A u + C/A e``.
        """
        shared = other.na if self.na < other.na else 0  # order of A as a factor of F and D
        denominators = np.subtract([self.nd, *self.nf], [other.nd, *other.nf]) >= shared
        delays = np.less_equal(self.nk, other.nk)
        ends = np.add(self.nb, self.nk) >= np.add(other.nb, other.nk)
        is_large = self.na + shared >= other.na and self.nc >= other.nc
        return is_large and bool(denominators.all() and delays.all() and ends.all())

    def nested_structures(self) -> tuple[Orders, ...]:
        """Return the largest orders of simpler structures that are nested in these.

        In Box-Jenkins those of output error and of ARMAX; in ARMAX with one input those of output
        error, which is nested but for the free response.
        """
        without_noise = replace(self, nc=0, nd=0)
        if not self.na:
            nested = []
            if any(self.nf) and self.nc + self.nd:
                nested.append(without_noise)
            common = min(*self.nf, self.nd)  # the order of an A that is a factor of every F and D
            if common:
                nested.append(replace(self, na=common, nd=0, nf=tuple(0 for _ in self.nf)))
            return tuple(nested)
        # B/F u + e is B/A u + C/A e with A = C = F
        order = min(self.na, self.nc) if len(self.nf) == 1 else 0
        return (replace(without_noise, na=0, nf=(order,)),) if order else ()

    @property
    def excitation(self) -> tuple[int, ...]:
        """Order to which every input must excite persistently (Ljung, section 13.2).

        It is one for every parameter of its path.
        """
        return tuple(b + max(f, self.na) for b, f in zip(self.nb, self.nf, strict=True))

    def names(self) -> tuple[str, ...]:
        """Name the coefficients in the order in which they are estimated: a1, b1_1, ..., f1_1, ...

        The coefficient ``b2_3`` is that of q^-3 in the B of the second input.
        """
        groups = [("a", 1, self.na)]  # letter, first number and count
        for i, (b, f, k) in enumerate(zip(self.nb, self.nf, self.nk, strict=True), start=1):
            groups += [(f"b{i}_", k, b), (f"f{i}_", 1, f)]
        groups += [("c", 1, self.nc), ("d", 1, self.nd)]
        return tuple(f"{x}{first + j}" for x, first, count in groups for j in range(count))

    def __str__(self) -> str:
        """Return the orders that are not zero as text: ``na = 2, nb = 2 1, nk = 1 1``."""
        named = {"na": (self.na,), "nb": self.nb, "nf": self.nf, "nc": (self.nc,), "nd": (self.nd,)}
        written = [
            f"{name} = {' '.join(map(str, values))}"
            for name, values in named.items()
            if any(values)
        ]
        return ", ".join([*written, f"nk = {' '.join(map(str, self.nk))}"])


def orders(
    data: InputOutputData,
    nb: Count,
    nk: Count = 1,
    na: int = 0,
    *,
    nf: Count = 0,
    nc: int = 0,
    nd: int = 0,
) -> Orders:
    """Make orders and check them against data; one number stands for all inputs alike.

    Parameters
    ----------
    data : InputOutputData
    nb, nk, nf : int or sequence of int
    na, nc, nd : int
        See :class:`Orders`.

    Returns
    -------
    Orders

    Raises
    ------
    UserError
        If an order is not a whole number in its range, there are not as many as inputs, or there
        are too few samples.
    """
    inputs = len(data.input_names)
    made = Orders(
        whole("na", na, 0),
        one_per_input("nb", nb, inputs, 1),
        whole("nc", nc, 0),
        whole("nd", nd, 0),
        one_per_input("nf", nf, inputs, 0),
        one_per_input("nk", nk, inputs, 0),
    )
    # with the free response of every F, and the offset
    estimated = made.parameters + sum(made.nf) + 1
    needed = made.first + _SAMPLES_PER_PARAMETER * estimated
    if len(data) < needed:
        raise UserError(
            f"{len(data)} samples of {data.output_name} are too few for {made} ({made.parameters}"
            f" parameters): at least {needed} are needed"
        )
    return made


def one_per_input(name: str, value: Count, inputs: int, least: int) -> tuple[int, ...]:
    """Return one whole number for each input, not below the least that is allowed.

    Raises
    ------
    UserError
        If it is not, or there are not as many as inputs.
    """
    values = tuple(value) if isinstance(value, Sequence) else (value,) * inputs
    if len(values) != inputs:
        raise UserError(
            f"{name} = {list(values)}: must be one number, or one for each of {inputs} inputs"
        )
    return tuple(whole(f"{name}[{i}]", v, least) for i, v in enumerate(values))


def whole(name: str, value: int, least: int) -> int:
    """Return a number if it is whole and not below the least that is allowed.

    Raises
    ------
    UserError
        If it is not.
    """
    try:
        number = index(value)
    except TypeError:
        number = least - 1
    if number < least:
        raise UserError(f"{name} = {value}: must be a whole number, at least {least}")
    return number
