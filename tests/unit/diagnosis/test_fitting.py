"""Claims: a fit is the least squares with priors that SciPy finds over the same samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import OptimizeResult, least_squares
from scipy.signal import lfilter

from fmus.kit.arrays import Array
from orchestration.diagnosis import Shape, Term
from orchestration.diagnosis.fitting import (
    Evaluated,
    Point,
    Problem,
    StartPrior,
    _downhill,
    _Search,
    by_least_squares,
    effective_samples,
    fit,
    fit_base,
    fit_from_pieces,
    fit_start,
    independent_weights,
    mean_squares,
    nominal_point,
    weights_of,
)
from orchestration.diagnosis.local_values import LocalValues
from orchestration.diagnosis.terms import Memory, NamedTerm, Released, SensorTerm
from orchestration.identify.fitting import Scale
from tests.support.diagnosed_mass import START, D, K, M, exact, mass, problem_of, pushed
from tests.support.oscillator import oscillator_record, unsearched

OFFSET = Term("spring", "", Shape.CONSTANT, size=2.0)
TRUTH = (2.5, 24.0, 2.2)
STARTS = (np.array([0.03, 0.0]), np.array([-0.01, 0.2]))


def drawn(noise: float, offset: float = 0.0, gaps: int = 0) -> Problem:
    """Return the problem of two records of a mass with other values, each with its own start."""
    rng = np.random.default_rng(3)
    records = []
    for count, start in zip((150, 110), STARTS, strict=True):
        record = pushed(count)
        states = exact(record, TRUTH, start, record.inputs[:, 0] - offset)
        outputs = states[:, :1] + noise * rng.standard_normal((count, 1))
        outputs[rng.choice(count, gaps, replace=False)] = np.nan
        records.append(replace(record, outputs=outputs))
    return problem_of(records)


def by_scipy(problem: Problem, weights: list[Array], offset: bool) -> OptimizeResult:
    """Minimise the same residuals over logarithms of parameters, coefficient and both starts."""

    def residuals(theta: Array) -> Array:
        values = np.array([M, K, D]) * np.exp(theta[:3])
        coefficient = theta[3] if offset else 0.0
        parts = [theta[:3] / np.log(10.0), [coefficient / 10.0]]
        for r, record in enumerate(problem.records):
            start = START + theta[4 + 2 * r : 6 + 2 * r] * np.array([0.01, 0.1])
            push = record.inputs[:, 0] - 2.0 * coefficient
            error = record.outputs[:, 0] - exact(record, tuple(values), start, push)[:, 0]
            error *= np.sqrt(weights[r][0]) / problem.spread[0]
            parts += [error[np.isfinite(error)], theta[4 + 2 * r : 6 + 2 * r]]
        return np.concatenate(parts)

    return least_squares(residuals, np.zeros(8), xtol=1e-12, ftol=1e-12)


@pytest.mark.parametrize("gaps", [0, 30])
def test_a_fit_is_that_of_scipy(gaps: int) -> None:
    """Parameters, a coefficient, and the start states of two records."""
    problem = drawn(0.01, 1.2, gaps)
    weights = [np.array([30.0]), np.array([12.0])]
    found = fit(problem, (OFFSET,), [nominal_point(problem, (OFFSET,))], weights, 60, 1e-7)
    assert found is not None
    expected = by_scipy(problem, weights, True)
    assert found.cost == pytest.approx(expected.cost, rel=1e-4)
    p = found.point
    own = [np.log(problem.parameters(p.q)[:3] / [M, K, D]), p.values]
    own += [(start - START) / [0.01, 0.1] for start in p.starts]
    deviation = np.sqrt(np.diag(np.linalg.inv(expected.jac.T @ expected.jac)))
    assert (np.concatenate(own) - expected.x) / deviation == pytest.approx(np.zeros(8), abs=0.02)
    # in logarithms of parameters and deviations of the starts, as the oracle searches
    assert found.curvature == pytest.approx(expected.jac.T @ expected.jac, rel=0.02, abs=0.02)
    assert [int(np.isnan(e).sum()) for e in found.errors] == [gaps, gaps]


def test_a_strength_stays_in_its_range_where_it_has_slopes() -> None:
    released = Released("stiffening", "1/m^2", Scale(False, 1.0), 0.0, 10.0)
    term = NamedTerm("spring", "x", Shape.LINEAR, effect="stiffening", released=(released,))
    assert [end.tolist() for end in term.bounds] == [[0.0], [10.0]]
    search = _Search(drawn(0.01), (term,), [np.array([30.0])] * 2)
    begin = nominal_point(search.problem, (term,))
    down = np.zeros(search.size + 4)
    down[len(begin.q)] = -5.0
    assert search.moved(begin, down).values.tolist() == [0.0]
    assert search.moved(begin, -10.0 * down).values.tolist() == [10.0]


def local_by_scipy(problem: Problem, weights: list[Array]) -> OptimizeResult:
    """Minimise the same residuals with a stiffness and an offset of each of two records."""

    def residuals(theta: Array) -> Array:
        m, *stiffness, d, first, second = theta[:6]
        parts = [np.array([m, *stiffness, d]) / np.log(10.0), np.array([first, second]) / 10.0]
        for r, record in enumerate(problem.records):
            start = START + theta[6 + 2 * r : 8 + 2 * r] * np.array([0.01, 0.1])
            values = M * np.exp(m), K * np.exp(stiffness[r]), D * np.exp(d)
            push = record.inputs[:, 0] - 2.0 * (first, second)[r]
            error = record.outputs[:, 0] - exact(record, values, start, push)[:, 0]
            parts += [error * np.sqrt(weights[r][0]) / problem.spread[0]]
            parts += [theta[6 + 2 * r : 8 + 2 * r]]
        return np.concatenate(parts)

    return least_squares(residuals, np.zeros(10), xtol=1e-12, ftol=1e-12)


@pytest.mark.parametrize("way", ["each", "later"])
def test_a_fit_with_local_values_is_that_of_scipy(way: str) -> None:
    """A stiffness and an offset of the spring that two records do not share."""
    plain = drawn(0.01, 1.2)
    records = tuple(replace(record, group=r) for r, record in enumerate(plain.records))
    named = {way: ("stiffness",)}
    local = LocalValues(("a", "b"), later_values=((0,),), **named)
    problem = replace(plain, records=records, local=local)
    weights = [np.array([30.0]), np.array([12.0])]
    begin = nominal_point(problem, (OFFSET,))
    begin = replace(begin, values=np.append(begin.values, begin.values))
    found = fit(problem, (OFFSET,), [begin], weights, 60)
    assert found is not None
    expected = local_by_scipy(problem, weights)
    assert found.cost == pytest.approx(expected.cost, rel=1e-4)
    deviation = np.sqrt(np.diag(np.linalg.inv(expected.jac.T @ expected.jac)))
    # mass, stiffness, damping, then the other stiffness
    order = [0, 1, 3, 2, 4, 5]
    own = np.append(found.point.q - problem.mean, found.point.values)
    off = (own - expected.x[order]) / deviation[order]
    assert off == pytest.approx(np.zeros(6), abs=0.02)
    whole = [*order, *range(6, 10)]
    curvature = (expected.jac.T @ expected.jac)[np.ix_(whole, whole)]
    assert found.curvature == pytest.approx(curvature, rel=0.02, abs=0.02)
    assert problem.names == ["mass", "stiffness@a", "damping", "stiffness@b"]
    for group in (0, 1):
        stiffness = K * np.exp(expected.x[1 + group])
        assert problem.parameters(found.point.q, group)[1] == pytest.approx(stiffness, rel=1e-3)


def test_local_values_of_a_record_are_fitted_with_its_start() -> None:
    """The common values are those of the truth, by which the record was made."""
    records = [replace(record, group=r) for r, record in enumerate(drawn(1e-4).records)]
    local = LocalValues(("a", "b"), each=("stiffness",))
    problem = replace(problem_of(records), local=local)
    q = problem.mean + np.log(np.array([TRUTH[0] / M, 1.0, TRUTH[2] / D, 1.0]))
    begin = replace(nominal_point(problem), q=q)
    prior = StartPrior(START, np.array([0.05, 0.3]))
    begun = fit_start(problem, begin, (), records[1], prior, np.array([1e6]), local=1)
    assert begun is not None
    point, start = begun
    assert problem.parameters(point.q, 1)[1] == pytest.approx(TRUTH[1], rel=2e-3)
    assert problem.parameters(point.q, 0)[1] == pytest.approx(K)
    assert start == pytest.approx(STARTS[1], abs=2e-3)


@pytest.mark.parametrize(("share", "low", "high"), [(1.0, -2.0, -0.5), (-2.0, -0.1, 0.0)])
def test_a_sensor_that_lags_enlarges_no_change(share: float, low: float, high: float) -> None:
    """It takes a share of what a lag does not follow; one that overshoots is another fault."""
    exact = oscillator_record(3, noise=0.0)
    position, keep = exact.signals["position"], np.exp(-0.02 / 0.1)
    lagging = lfilter([1.0 - keep], [1.0, -keep], position)
    shown = position - share * (position - lagging)
    record = replace(exact, signals=exact.signals | {"position": shown})
    lag = SensorTerm("position", "position", Shape.LINEAR, Memory.FADING, (0.2,))
    problem = unsearched(record).subject.problem
    start = nominal_point(problem, (lag,))
    true = replace(start, values=np.array([-share, np.log(0.1)]))  # as a screen may have it
    found = fit(problem, (lag,), [start, true], weights_of([shown[:, None]]))
    assert found is not None
    assert low <= found.values_of(lag)[0] <= high


def test_the_truth_is_found_in_little_noise() -> None:
    problem = drawn(1e-4, 1.2)
    found = fit(problem, (OFFSET,), [nominal_point(problem, (OFFSET,))], [np.array([1e6])] * 2, 60)
    assert found is not None
    assert problem.parameters(found.point.q)[:3] == pytest.approx(TRUTH, rel=2e-3)
    assert found.values_of(OFFSET) == pytest.approx([0.6], rel=5e-3)
    for own, start in zip(found.point.starts, STARTS, strict=True):
        assert own == pytest.approx(start, abs=2e-3)


def test_the_model_without_terms_is_fitted_in_its_own_noise() -> None:
    problem = drawn(0.01)
    found = fit_base(problem)
    assert found is not None
    expected = by_scipy(problem, weights_of(found.errors), False)
    values = np.array([M, K, D]) * np.exp(expected.x[:3])
    assert problem.parameters(found.point.q)[:3] == pytest.approx(values, rel=0.015)
    assert found.misfit * problem.spread[0] == pytest.approx(0.01, rel=0.1)


def test_a_resonance_far_from_nominal_is_found_along_pieces() -> None:
    """A quarter of the natural frequency, little damping: no slope of a whole run leads there."""
    truth, record = (M, K / 16.0, 0.02 * D), pushed(2000)
    push = np.random.default_rng(6).normal(0.0, 5.0, len(record.time))
    outputs = exact(record, truth, START, push)[:, :1]
    problem = problem_of([replace(record, inputs=push[:, None], outputs=outputs)])
    base = fit_base(problem)
    assert base is not None
    assert base.misfit > 0.5
    found = fit_from_pieces(base)
    assert problem.parameters(found.point.q)[:3] == pytest.approx(truth, rel=1e-3)


def test_priors_do_not_hold_parameters_back_where_the_model_misses_something_slow() -> None:
    """A stiffness of a tenth, and an offset that wanders: few samples of the rest are independent.

    The oracle has no prior on parameters.
    """
    record = pushed(400)
    states = exact(record, (M, 0.1 * K, D), START, record.inputs[:, 0])
    wander = states[:, :1].std() * np.sin(0.4 * record.time)[:, None]
    problem = problem_of([replace(record, outputs=states[:, :1] + wander)])
    base = fit_base(problem)
    assert base is not None
    found = by_least_squares(base)
    (weights,) = weights_of(found.errors)

    def residuals(theta: Array) -> Array:
        values = np.array([M, K, D]) * np.exp(theta[:3])
        run = exact(record, tuple(values), START + theta[3:] * [0.01, 0.1], record.inputs[:, 0])
        error = (problem.records[0].outputs - run[:, :1])[:, 0] / problem.spread[0]
        return np.append(error * np.sqrt(weights[0]), theta[3:])

    expected = least_squares(residuals, np.log([1.0, 0.1, 1.0, np.e, np.e]), x_scale=0.1)
    values = np.array([M, K, D]) * np.exp(expected.x[:3])
    assert problem.parameters(found.point.q)[:3] == pytest.approx(values, rel=0.03)
    assert found.point.starts[0] == pytest.approx(START + expected.x[3:] * [0.01, 0.1], abs=5e-3)
    assert found.problem is base.problem


def test_without_data_the_prior_decides() -> None:
    """From a point that is off in everything."""
    problem = drawn(0.01)
    term = Term("friction", "v", Shape.DRY, Memory.LAG, (0.5,), size=1.0, scale=0.5, width=0.3)
    begin = Point(
        problem.mean + 0.7,
        np.append(2.0, term.start + 0.4),
        (START + 0.02, START - 0.02),
    )
    found = fit(problem, (term,), [begin], [np.zeros(1)] * 2, 60)
    assert found is not None
    assert problem.parameters(found.point.q)[:3] == pytest.approx([M, K, D], rel=1e-2)
    assert found.point.values == pytest.approx([0.0, np.log(0.5), np.log(0.3)], abs=0.03)
    assert found.point.starts[0] == pytest.approx(START, abs=1e-3)


def test_a_parameter_that_is_held_keeps_its_value() -> None:
    problem = replace(drawn(0.01), hold=frozenset({"mass"}), values={"mass": 3.0})
    found = fit_base(problem)
    assert found is not None
    fitted = problem.parameters(found.point.q)
    assert fitted[0] == 3.0
    assert fitted[1] != K


def test_the_lowest_of_several_starts_goes_on() -> None:
    """One runs away, one is where the prior of the width keeps it."""
    problem = drawn(0.01, 1.2)
    weights = [np.array([30.0])] * 2
    good = nominal_point(problem, (OFFSET,))
    unstable = Term("friction", "v", Shape.LINEAR)
    away = replace(nominal_point(problem, (unstable,)), values=np.array([-300.0]))
    assert fit(problem, (unstable,), [away], weights) is None
    near = nominal_point(problem, (unstable,))
    both = fit(problem, (unstable,), [away, near], weights)
    alone = fit(problem, (unstable,), [near], weights)
    assert both is not None
    assert alone is not None
    assert both.cost == alone.cost
    far = replace(good, values=np.array([40.0]))
    best = min(
        (fit(problem, (OFFSET,), [p], weights, 0) for p in (far, good)), key=lambda f: f.cost
    )
    both = fit(problem, (OFFSET,), [far, good], weights, 0)
    assert both is not None
    assert both.cost == pytest.approx(best.cost, rel=1e-4)


def test_nobody_goes_from_a_start_that_foresees_no_lower_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A trajectory linear in what is fitted has its end foreseen exactly, from anywhere."""
    problem = drawn(0.01, 1.2)
    problem = replace(problem, hold=frozenset(p.name for p in problem.model.parameters))
    begun: list[float] = []
    descend = _Search.descend

    def watched(
        self: _Search, at: tuple[Point, Evaluated], most: int, flat: float, **trial: bool
    ) -> object:
        begun.append(at[1].foreseen)
        return descend(self, at, most, flat, **trial)

    monkeypatch.setattr(_Search, "descend", watched)
    good = nominal_point(problem, (OFFSET,))
    far = [replace(good, values=np.array([value])) for value in (5.0, 9.0)]
    fitted = fit(problem, (OFFSET,), [*far, good], [np.array([30.0])] * 2)
    assert fitted is not None
    assert len(begun) == 2, "one start, and the last descent"
    assert begun[0] == pytest.approx(fitted.cost, rel=1e-6)


def test_nominal_parameters_are_tried_though_other_starts_are_nearer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of four nearer starts three are tried, the nearest; nominal parameters get more steps."""
    problem = drawn(0.01)
    best = fit_base(problem)
    assert best is not None
    monkeypatch.setattr(Evaluated, "may_fall", lambda *args: True)  # all lead to the same end
    near = [replace(best.point, q=best.point.q + 0.01 * k) for k in range(4)]
    tried: list[tuple[bool, int]] = []
    descend = _Search.descend

    def watched(
        self: _Search, at: tuple[Point, Evaluated], most: int, flat: float, **trial: bool
    ) -> object:
        tried.append((bool(np.array_equal(at[0].q, problem.mean)), most))
        return descend(self, at, most, flat, **trial)

    monkeypatch.setattr(_Search, "descend", watched)
    weights = weights_of(best.errors)
    fitted = fit(problem, (), [nominal_point(problem), *near], weights)
    assert fitted is not None
    assert fitted.misfit == pytest.approx(best.misfit, rel=1e-3)
    assert [is_nominal for is_nominal, _ in tried[:-1]] == [False] * 3 + [True]
    assert tried[3][1] > tried[0][1]


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_effective_samples_of_an_autoregression(rho: float) -> None:
    """n (1 - rho) / (1 + rho), in the mean of many."""
    counts = []
    for seed in range(20):
        white = np.random.default_rng(seed).standard_normal(4000)
        counts.append(effective_samples(lfilter([1.0], [1.0, -rho], white)))
    assert np.mean(counts) == pytest.approx(4000 * (1.0 - rho) / (1.0 + rho), rel=0.15)


def test_gaps_have_no_effective_samples() -> None:
    error = np.random.default_rng(0).standard_normal(400)
    gapped = np.insert(error, np.arange(0, 400, 4), np.nan)
    assert effective_samples(gapped) == effective_samples(error)
    assert effective_samples(np.full(5, np.nan)) == 0.0


def test_an_error_that_comes_again_in_each_period_is_one() -> None:
    """The phases of noise have nothing in common, in the mean of many."""
    rng = np.random.default_rng(3)
    phases = np.tile(np.arange(50), 20)
    wave = np.tile(rng.standard_normal(50), 20)
    assert effective_samples(wave, phases) == pytest.approx(50.0, rel=0.2)
    counts = [effective_samples(rng.standard_normal(1000), phases) for _ in range(20)]
    assert np.mean(counts) == pytest.approx(1000.0, rel=0.15)


def test_weights_pool_the_variance_of_all_records() -> None:
    """A record that is fitted worse weighs no less."""
    rng = np.random.default_rng(1)
    errors = [rng.standard_normal((4000, 1)), 3.0 * rng.standard_normal((4000, 1))]
    white = weights_of(errors)
    assert [w[0] for w in white] == pytest.approx([1.0 / 5.0] * 2, rel=0.1)
    coloured = [lfilter([1.0], [1.0, -0.8], e, axis=0) for e in errors]
    variance = 5.0 / (1.0 - 0.8**2)
    expected = (1.0 - 0.8) / (1.0 + 0.8) / variance
    assert [w[0] for w in weights_of(coloured)] == pytest.approx([expected] * 2, rel=0.25)


def test_no_output_is_given_up_that_a_wrong_model_follows_slowly() -> None:
    """Of errors as large, those that are slow weigh as much in a search as those that are white."""
    rng = np.random.default_rng(2)
    white = rng.standard_normal(4000)
    slow = lfilter([1.0], [1.0, -0.99], rng.standard_normal(4000))
    both = np.column_stack([e / np.sqrt(np.mean(e**2)) for e in (white, slow)])
    (search,), (independent,) = weights_of([both]), independent_weights([both])
    assert search[0] == pytest.approx(search[1], rel=0.01)
    assert search[0] == pytest.approx(independent.mean(), rel=0.01), "of as many samples in all"
    assert independent[1] < 0.05 * independent[0]


def test_the_start_of_a_record_is_a_least_square_with_its_prior() -> None:
    """Positions are linear in the start of a linear mass."""
    problem = drawn(0.02, gaps=20)
    record = problem.records[0]
    prior = StartPrior(START, np.array([0.05, 0.3]))
    weight = np.array([4.0])
    found = fit_start(problem, nominal_point(problem), (), record, prior, weight)
    assert found is not None
    held = exact(record, (M, K, D), START, record.inputs[:, 0])[:, 0]
    still = np.zeros(len(record.time))
    columns = [exact(record, (M, K, D), np.eye(2)[i], still)[:, 0] for i in range(2)]
    scale = 2.0 / problem.spread[0]
    rows = np.column_stack(columns) * prior.deviation * scale
    e = (record.outputs[:, 0] - held) * scale
    present = np.isfinite(e)
    rows, e = rows[present], e[present]
    z = np.linalg.solve(rows.T @ rows + np.eye(2), rows.T @ e)
    assert np.abs(z).max() > 0.1
    assert found[1] == pytest.approx(START + z * prior.deviation, rel=1e-4)


def test_distance_is_in_deviations_of_the_prior() -> None:
    problem = drawn(0.01)
    found = fit(problem, (), [nominal_point(problem)], [np.array([30.0])] * 2, 0)
    assert found is not None
    moved = replace(
        found, point=replace(found.point, q=problem.mean + np.array([np.log(10.0), 0.0, 0.0]))
    )
    assert moved.distance == pytest.approx(0.5)


def test_values_are_those_of_the_term() -> None:
    problem = drawn(0.01)
    curve = Term("spring", "x", Shape.CURVE, places=(-1.0, 0.0, 1.0))
    point = nominal_point(problem, (curve, OFFSET))
    found = fit(problem, (curve, OFFSET), [point], [np.zeros(1)] * 2, 0)
    assert found is not None
    found = replace(found, point=replace(point, values=np.arange(4.0)))
    assert found.values_of(curve) == pytest.approx([0.0, 1.0, 2.0])
    assert found.values_of(OFFSET) == pytest.approx([3.0])
    assert mass().laws.index("spring") >= 0
    assert found.freedom == 3


def test_an_output_that_was_not_measured_has_no_mean_and_no_warning() -> None:
    errors = np.column_stack([[1.0, np.nan, 3.0], np.full(3, np.nan)])
    assert mean_squares(errors) == pytest.approx([5.0, np.nan], nan_ok=True)
    assert np.isfinite(weights_of([errors])[0][0])


def test_a_step_that_was_damped_keeps_its_damping() -> None:
    """Of a valley that is forty times as steep as slopes say: what was too long once is again.

    A step with the damping c goes from x to ``x (1 - 40 / (1 + c))``, and is taken if that is
    nearer to the bottom.
    """
    tried: list[float] = []

    def evaluate(place: Array) -> Evaluated:
        (x,) = place.tolist()
        tried.append(x)
        return Evaluated(20.0 * x**2, np.eye(1), np.array([-40.0 * x]), ())

    begin = np.array([1e3])
    _downhill(evaluate, np.add, (begin, evaluate(begin)), 2, 1e-4)
    too_long = [0.01 * 6.0**k for k in range(5)]
    assert all(abs(1.0 - 40.0 / (1.0 + damping)) > 1.0 for damping in too_long)
    taken = 1.0 - 40.0 / (1.0 + 6.0 * too_long[-1])
    shares = [*(1.0 - 40.0 / (1.0 + damping) for damping in too_long), taken, taken**2]
    assert np.array(tried[1:]) / begin == pytest.approx(shares)


def test_a_parameter_ends_where_steps_are_too_long_for_the_fastest_rate() -> None:
    """A mass on a strong damper may be so light that a step is 2.4 of its time constant."""
    problem = drawn(0.01)
    step = max(float(np.diff(record.time).max()) for record in problem.records) / 20.0
    damping = 0.7 * M / step  # beside which the spring is weak: the fastest rate is damping / mass
    stiff = replace(problem, substeps=20, values={"damping": damping})
    at = stiff.names.index("mass")
    least = float(np.exp(stiff.bounds[0][at]))
    assert 0.7 / 2.4 * M <= least < 0.36 * M
    assert np.exp(stiff.bounds[1][at]) == pytest.approx(100.0)  # as declared
    assert np.exp(problem.bounds[0][at]) == pytest.approx(0.01)
