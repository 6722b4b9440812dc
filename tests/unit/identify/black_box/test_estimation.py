"""Claims: ARX is least squares, ARMAX undoes its bias, mistakes are refused in one line."""

import numpy as np
import pytest
import statsmodels.api as sm

from fmus.kit.errors import UserError
from orchestration.identify.black_box import (
    armax,
    arx,
    box_jenkins,
    input_output_data,
    output_error,
    state_space,
)
from tests.support.black_box import box_jenkins_record, fit, response

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


def test_a_structure_that_cannot_describe_the_data_is_searched_to_the_end():
    """Gauss-Newton steps go too far there, again and again."""
    record = box_jenkins_record(0, 5000)
    found = armax(input_output_data(record.inputs, record.output, 1.0), 3, 3, 3)
    assert found.converged
    assert not any("iterations" in message for message in found.messages)


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
        (lambda: arx(data(), 0, 0), r"^nb\[0\] = 0: must be a whole number, at least 1$"),
        (lambda: arx(data(), -1, 1), r"^na = -1: must be a whole number, at least 0$"),
        (lambda: armax(data(), 2, 1, 1.5), r"^nc = 1\.5: must be a whole number, at least 0$"),
        (
            lambda: output_error(data(), [1, 1, 1], 1),
            r"^nb = \[1, 1, 1\]: must be one number, or one for each of 2",
        ),
        (
            lambda: output_error(data(), 1, 1, [1, -2]),
            r"^nk\[1\] = -2: must be a whole number, at least 0$",
        ),
        (
            lambda: arx(data(), 1, 1, 500),
            r"^200 samples .* are too few for na = 1, nb = 1 1, nk = 500 500",
        ),
        (
            lambda: box_jenkins(data(20), 2, 2, 2, 2),
            r"^20 samples of displacement are too few .* at least \d+ ",
        ),
        (lambda: state_space(data(), 2.5), r"^order = 2\.5: must be a whole number, at least 1$"),
        (lambda: state_space(data(), 0), r"^order = 0: must be a whole number, at least 1$"),
        (
            lambda: state_space(data(60), 4),
            r"^60 samples are too few for 4 states and 2 inputs: at least 144 ",
        ),
        (lambda: state_space(data(), 2, [0, 1, 1]), r"^nk = \[0, 1, 1\]: must be one number"),
        (
            lambda: data().part(300),
            r"^part from sample 300 to None: there are none, of 200 samples$",
        ),
        (lambda: data().split(1.0), r"^share = 1: must be between 0 and 1, neither of them$"),
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


def changed(column=None, row=None, value=None, **more):
    record = box_jenkins_record(0, 100)
    u, y = record.inputs.copy(), record.output.copy()
    if column == "output":
        y[slice(None) if row is None else row] = value
    elif column is not None:
        u[slice(None) if row is None else row, column] = value
    return input_output_data(
        u, y, more.pop("step", 1.0), ["force", "current"], more.pop("name", "displacement")
    )


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: changed(1, 17, np.nan),
            r"^input current, sample 17: is nan, must be a finite number; fill gaps",
        ),
        (
            lambda: changed("output", 3, np.inf),
            r"^output displacement, sample 3: is inf, must be a finite number",
        ),
        (
            lambda: arx(changed(0, None, 0.25), 1, 1),
            r"^input force is constant \(0\.25 in all 100 samples\): an",
        ),
        (
            lambda: state_space(changed(0, None, 2), 1),
            r"^input force is constant \(2 in all 100 samples\)",
        ),
        (
            lambda: arx(changed("output", None, 1), 1, 1),
            r"^output displacement is constant \(1 in all 100 samples\)$",
        ),
        (lambda: changed(step=0.0), r"^step = 0 s: must be a finite number above 0$"),
        (lambda: changed(name="force"), r"^force is an input and the output: name it once$"),
        (
            lambda: input_output_data([1.0, 2.0], [1.0], 1.0),
            r"^inputs have shape \(2,\) and the output \(1,\)",
        ),
        (lambda: input_output_data(["a"], [1.0], 1.0), r"^inputs: must be an array of numbers"),
    ],
)
def test_bad_data_are_told_in_one_line(make, said):
    with pytest.raises(UserError, match=said) as caught:
        make()
    assert "\n" not in str(caught.value)
