"""The search for what changed between two records of one specimen: parameters, and whole effects.

Both records are simulated with one set of parameters, and one parameter after the other is released
to be another in the later record, as long as that makes the simulation fit noticeably better
(forward selection by the error of the free run). An effect that is in one record only is no special
case: the model has it in both, and its strength is what is released.

A change is claimed only if it is surely more than chance, both by the colour and the changing level
of the noise of both records and by how much single stretches of them disagree. The latter is what
tells a change from an error of the model: no model is quite right, and what is wrong with it bends
every parameter, here more and there less.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, ndtri, stdtrit

from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates import Candidate, label, own_parameters
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.parallel import parallel_map
from orchestration.discrepancy.selection import Search
from orchestration.identify.changes import Change
from orchestration.identify.fitting import (
    FitResult,
    Problem,
    error_scales,
    fit_free_run,
    pooled_error,
    starting_points,
)
from orchestration.identify.uncertainty import (
    Covariance,
    clustered_covariance,
    is_significantly_different,
    parameter_covariance,
)
from orchestration.records.runs import base_name

BEFORE, AFTER = "before", "after"
# Of what releasing all parameters gains, in squared error, below which releasing one more explains
# nothing: no model is quite right, and what is wrong with it bends every parameter a little.
RELEVANT = 0.02
# standard errors from which on a parameter is released, so that it does not bend others, but not
# claimed
_PERHAPS = 2.0
STRETCHES = 10  # of each record, that must agree about a change
ALPHA = 0.01  # that anything is claimed by chance, of all parameters together


@dataclass(frozen=True)
class _JointFit:
    """A fit of both records, in which some parameters have a value of their own in the later one.

    Attributes
    ----------
    released : tuple of str
        Those parameters.
    problem : Problem
    fit : FitResult
    error : float
        Mean of the squared errors, over the noise.
    """

    released: tuple[str, ...]
    problem: Problem
    fit: FitResult
    error: float


@dataclass(frozen=True)
class _JointFitter:
    """Fits of one model to both records, or to one of them.

    Attributes
    ----------
    search : Search
    candidate : Candidate
    """

    search: Search
    candidate: Candidate

    def fit(
        self,
        released: tuple[str, ...],
        origins: Sequence[Mapping[str, float]],
        also_far_starts: bool = False,
    ) -> _JointFit:
        """Fit with some parameters released, from given points.

        Parameters
        ----------
        released : tuple of str
        origins : sequence of Mapping of str to float
            Where to start, SI.
        also_far_starts : bool
            Whether to start from points a decade about nominal too.
        """
        names = [*self.search.parameters, *(_later(name) for name in released)]
        problem = self.search.problem(self.candidate, names, self.search.fixed)
        starts = []
        for origin in origins:
            values = {
                name: origin.get(name, origin.get(base_name(name), problem.start[name]))
                for name in problem.names
            }
            starts.append(problem.inside(problem.position(values)))
        if also_far_starts:
            starts += starting_points(problem)
        fit = fit_free_run(problem, starts)
        error = pooled_error(fit.residual, error_scales(problem)) ** 2
        return _JointFit(released, problem, fit, error)


def _later(name: str) -> str:
    """Return the name of a parameter's own value in the later record."""
    return f"{name}@{AFTER}"


def find_changes(
    candidate: Candidate,
    data: Dataset,
    *,
    parameters: Sequence[str],
    own: Sequence[str],
    fixed: Mapping[str, float],
    progress: Callable[[str], None] = lambda text: None,
    budget: Budget | None = None,
) -> list[Change]:
    """Find the parameters that differ between a record and those from before.

    Parameters
    ----------
    candidate : Candidate
        The model, with every effect that is in either record.
    data : Dataset
        All records, joined: the later one under the label `AFTER`, one or more from before under
        others.
    parameters : sequence of str
        That may have changed. Those of which neither record says anything are left out.
    own : sequence of str
        Start values, and what else is estimated in each record by itself.
    fixed : Mapping of str to float
        Where the search starts, and other values.
    progress : callable
    budget : Budget, optional
        Time that it may take; when it is spent, what was not tried is not claimed.

    Returns
    -------
    list of Change
        Those that are claimed first, in the order of what they explain.

    Raises
    ------
    UserError
        If the model cannot be simulated over the records.
    """
    # an effect may have come or gone: a search that starts where it does nothing does not take the
    # logarithm of its strength, which could not reach zero
    neutral = _neutral_values(candidate)
    search = Search(
        data,
        candidate.cls,
        [*parameters, *own],
        dict(fixed) | neutral,
        progress,
        budget or Budget(),
        each=own,
    )
    sensitive = _sensitive_parameters(search, candidate, parameters, fixed)
    fits = _JointFitter(replace(search, parameters=[*sensitive, *own]), candidate)
    progress("fitting both records alike")
    shared = fits.fit((), [fixed])
    progress("fitting each record by itself")
    separate = _fit_separately(fits, shared, sensitive, fixed)
    released = _release_in_turn(fits, shared, separate, sensitive)
    return _claims(fits, released, separate, neutral)


def _neutral_values(candidate: Candidate) -> dict[str, float]:
    """Return the values of the strengths of effects at which these do nothing."""
    switches = {effect.neutral for effect in candidate.effects}
    return {p.name: float(p.start) for p in candidate.cls.layout.parameters if p.name in switches}


def _sensitive_parameters(
    search: Search, candidate: Candidate, parameters: Sequence[str], values: Mapping[str, float]
) -> list[str]:
    """Return the parameters that move any measured output; those of an effect do where it acts."""
    problem = search.problem(candidate, parameters, values)
    return problem.sensitive_parameters(problem.inside(problem.position(problem.start)))


def _fit_separately(
    fits: _JointFitter, shared: _JointFit, parameters: Sequence[str], fixed: Mapping[str, float]
) -> _JointFit:
    """Fit with all parameters released.

    The fit starts both where a fit of the later record alone ends and where the shared fit does.
    """
    later = replace(fits.search, data=fits.search.data.runs_of([AFTER]))
    alone = _JointFitter(later, fits.candidate).fit(
        (), [shared.fit.values, fixed], also_far_starts=True
    )
    values = alone.fit.values
    own = {_later(name): values[name] for name in parameters}
    # what is a run's own anyway, such as `ocv@3`, keeps its name
    own |= {name: value for name, value in values.items() if base_name(name) != name}
    return fits.fit(tuple(parameters), [shared.fit.values | own, shared.fit.values])


@dataclass(frozen=True)
class _ReleasedParameters:
    """The outcome of the forward selection.

    Attributes
    ----------
    nearest : _JointFit
        With the parameters released that explain a difference.
    kept : list of str
        The other parameters.
    gains : dict of str to float
        Share that each parameter gained, or would gain.
    telling : bool
        Whether releasing all parameters gains more than chance makes.
    """

    nearest: _JointFit
    kept: list[str]
    gains: dict[str, float]
    telling: bool


def _release_in_turn(
    fits: _JointFitter, shared: _JointFit, separate: _JointFit, parameters: Sequence[str]
) -> _ReleasedParameters:
    """Release one parameter after the other, always that which brings the fit nearest."""
    search = fits.search
    total = shared.error - separate.error
    telling = total > _gain_by_chance(shared, len(parameters))
    nearest = shared
    gains: dict[str, float] = {}
    kept = list(parameters)
    while kept and total > 0.0:
        if search.budget.spent():
            search.budget.leave(kept)
            break
        search.progress(f"letting go of {', '.join(kept)}")
        tried = _release_each(fits, nearest, separate, kept)
        shares = {name: (nearest.error - one.error) / total for name, one in tried.items()}
        name = min(tried, key=lambda name: tried[name].error)
        difference, error = _difference(tried[name], name)
        if shares[name] < RELEVANT or abs(difference) < _PERHAPS * error:
            gains |= shares
            break
        nearest = tried[name]
        gains[name] = shares[name]
        kept.remove(name)
    return _ReleasedParameters(nearest, kept, gains, telling)


def _release_each(
    fits: _JointFitter, nearest: _JointFit, separate: _JointFit, names: Sequence[str]
) -> dict[str, _JointFit]:
    """Fit with each of some parameters released beside those that are."""
    origins = [nearest.fit.values, nearest.fit.values | separate.fit.values]
    tried = parallel_map(lambda name: fits.fit((*nearest.released, name), origins), names)
    return dict(zip(names, tried, strict=True))


def _gain_by_chance(shared: _JointFit, parameters: int) -> float:
    """Return what releasing parameters takes off the mean squared error if nothing changed.

    The likelihood ratio is then distributed as chi-square (Wilks).
    """
    samples = sum(len(e) for e in shared.fit.residual.values())
    return shared.error * float(chdtri(max(parameters, 1), ALPHA)) / samples


def _claims(
    fits: _JointFitter,
    released: _ReleasedParameters,
    separate: _JointFit,
    neutral: Mapping[str, float],
) -> list[Change]:
    """Return every parameter as it is in both records, those first that are claimed to differ."""
    nearest = released.nearest
    tried = len(separate.released)
    reported = fits.fit(separate.released, [nearest.fit.values | separate.fit.values])
    sure = [n for n in nearest.released if is_significantly_different(*_difference(nearest, n))]
    agreed = [name for name in sure if _stretches_agree(nearest, name, tried)]
    others = [name for name in (*nearest.released, *released.kept) if name not in agreed]
    owners = {
        name: label(effect) for effect in fits.candidate.effects for name in own_parameters(effect)
    }
    changes = []
    for name in (*agreed, *others):
        changed = name in agreed
        change = _change(nearest if changed else reported, name)
        changes.append(
            replace(
                change,
                changed=changed,
                uncertain=name in sure and not changed,
                gain=released.gains.get(name, 0.0) if released.telling else None,
                effect=owners.get(name, ""),
                neutral=neutral.get(name),
            )
        )
    return changes


def _difference(
    joint: _JointFit, name: str, covariance: Covariance | None = None
) -> tuple[float, float]:
    """Return by how much a released parameter differs, and the standard error of that.

    Both are in its searched coordinate.
    """
    i = joint.problem.names.index(name)
    j = joint.problem.names.index(_later(name))
    known = covariance or joint.fit.covariance
    difference = float(joint.fit.q[j] - joint.fit.q[i])
    if known.unidentifiable[[i, j]].any():
        return difference, np.inf
    variance = known.matrix[i, i] + known.matrix[j, j] - 2.0 * known.matrix[i, j]
    return difference, float(np.sqrt(max(variance, 0.0)))


def _stretches_agree(joint: _JointFit, name: str, tried: int) -> bool:
    """Return whether a parameter's difference is beyond what the stretches of both records vary.

    Their number is small, so Student's distribution tells how far off chance takes them; the
    threshold is for all parameters together.
    """
    difference, error = _difference(joint, name, _between_stretches(joint))
    threshold = float(-stdtrit(STRETCHES - 1, ALPHA / (2.0 * tried)))
    return abs(difference) > threshold * error


def _between_stretches(joint: _JointFit) -> Covariance:
    """Return the covariance of a fit by how much stretches of its records disagree."""
    problem = joint.problem
    scales = error_scales(problem)
    # every run is cut into as many stretches, numbered through
    stretch_of = np.zeros(len(problem.time), dtype=np.intp)
    for k, run in enumerate(problem.runs):
        count = run.last - run.first
        stretch_of[run.samples] = k * STRETCHES + np.arange(count) * STRETCHES // count
    residual, slopes = problem.evaluate(joint.fit.q)
    jacobian = np.vstack([slopes[o] / scales[o] for o in slopes])
    errors = np.concatenate([residual[o] / scales[o] for o in slopes])
    stretches = np.concatenate([stretch_of[problem.present[o]] for o in slopes])
    return clustered_covariance(
        parameter_covariance(jacobian.T @ jacobian), jacobian, errors, stretches
    )


def _change(joint: _JointFit, name: str) -> Change:
    """Return a parameter in both records as a fit has it, without a claim."""
    few = float(stdtrit(STRETCHES - 1, 0.975) / ndtri(0.975))
    errors = np.maximum(
        joint.fit.covariance.standard_errors, few * _between_stretches(joint).standard_errors
    )
    intervals = joint.problem.intervals(joint.fit.q, errors)
    later = _later(name)
    return Change(
        name=name,
        before=joint.fit.values[name],
        after=joint.fit.values[later],
        before_interval=intervals[name],
        after_interval=intervals[later],
        changed=False,
        uncertain=False,
        gain=None,
        declaration=joint.problem.declared[name],
    )
