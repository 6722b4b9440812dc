"""Evidence of a record for a candidate: scored without a fit, screened, or fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from fmus.kit import Effect
from orchestration.discrepancy.candidates.candidate import Candidate, label, own_parameters
from orchestration.identify.fitting import FitResult, Problem


@dataclass(frozen=True)
class FittedCandidate:
    """A candidate fitted to a record.

    Attributes
    ----------
    candidate : Candidate
    problem : Problem
    fit : FitResult
    free_run : FitResult or None
        Fitted for the nearest free run, or nearly so, where that was done.
    """

    candidate: Candidate
    problem: Problem
    fit: FitResult
    free_run: FitResult | None = None

    @property
    def parameters(self) -> dict[str, float]:
        """Values of all parameters, SI: as fitted, or where they start."""
        return self.problem.start | self.fit.values

    @property
    def effect(self) -> type[Effect]:
        """The effect that was laid over the model last."""
        return self.candidate.effects[-1]

    @property
    def effect_name(self) -> str:
        """Name of that effect."""
        return label(self.effect)

    def delta_bic(self, base: FittedCandidate, tried: int) -> float:
        """Return the fall of BIC, less twice the logarithm of how many effects were tried."""
        extra = len(self.candidate.effects) - len(base.candidate.effects)
        return base.fit.bic - self.fit.bic - 2.0 * extra * float(np.log(max(tried, 1)))

    def robust_fall(self, base: FittedCandidate, tried: int, beyond: float = 0.0) -> float:
        """Return the fall of BIC, where the noise is not quite what the likelihood takes it to be.

        The likelihood ratio is as much too large as the effect's strength scatters more, in
        variance, than the likelihood says (Kent, Biometrika 69, 1982); that is told by White's
        covariance. ``beyond`` is evidence that the likelihood of the base hides.
        """
        excess = self.fit.excess_variance[self.problem.names.index(own_parameters(self.effect)[0])]
        ratio = base.fit.deviance - self.fit.deviance + beyond
        return self.delta_bic(base, tried) + beyond - ratio * (1.0 - 1.0 / excess)

    def is_nearer_than(self, base: FittedCandidate) -> bool:
        """Return whether its free run is nearer to the record, in the geometric mean over outputs.

        Otherwise mere noise is fitted. Samples count as they do in its fit.
        """
        ratios = []
        for output, weights in self.fit.weights.items():
            if base.fit.residual[output].any():
                error = float(np.sum(weights * self.fit.residual[output] ** 2))
                base_error = float(np.sum(weights * base.fit.residual[output] ** 2))
                ratios.append(error / base_error)
        return float(np.prod(ratios)) < 1.0

    def p_value(self, base: FittedCandidate, tried: int, beyond: float = 0.0) -> float:
        """Return the p-value of the likelihood ratio, times the number of candidates tried."""
        ratio = base.fit.deviance - self.fit.deviance + beyond
        freedom = max(self.fit.parameters - base.fit.parameters, 1)
        return float(min(1.0, tried * chdtrc(freedom, max(ratio, 0.0))))
