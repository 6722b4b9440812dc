"""Claims: ARX is least squares, ARMAX undoes its bias, Box-Jenkins models come back from noise.

Standard errors are the scatter, a measured wall is foretold as well as is known, mistakes are
refused in one line. Oracles: statsmodels, and timeseries-toolbox, whose authors follow Ljung and
Box and Jenkins.
"""

import time

import numpy as np
import pytest
import statsmodels.api as sm
from statsmodels.tsa.statespace.sarimax import SARIMAX
from TimeSeriesSRC.Model.estimate import estimate
from TimeSeriesSRC.Model.model import pmodel

from fmus.kit.errors import UserError
from orchestration.identify.black_box import (
    armax,
    arx,
    box_jenkins,
    input_output_data,
    output_error,
    state_space,
)
from tests.support.black_box import BOX_JENKINS, box_jenkins_record, fit, response
from tests.support.pace import slow_but

A, B, C = [1.0, -1.2, 0.5], [0.0, 0.8, 0.3], [1.0, 0.7]


def armax_record(seed, samples=4000):
    random = np.random.default_rng(seed)
    u, e = random.standard_normal(samples), 0.5 * random.standard_normal(samples)
    return input_output_data(u, response(B, A, u) + response(C, A, e), 0.2)


def test_arx_is_the_least_squares_of_statsmodels():
    record = box_jenkins_record(2, 300)
    data = input_output_data(record.inputs, record.output, 1.0)
    result = arx(data, 2, [2, 1], [1, 3])
    y, (u, v) = record.output, record.inputs.T
    columns = np.column_stack([-y[2:-1], -y[1:-2], u[2:-1], u[1:-2], v[:-3], np.ones(297)])
    oracle = sm.OLS(y[3:], columns).fit()
    assert [p.name for p in result.parameters] == ["a1", "a2", "b1_1", "b1_2", "b2_3"]
    assert [p.value for p in result.parameters] == pytest.approx(oracle.params[:5], rel=1e-8)
    assert [p.standard_error for p in result.parameters] == pytest.approx(oracle.bse[:5], rel=1e-8)
    assert result.covariance == pytest.approx(oracle.cov_params()[:5, :5], rel=1e-7)
    assert result.residual == pytest.approx(oracle.resid, abs=1e-8)
    assert result.model.noise_variance == pytest.approx(oracle.scale)
    # per sample, without the constant that both leave out of a Gaussian likelihood
    constant = np.log(2.0 * np.pi) + 1.0
    assert result.aic == pytest.approx(oracle.aic / 297 - constant)
    assert result.bic == pytest.approx(oracle.bic / 297 - constant)


@pytest.mark.slow
def test_armax_has_no_bias_where_arx_has():
    found = [armax(armax_record(seed), 2, 2, 1) for seed in range(5)]
    for name, value in {"a1": A[1], "a2": A[2], "b1_1": B[1], "b1_2": B[2], "c1": C[1]}.items():
        scored = [
            (r.parameter(name).value - value) / r.parameter(name).standard_error for r in found
        ]
        assert np.abs(np.mean(scored)) < 3.0 / np.sqrt(5)
        assert max(np.abs(scored)) < 4.0
    wrong = arx(armax_record(0), 2, 2).parameter("a1")
    assert abs(wrong.value - A[1]) > 10.0 * wrong.standard_error


def test_identified_models_are_stable_even_where_the_noise_is_a_random_walk():
    random = np.random.default_rng(1)
    u = random.standard_normal(500)
    data = input_output_data(
        u, 0.1 * np.cumsum(random.standard_normal(500)) + response(B, A, u), 1.0
    )
    result = box_jenkins(data, 2, 2, 1, 1)
    assert all(
        np.abs(np.roots(polynomial)).max() < 1.0
        for polynomial in (*result.model.f, result.model.c, result.model.d)
    )
    assert result.parameter("f1_1").value == pytest.approx(A[1], abs=0.05)


def test_a_record_that_begins_mid_course_is_no_worse():
    record = box_jenkins_record(9, 3000)
    late = input_output_data(record.inputs[1000:], record.output[1000:], 1.0)
    result = output_error(late, [2, 2], [2, 1], [1, 2])
    assert fit(record.truth[1000:], result.model.simulate(late.inputs, late.output)) > 98.0


@pytest.fixture(scope="module")
def kept_in_place():
    """Return data of an unstable system that feedback stabilises."""
    random = np.random.default_rng(0)
    u, y = random.standard_normal(5000), np.zeros(5000)
    for t in range(1, 5000):
        y[t] = 1.2 * y[t - 1] + u[t - 1] + 0.1 * random.standard_normal()
        u[t] -= 0.7 * y[t]
    return input_output_data(u, y, 1.0)


def test_an_unstable_system_is_found_and_told(kept_in_place):
    for result in (arx(kept_in_place, 1, 1), armax(kept_in_place, 1, 1, 1)):
        assert result.parameter("a1").value == pytest.approx(-1.2, abs=0.01)
        assert not result.model.is_stable()
        assert (
            result.messages[-1] == "the model is unstable: a free run will not stay near the record"
        )
        assert result.fit == -np.inf
        assert result.model.fit(kept_in_place, 1) > 85.0
        assert "free-run fit -inf %" in result.summary()


def data(samples=200, **changed):
    record = box_jenkins_record(0, samples)
    return input_output_data(
        record.inputs, record.output, 0.5, ["force", "current"], "displacement"
    )


@pytest.mark.parametrize(
    ("find", "said"),
    [
        (lambda: state_space(data(), 2.5), r"^order = 2\.5: must be a whole number, at least 1$"),
        (lambda: state_space(data(), 0), r"^order = 0: must be a whole number, at least 1$"),
        (
            lambda: state_space(data(60), 4),
            r"^60 samples are too few for 4 states and 2 inputs: at least 144 ",
        ),
        (lambda: state_space(data(), 2, [0, 1, 1]), r"^nk = \[0, 1, 1\]: must be one number"),
        (
            lambda: arx(data(), 1, 1).model.poles("voltage"),
            r"^input voltage: there is none \(there are: force",
        ),
        (
            lambda: arx(data(), 1, 1).model.predict(data(), 0),
            r"^horizon = 0: must be a whole number, at least 1$",
        ),
        (
            lambda: arx(data(), 1, 1).model.simulate(np.ones((5, 3))),
            r"^inputs of shape \(5, 3\): must be \(n, 2\)",
        ),
    ],
)
def test_what_is_not_possible_is_told_in_one_line(find, said):
    with pytest.raises(UserError, match=said) as caught:
        find()
    assert "\n" not in str(caught.value)


SEEDS = range(20)


def identified(record, find=box_jenkins, **more):
    data = input_output_data(
        record.inputs, record.output, 0.1, ["force", "current"], "displacement"
    )
    return find(data, nb=[2, 2], nf=[2, 1], nk=[1, 2], **more)


@pytest.fixture(scope="module")
def records():
    return [box_jenkins_record(seed) for seed in SEEDS]


@pytest.fixture(scope="module")
def found(records):
    return [identified(record, nc=1, nd=1) for record in records]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("offset", "d1", "least"),
    slow_but(
        [(0.0, -0.8, 99.0), (3.0, 0.5, 99.0), (3.0, -0.8, 98.7)],
        (3.0, -0.8, 98.7),
    ),
)
def test_the_free_run_is_the_truth_within_a_percent(offset, d1, least):
    """Allow more where an offset is estimated in red noise.

    The mean of that noise alone costs 0.7 % of 2000 samples.
    """
    fits = []
    for seed in SEEDS[:10]:
        record = box_jenkins_record(seed, offset=offset, d1=d1)
        model = identified(record, nc=1, nd=1).model
        fits.append(fit(record.truth, model.simulate(record.inputs, before=[0, 0])))
    assert np.median(fits) >= least
    assert min(fits) >= 97.0


@pytest.mark.slow
def test_parameters_are_the_true_ones_within_three_percent_or_two_standard_errors(found):
    off = [
        (seed, p.name, p.value)
        for seed, result in zip(SEEDS, found, strict=True)
        for p in result.parameters
        if abs(p.value - BOX_JENKINS[p.name])
        > max(0.03 * abs(BOX_JENKINS[p.name]), 2.0 * p.standard_error)
    ]
    assert [p.name for p in found[0].parameters] == list(BOX_JENKINS)
    assert len(off) <= 0.05 * len(SEEDS) * len(BOX_JENKINS), off
    for name, value in BOX_JENKINS.items():
        assert np.median([result.parameter(name).value for result in found]) == pytest.approx(
            value, rel=0.03
        )


def scores(results, names):
    return np.array(
        [
            [(r.parameter(n).value - BOX_JENKINS[n]) / r.parameter(n).standard_error for n in names]
            for r in results
        ]
    )


@pytest.mark.slow
def test_standard_errors_are_the_scatter(found):
    assert np.sqrt(np.mean(scores(found, BOX_JENKINS) ** 2)) == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
def test_standard_errors_of_output_error_models_allow_for_coloured_noise(records):
    results = [identified(record, output_error) for record in records]
    paths = [name for name in BOX_JENKINS if name[0] in "bf"]
    assert np.sqrt(np.mean(scores(results, paths) ** 2)) == pytest.approx(1.0, abs=0.2)
    assert results[0].parameter("b1_1").standard_error == pytest.approx(
        np.sqrt(results[0].covariance[0, 0])
    )


@pytest.mark.slow
def test_residuals_are_white_and_those_of_output_error_models_are_not(records, found):
    assert sum(result.residual_tests().passed for result in found) >= 18
    result = identified(records[0], output_error).residual_tests()
    assert not result.whiteness.is_white
    assert all(cross.is_independent for cross in result.inputs)


def test_noise_model_agrees_with_statsmodels():
    """Without poles in its path a Box-Jenkins model is a regression with ARMA errors."""
    random = np.random.default_rng(5)
    record = box_jenkins_record(5, 3000)
    u = random.standard_normal(3000)
    noise = record.output - record.truth
    y = 2.0 + 0.3 * u + noise
    result = box_jenkins(input_output_data(u, y, 1.0), nb=1, nf=0, nc=1, nd=1, nk=0)
    oracle = SARIMAX(y, np.column_stack([np.ones(3000), u]), order=(1, 0, 1)).fit(disp=False)
    b, ar, ma, variance = oracle.params[1:]
    ours = {p.name: p for p in result.parameters}
    assert ours["b1_0"].value == pytest.approx(b, abs=0.1 * oracle.bse[1])
    assert -ours["d1"].value == pytest.approx(ar, abs=0.1 * oracle.bse[2])
    assert ours["c1"].value == pytest.approx(ma, abs=0.1 * oracle.bse[3])
    assert ours["b1_0"].standard_error == pytest.approx(oracle.bse[1], rel=0.1)
    assert result.model.noise_variance == pytest.approx(variance, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-7, 1e6])
def test_units_do_not_matter(records, found, scale):
    data = input_output_data(
        records[0].inputs * [scale, 1.0 / scale], records[0].output * scale, 0.1
    )
    result = box_jenkins(data, [2, 2], [2, 1], 1, 1, [1, 2])
    assert result.fit == pytest.approx(found[0].fit, abs=1e-3)
    assert result.parameter("f1_1").value == pytest.approx(
        found[0].parameter("f1_1").value, abs=1e-4
    )
    assert result.parameter("b1_1").value == pytest.approx(
        found[0].parameter("b1_1").value, rel=1e-3
    )


@pytest.mark.slow
def test_large_offsets_do_not_matter(records, found):
    data = input_output_data(
        records[0].inputs + np.array([1e4, -300.0]), records[0].output + 1e5, 0.1
    )
    result = box_jenkins(data, [2, 2], [2, 1], 1, 1, [1, 2])
    assert result.fit == pytest.approx(found[0].fit, abs=1e-2)
    assert (
        "offset: the model is about y = 100003 at u1 = 9999.98, u2 = -300.028" in result.messages[0]
    )


def test_data_without_noise_give_the_system_itself():
    record = box_jenkins_record(1, 400, ratio=400.0)
    result = identified(record, nc=0, nd=0)
    for p in result.parameters:
        assert p.value == pytest.approx(BOX_JENKINS[p.name], rel=1e-6)
    assert np.isfinite([result.aic, result.bic]).all()


def test_poles_of_stiff_slow_paths_are_found():
    """One path a hundred times slower than the other, both well within one record."""
    random = np.random.default_rng(8)
    u = np.repeat(np.sign(random.standard_normal((200, 2))), 50, axis=0)
    record = box_jenkins_record(8, len(u))
    slow, fast = 0.999, 0.9
    y = np.zeros(len(u))
    x1 = x2 = 0.0
    for t in range(1, len(u)):
        x1, x2 = slow * x1 + (1 - slow) * u[t - 1, 0], fast * x2 + (1 - fast) * u[t - 1, 1]
        y[t] = x1 + x2
    y += 0.02 * (record.output - record.truth)
    result = box_jenkins(input_output_data(u, y, 0.01), 1, 1, 1, 1, 1)
    poles = [float(result.model.s_plane_poles(i)[0].real) for i in range(2)]
    assert poles[0] == pytest.approx(np.log(slow) / 0.01, rel=0.05)
    assert poles[1] == pytest.approx(np.log(fast) / 0.01, rel=0.05)


@pytest.mark.slow
def test_a_hundred_thousand_samples_take_seconds():
    record = box_jenkins_record(3, 100_000)
    started = time.process_time()
    result = identified(record, nc=1, nd=1)
    assert time.process_time() - started < 20.0
    assert fit(record.truth, result.model.simulate(record.inputs, before=[0, 0])) >= 99.8


@pytest.fixture(scope="module")
def halves(public_data):
    table = np.loadtxt(public_data("two_layer_wall.csv"), delimiter=",", skiprows=1)
    return input_output_data(
        table[:, 1:3], table[:, 3], 1.0, ["internal", "external"], "heat_flux"
    ).split()


def test_box_jenkins_foretells_the_second_half_of_a_measured_wall(halves):
    estimation, validation = halves
    result = box_jenkins(estimation, 2, 2, 2, 2, 0)
    assert result.model.fit(validation) >= 84.6
    # run on from the first half, without a look at the second
    inputs = np.vstack([estimation.inputs, validation.inputs])
    assert fit(validation.output, result.model.simulate(inputs)[len(estimation) :]) >= 84.6
    assert result.residual_tests().passed


def test_arx_foretells_a_measured_wall_as_well_as_is_known(halves):
    estimation, validation = halves
    assert arx(estimation, 3, 3, 0).model.fit(validation) == pytest.approx(80.0, abs=1.5)
    assert arx(estimation, 4, 4, 0).model.fit(validation) == pytest.approx(80.0, abs=1.5)


@pytest.mark.parametrize(
    "find",
    [
        lambda d: armax(d, 3, 3, 1, 0),
        lambda d: output_error(d, 2, 2, 0),
        lambda d: state_space(d, 3, 0),
    ],
    ids=["ARMAX", "OE", "SS"],
)
def test_the_other_structures_foretell_a_measured_wall(halves, find):
    estimation, validation = halves
    assert find(estimation).model.fit(validation) >= 84.6


TOOLBOX_SEEDS = range(100, 110)


def of_the_toolbox(record, seed):
    """Free run over the inputs, about their means, for the toolbox estimates no offset."""
    np.random.seed(seed)  # noqa: NPY002  # it draws where its search starts
    u, mean = record.inputs - record.inputs.mean(axis=0), record.output.mean()
    model = pmodel("bjtf", nb=[1, 1], nf=[2, 1], nc=[1], nd=[1], delay=[1, 2], diff=[0], per=[])
    model, _, _ = estimate(model, record.output - mean, u.T, show_plot=False, show_output=False)
    paths = zip((1, 2), model.b, model.f, u.T, strict=True)
    return mean + sum(
        response([0.0] * late + [float(k) for k in b], [1.0, *map(float, f)], column)
        for late, b, f, column in paths
    )


def of_box_jenkins(record):
    data = input_output_data(record.inputs, record.output, 0.1)
    model = box_jenkins(data, nb=[2, 2], nf=[2, 1], nk=[1, 2], nc=1, nd=1).model
    return model.simulate(record.inputs, before=[0, 0])


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # steps of the toolbox's search overflow
@pytest.mark.parametrize("d1", [-0.8, 0.5])
@pytest.mark.slow
def test_the_free_run_is_no_farther_from_the_truth(d1):
    records = [box_jenkins_record(seed, d1=d1) for seed in TOOLBOX_SEEDS]
    ours = [fit(record.truth, of_box_jenkins(record)) for record in records]
    others = [
        fit(record.truth, of_the_toolbox(record, seed))
        for seed, record in zip(TOOLBOX_SEEDS, records, strict=True)
    ]
    print(
        f"d1 = {d1}: fit to the truth, median of {len(records)}: {np.median(ours):.2f} %,"
        f" {np.median(others):.2f} %"
    )
    assert np.median(ours) >= np.median(others)
    assert min(ours) >= min(others) - 0.1
