"""Samples of the posterior of fitted parameters, by emcee, with diagnostics of convergence.

The prior is flat in the searched coordinates, within their ranges, times what priors are given. The
noise is held as it was given or estimated, so that the posterior of a linear model is the Gaussian
of its ellipse. A residual that is coloured narrows a likelihood: its deviance is divided by the
mean ratio of variances with the colour to those without (Ribatet, Cooley and Davison, Statistica
Sinica 22, 2012). The sampler is the affine-invariant ensemble of Goodman and Weare (Communications
in Applied Mathematics and Computational Science 5, 2010).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.units import Described, format_value
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
    def intervals(self) -> dict[str, tuple[float, float]]:
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


class Target(NamedTuple):
    """The density that is sampled.

    Attributes
    ----------
    log_density : callable
        Of a point (p,), up to a constant; minus infinity where the model fails.
    centre, spread : ndarray, shape (p,) and (p, p)
        The estimate, and its covariance, about which the ensemble begins.
    low, high : ndarray, shape (p,)
        Ends of the ranges.
    """

    log_density: Callable[[Array], float]
    centre: Array
    spread: Array
    low: Array
    high: Array


class Chain(NamedTuple):
    """A chain of an ensemble after its beginning was left out.

    Attributes
    ----------
    points : ndarray, shape (steps, walkers, p)
    autocorrelation_time : ndarray, shape (p,)
        Steps from one independent point to the next.
    steps : int
        Before the beginning was left out.
    acceptance : float
    """

    points: Array
    autocorrelation_time: Array
    steps: int
    acceptance: float

    @property
    def effective(self) -> float:
        """Number of independent points, of the coordinate with the fewest."""
        steps, walkers, _ = self.points.shape
        return float(steps * walkers / self.autocorrelation_time.max())


def sample(target: Target, count: int, seed: int, progress: Callable[[str], None]) -> Chain:
    """Sample until the chain has `count` independent points and is long enough to know that.

    Parameters
    ----------
    target : Target
    count, seed : int
    progress : callable
        Called with a message before every chunk of steps.

    Raises
    ------
    UserError
        If no number of samples is asked for, or emcee is not installed.
    """
    from fmus.kit.extras import require

    require("emcee")
    import emcee

    if count < 1 or seed < 0:
        raise UserError(
            f"{count} samples with seed {seed}: whole numbers, of one sample or more and a seed"
            " from zero on"
        )
    parameters = len(target.centre)
    walkers = max(_WALKERS, 4 * parameters)
    random = np.random.default_rng(seed)
    start = random.multivariate_normal(target.centre, target.spread, walkers, method="svd")
    sampler = emcee.EnsembleSampler(walkers, parameters, target.log_density)
    sampler.random_state = np.random.RandomState(seed).get_state()  # of which emcee's is one
    state: Any = np.clip(start, target.low, target.high)
    while True:
        progress(f"posterior, step {sampler.iteration}")
        state = sampler.run_mcmc(state, _CHUNK)
        time = sampler.get_autocorr_time(tol=0, quiet=True)
        time = np.where(np.isfinite(time), np.maximum(time, 1.0), float(sampler.iteration))
        burnt = min(int(_BURNT * time.max()), sampler.iteration // 2)
        points = sampler.get_chain(discard=burnt)
        acceptance = float(np.mean(sampler.acceptance_fraction))
        chain = Chain(points, time, sampler.iteration, acceptance)
        is_long = sampler.iteration >= _LONG * time.max()
        if (is_long and chain.effective >= count) or sampler.iteration * walkers >= _MOST:
            return chain


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


def doubts(chain: Chain, count: int, r_hat: Mapping[str, float]) -> tuple[str, ...]:
    """Return warnings about the convergence of a chain."""
    warnings = []
    times = chain.steps / float(chain.autocorrelation_time.max())
    if times < _LONG or chain.effective < count:
        warnings.append(
            f"the chain ended after {chain.steps} steps, {times:.0f} autocorrelation times, with"
            f" {chain.effective:.0f} independent samples: its intervals are uncertain"
        )
    mixed = [name for name, value in r_hat.items() if not value <= _MIXED]
    if mixed:
        warnings.append(f"the chains of {', '.join(mixed)} have not mixed: R-hat above {_MIXED:g}")
    if chain.acceptance < _ACCEPTED:
        warnings.append(
            f"only {100 * chain.acceptance:.0f} % of steps were accepted: the posterior is narrow"
            " or bent; profiles do without samples"
        )
    return tuple(warnings)
