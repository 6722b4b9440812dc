"""Test for excess variance of the innovations where an input steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.special import fdtrc, ndtri

from fmus.kit.arrays import Array
from orchestration.discrepancy.residuals.innovations import Innovations
from orchestration.discrepancy.residuals.residual_test import ResidualTest
from orchestration.identify import ranks
from orchestration.records.sampling import input_steps

if TYPE_CHECKING:
    from orchestration.discrepancy.residuals.output_residual import OutputResidual

ALPHA = 1e-6  # probability in noise of one level
_NOTABLE = 1.5  # ratio of variances
_FEW = 10  # samples with steps of an input that it takes to judge them


@dataclass(frozen=True)
class ExcessVariance(ResidualTest):
    """Comparison of the size of innovations where an input steps with that elsewhere.

    Attributes
    ----------
    ratio : float
        Of the two variances.
    p_value : float
        Of so much larger innovations there in noise, by a rank test; 1 where there are too few
        steps.
    rms : float
        Infinite.
    """

    rank: ClassVar[int] = 2
    is_listed: ClassVar[bool] = False

    ratio: float
    p_value: float
    rms: float = np.inf  # the test allows for rounding itself

    @classmethod
    def of(cls, residual: OutputResidual) -> list[ExcessVariance]:
        """Test a residual that is whitened as it is, and by its local level."""
        return [_test(residual, [residual.whole.innovations, residual.levelled_innovations])]

    @classmethod
    def finds_structure(cls, residual: OutputResidual) -> bool:
        """Return True if it is structure, whichever way innovations are made."""
        # the local level takes long, and each way must show it
        first = _test(residual, [residual.whole.innovations])
        return first.significant and super().finds_structure(residual)

    def describe(self, output: str) -> str:
        """Return that the output is worse where an input steps."""
        return f"{output} is worse where an input steps"

    @property
    def significant(self) -> bool:
        """True if it is beyond noise whose level jumps with the output, faster than is followed."""
        return self.p_value < ALPHA and self.ratio > _NOTABLE


def _test(residual: OutputResidual, innovations: Sequence[Innovations]) -> ExcessVariance:
    return excess_variance_at_input_steps(
        innovations,
        residual.data.inputs,
        late=int(bool(residual.feedback)),
        rounding=residual.cleaned.whitened_rounding,
    )


def excess_variance_at_input_steps(
    innovations: Sequence[Innovations],
    inputs: Mapping[str, Array],
    late: int = 0,
    rounding: float = 0.0,
) -> ExcessVariance:
    """Compare the size of innovations where an input steps with that elsewhere, by their ranks.

    The test is Klotz's (Ann. Math. Stat. 33, 1962), which no heavy tails deceive.

    Parameters
    ----------
    innovations : sequence of Innovations
        The residual whitened in several ways, of which each must show it.
    inputs : Mapping of str to ndarray, shape (n,)
    late : int
        Samples after a step that are looked at: where a controller moves the input by what it has
        just measured, it steps because the innovation is large.
    rounding : float
        Standard deviation, over that of the innovations, of what a converter may add where its
        input moves fast.
    """
    tests = [_klotz_test(white, inputs, late, rounding) for white in innovations]
    return ExcessVariance(tests[0].ratio, max(test.p_value for test in tests))


def _klotz_test(
    innovations: Innovations, inputs: Mapping[str, Array], late: int, rounding: float
) -> ExcessVariance:
    at = innovations.at
    steps = input_steps(inputs, int(at.max(initial=-1)) + 1)
    delayed = np.concatenate([np.zeros(late, dtype=bool), steps[: steps.size - late]])
    at_step = delayed[at]
    if min(at_step.sum(), (~at_step).sum()) < _FEW:
        return ExcessVariance(1.0, 1.0)
    usual = float(np.mean(innovations.raw[~at_step] ** 2))
    if not usual > 0.0:
        return ExcessVariance(1.0, 1.0)
    ratio = float(np.mean(innovations.raw[at_step] ** 2)) / usual
    discount = np.sqrt(usual / (usual + rounding**2))
    size = np.abs(innovations.standardised)
    size[at_step] *= discount
    # scores that go like the squares of normal variables: where noise is Gaussian, as sharp as a
    # ratio of variances
    scores = ndtri(0.5 + 0.5 * ranks(size) / (size.size + 1.0)) ** 2
    score_ratio = float(scores[at_step].mean()) / float(scores[~at_step].mean())
    p_value = float(fdtrc(at_step.sum(), (~at_step).sum(), score_ratio))
    return ExcessVariance(ratio, p_value)
