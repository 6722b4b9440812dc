"""Samples of the posterior of fitted parameters, by emcee, with diagnostics of convergence.

The prior is flat in the searched coordinates, within their ranges, times what priors are given. The
noise is held as it was given or estimated, so that the posterior of a linear model is the Gaussian
of its ellipse. A residual that is coloured narrows a likelihood: its deviance is divided by the
mean ratio of variances with the colour to those without (Ribatet, Cooley and Davison, Statistica
Sinica 22, 2012). The sampler is the affine-invariant ensemble of Goodman and Weare (Communications
in Applied Mathematics and Computational Science 5, 2010).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Interval
from fmus.kit.extras import require
from fmus.kit.units import Described, format_value
from orchestration.identify.uncertainty.profile import Coordinate
from orchestration.reporting import Displayable, one_line, plain_table

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType

_WALKERS = 16  # at least, and four times the number of parameters
_CHUNK = 100  # steps between two estimates of the autocorrelation time
_BURNT = 5.0  # autocorrelation times at the beginning that are left out
_LONG = 50.0  # autocorrelation times that a chain must last for its own to be known (emcee)
_MOST = 400_000  # simulations
_MIXED = 1.05  # split R-hat above which chains have not mixed (Vehtari et al., 2021)
_ACCEPTED = 0.15  # share of accepted steps, below which the ensemble hardly moves


@dataclass(frozen=True)
class Posterior(Displayable):
    """Samples of the posterior of p parameters.

    Attributes
    ----------
    samples : dict of str to ndarray, shape (n,)
        By parameter, SI; nearly independent.
    declared : Mapping of str to Described
        Units in which they are read.
    effective : float
        Number of independent samples in the chain, of the parameter with the fewest.
    r_hat : dict of str to float
        Split R-hat by parameter; near 1 where halves of all chains agree.
    acceptance : float
        Share of accepted steps.
    warnings : tuple of str
        Doubts about convergence.
    """

    samples: dict[str, Array]
    declared: Mapping[str, Described]
    effective: float
    r_hat: dict[str, float]
    acceptance: float
    warnings: tuple[str, ...]

    @property
    def intervals(self) -> dict[str, Interval]:
        """95 % credible intervals with equal tails by name, SI."""
        return {
            name: (float(np.quantile(x, 0.025)), float(np.quantile(x, 0.975)))
            for name, x in self.samples.items()
        }

    def overview(self) -> Iterator[RenderableType]:
        """Yield a table of medians and intervals, the diagnostics, and the warnings."""
        columns = ("median", "95 % by posterior", "R-hat")
        table = plain_table(None, "parameter", *columns, right=columns)
        for name, ends in self.intervals.items():
            declared = self.declared[name]
            median, low, high = (
                format_value(x, declared) for x in (float(np.median(self.samples[name])), *ends)
            )
            table.add_row(name, median, f"{low} … {high}", f"{self.r_hat[name]:.3f}")
        yield table
        yield (
            f"{self.effective:.0f} independent samples, {100 * self.acceptance:.0f} % of steps"
            " accepted"
        )
        yield from (f"warning: {text}" for text in self.warnings)

    def __repr__(self) -> str:
        return one_line(f"Posterior of {', '.join(self.samples)}: {self.effective:.0f} samples")

    def to_frame(self) -> pandas.DataFrame:
        """Return the samples as a table, a column for each parameter, SI.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        return pandas.DataFrame(self.samples)

    def to_dict(self) -> dict[str, Any]:
        """Return median, deviation, interval and R-hat by parameter, ready for JSON."""
        parameters = {}
        for name, ends in self.intervals.items():
            x = self.samples[name]
            parameters[name] = {
                "median": float(np.median(x)),
                "standard_deviation": float(np.std(x)),
                "ci95": [*ends],
                "r_hat": self.r_hat[name],
                "unit": self.declared[name].unit,
            }
        return {
            "parameters": parameters,
            "effective_samples": self.effective,
            "acceptance": self.acceptance,
            "warnings": [*self.warnings],
        }


def sample_posterior(
    log_density: Callable[[Array], float],
    declared: Mapping[str, Described],
    coordinates: Sequence[Coordinate],
    centre: Array,
    spread: Array,
    *,
    count: int,
    seed: int,
    progress: Callable[[str], None],
) -> Posterior:
    """Sample until there are `count` independent samples, and enough to know that they are.

    Parameters
    ----------
    log_density : callable
        Of a point (p,) in searched coordinates, up to a constant; minus infinity where the model
        fails.
    declared : Mapping of str to Described
        By parameter.
    coordinates : sequence of Coordinate
        Of each parameter.
    centre, spread : ndarray, shape (p,) and (p, p)
        The estimate, and its covariance, about which the ensemble begins.
    count, seed : int
    progress : callable
        Called with a message before every chunk of steps.

    Raises
    ------
    UserError
        If no number of samples is asked for, or emcee is not installed.
    """
    if count < 1 or seed < 0:
        raise UserError(
            f"{count} samples with seed {seed}: whole numbers, of one sample or more and a seed"
            " from zero on"
        )
    require("emcee")
    import emcee

    ends = np.array([[one.low, one.high] for one in coordinates])

    def inside(q: Array) -> float:
        is_inside = ((ends[:, 0] <= q) & (q <= ends[:, 1])).all()
        return log_density(q) if is_inside else -np.inf

    walkers = max(_WALKERS, 4 * len(centre))
    random = np.random.default_rng(seed)
    state: Any = random.multivariate_normal(centre, spread, walkers, method="svd")
    state = np.clip(state, *ends.T)
    sampler = emcee.EnsembleSampler(walkers, len(centre), inside)
    sampler.random_state = np.random.RandomState(seed).get_state()  # of which emcee's is one
    length = effective = 0.0
    while (length < _LONG or effective < count) and sampler.iteration * walkers < _MOST:
        progress(f"posterior, step {sampler.iteration}")
        state = sampler.run_mcmc(state, _CHUNK)
        times = sampler.get_autocorr_time(tol=0, quiet=True)
        longest = max(1.0, *np.nan_to_num(times, nan=sampler.iteration))
        length = sampler.iteration / longest
        burnt = min(int(_BURNT * longest), sampler.iteration // 2)
        effective = (sampler.iteration - burnt) * walkers / longest
    r_hat = dict(
        zip(declared, map(float, split_r_hat(sampler.get_chain(discard=burnt))), strict=True)
    )
    kept = sampler.get_chain(discard=burnt, thin=int(longest), flat=True)
    samples = {
        name: np.array([one.value(q) for q in column])
        for name, one, column in zip(declared, coordinates, kept.T, strict=True)
    }
    acceptance = float(np.mean(sampler.acceptance_fraction))
    warnings = _doubts(r_hat, acceptance)
    if length < _LONG or effective < count:
        warnings.append(
            f"the chain ended after {sampler.iteration} steps, {length:.0f} autocorrelation times,"
            f" with {effective:.0f} independent samples: its intervals are uncertain"
        )
    return Posterior(samples, declared, effective, r_hat, acceptance, tuple(warnings))


def split_r_hat(points: Array) -> Array:
    """Return R-hat (p,) of the halves of all chains (steps, walkers, p).

    Source: Vehtari, Gelman, Simpson, Carpenter and Bürkner, Bayesian Analysis 16 (2021), without
    ranks.
    """
    half = len(points) // 2
    chains = np.concatenate([points[:half], points[half : 2 * half]], axis=1)
    within = chains.var(axis=0, ddof=1).mean(axis=0)
    between = half * chains.mean(axis=0).var(axis=0, ddof=1)
    ratio = np.divide(between, within, out=np.full_like(within, np.inf), where=within > 0.0)
    return np.sqrt((half - 1) / half + ratio / half)


def _doubts(r_hat: Mapping[str, float], acceptance: float) -> list[str]:
    """Return warnings of chains that have not mixed, and of an ensemble that hardly moves."""
    warnings = []
    unmixed = [name for name, value in r_hat.items() if not value <= _MIXED]
    if unmixed:
        warnings.append(
            f"the chains of {', '.join(unmixed)} have not mixed: R-hat above {_MIXED:g}"
        )
    if acceptance < _ACCEPTED:
        warnings.append(
            f"only {100 * acceptance:.0f} % of steps were accepted: the posterior is narrow or"
            " bent; profiles do without samples"
        )
    return warnings
