"""The protocol of a test of residuals, and the tests that there are."""

from __future__ import annotations

import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from orchestration.discrepancy.residuals.output_residual import OutputResidual

ALPHA = 1e-4  # probability of what counts as structure of a residual


class ResidualTest(ABC):
    """Result of a test of the residual of one output for structure that noise does not explain.

    A subclass in a module of this package is found by being there.

    Attributes
    ----------
    rank : int
        Place among the tests: the most telling first.
    needs_even_samples : bool
        False if its result is judged on unevenly spaced samples too.
    is_listed : bool
        False if a page leaves it to the summary of what is unexplained.
    p_value : float
        Of such a result in noise.
    rms : float
        Of the structure, in the unit of the output; infinite where rounding is allowed for already.
    """

    rank: ClassVar[int] = 9
    needs_even_samples: ClassVar[bool] = True
    is_listed: ClassVar[bool] = True
    p_value: float
    rms: float

    @classmethod
    @abstractmethod
    def of(cls, residual: OutputResidual) -> Sequence[ResidualTest]:
        """Test a residual; several results are those of several signals."""

    @abstractmethod
    def describe(self, output: str) -> str:
        """Return in one line what kind of structure the residual of an output has."""

    @property
    def significant(self) -> bool:
        """True if it is more than chance."""
        return self.p_value < ALPHA

    def is_structure(self, rounding: float) -> bool:
        """Return True if it is structure.

        Parameters
        ----------
        rounding : float
            Largest mean error that a converter can leave, in the unit of the output.
        """
        return self.significant and self.rms > rounding

    @classmethod
    def finds_structure(cls, residual: OutputResidual) -> bool:
        """Return True if any result is structure."""
        return any(test.is_structure(residual.cleaned.rounding) for test in cls.of(residual))


@cache
def residual_tests() -> tuple[type[ResidualTest], ...]:
    """Return the tests in the modules of this package, the most telling first."""
    package = __name__.rpartition(".")[0]
    for module in pkgutil.iter_modules(import_module(package).__path__):
        import_module(f"{package}.{module.name}")
    return tuple(sorted(ResidualTest.__subclasses__(), key=lambda test: (test.rank, test.__name__)))
