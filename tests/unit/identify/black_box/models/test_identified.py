"""Claims: poles and zeros are those of the system, prediction is optimal, control agrees.

Oracles: SciPy's discretisation, python-control, a predictor run sample by sample, the Kalman filter
on paper.
"""

import control
import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.identify.black_box import (
    armax,
    arx,
    box_jenkins,
    input_output_data,
    output_error,
    state_space,
)
from tests.support.black_box import box_jenkins_record, fit

STEP = 0.1


def as_data(record):
    return input_output_data(
        record.inputs, record.output, STEP, ["force", "current"], "displacement"
    )


@pytest.fixture(scope="module")
def record():
    return box_jenkins_record(11, 1500)


MODELS = {
    "ARX": lambda data: arx(data, 2, [2, 1], [0, 3]),
    "ARMAX": lambda data: armax(data, 2, 2, 1, 1),
    "OE": lambda data: output_error(data, [2, 2], [2, 1], [1, 2]),
    "BJ": lambda data: box_jenkins(data, [3, 2], [2, 1], 1, 2, [0, 2]),
    "SS": lambda data: state_space(data, 4, [1, 3]),
    "SS with feedthrough": lambda data: state_space(data, 3, [0, 1]),
}


@pytest.fixture(scope="module", params=MODELS)
def found(request, record):
    return MODELS[request.param](as_data(record))


def test_control_simulates_the_same(record, found):
    model = found.model
    time = STEP * np.arange(len(record.output))
    deviations = record.inputs - model.input_offsets
    paths = [model.transfer_function(name) for name in model.input_names]
    parts = [
        control.forced_response(path, time, u).outputs
        for path, u in zip(paths, deviations.T, strict=True)
    ]
    assert np.sum(parts, axis=0) + model.output_offset == pytest.approx(
        model.simulate(record.inputs), abs=1e-7
    )
    whole = control.forced_response(model.state_space(), time, deviations.T).outputs
    assert np.squeeze(whole) + model.output_offset == pytest.approx(
        model.simulate(record.inputs), abs=1e-7
    )
    assert all(
        path.dt == STEP for path in (*paths, model.state_space(), model.noise_transfer_function())
    )
    assert paths[0].input_labels == ["force"]
    assert model.state_space().output_labels == ["displacement"]


def test_controls_noise_path_makes_the_residual_what_is_left_of_the_output(record, found):
    """From the second half on, when whatever there was before the record has died away."""
    model = found.model
    e = model.prediction_errors(as_data(record))
    late = len(e)
    inputs = record.inputs - model.input_offsets
    forced = sum(
        control.forced_response(
            model.transfer_function(i), STEP * np.arange(len(inputs)), inputs[:, i]
        ).outputs
        for i in range(2)
    )
    coloured = control.forced_response(
        model.noise_transfer_function(), STEP * np.arange(late), e
    ).outputs
    rebuilt = (model.output_offset + forced)[-late:] + coloured
    assert rebuilt[late // 2 :] == pytest.approx(record.output[-late:][late // 2 :], abs=1e-6)


def test_poles_and_zeros_are_those_of_control(found):
    model = found.model
    for i in range(2):
        path = model.transfer_function(i)
        for ours, oracle in ((model.poles(i), path.poles()), (model.zeros(i), path.zeros())):
            ours, oracle = ours[np.abs(ours) > 1e-3], oracle[np.abs(oracle) > 1e-3]
            order = {"key": lambda z: (round(z.real, 5), z.imag)}
            assert sorted(ours, **order) == pytest.approx(sorted(oracle, **order), abs=1e-5)
    assert model.is_stable()


def test_one_step_prediction_leaves_the_residual(record, found):
    predicted = found.model.predict(as_data(record))
    late = len(found.residual) // 2
    assert (record.output - predicted)[-late:] == pytest.approx(found.residual[-late:], abs=1e-9)
    assert found.model.fit(as_data(record), 1) == pytest.approx(fit(record.output, predicted))


def test_the_farther_ahead_the_worse_is_a_prediction(record):
    model = box_jenkins(as_data(record), [2, 2], [2, 1], 1, 1, [1, 2]).model
    fits = [model.fit(as_data(record), horizon) for horizon in (1, 2, 5, 300)]
    assert fits == sorted(fits, reverse=True)
    assert fits[0] > fits[2] + 3.0


def test_prediction_over_the_whole_record_is_the_free_run(record, found):
    data = as_data(record)
    late = slice(500, None)
    far = found.model.predict(data, len(data))
    assert far[late] == pytest.approx(
        found.model.simulate(record.inputs, record.output)[late], abs=2e-3
    )


@pytest.mark.parametrize("horizon", [1, 2, 3, 7])
def test_prediction_ahead_is_that_of_feeding_predictions_back(record, horizon):
    """Run ARX sample by sample, with predictions in place of what is not yet measured."""
    result = arx(as_data(record), 2, [2, 1], [1, 3])
    a1, a2, b1, b2, b3 = (p.value for p in result.parameters)
    model = result.model
    y = record.output - model.output_offset
    u, v = (record.inputs - model.input_offsets).T
    predicted = np.full(len(y), np.nan)
    for t in range(20, 200):
        known = list(y[: t - horizon + 1])
        for s in range(t - horizon + 1, t + 1):
            known.append(
                -a1 * known[s - 1]
                - a2 * known[s - 2]
                + b1 * u[s - 1]
                + b2 * u[s - 2]
                + b3 * v[s - 3]
            )
        predicted[t] = known[t]
    ours = model.predict(as_data(record), horizon) - model.output_offset
    assert ours[20:200] == pytest.approx(predicted[20:200], abs=1e-9)


def test_other_data_are_refused(record):
    model = arx(as_data(record), 2, 2).model
    with pytest.raises(UserError, match=r"^data have inputs u1, u2: must be force, current$"):
        model.fit(input_output_data(record.inputs, record.output, STEP))
    with pytest.raises(
        UserError, match=r"^data have a step of 0\.2 s: must be the model's, 0\.1 s$"
    ):
        model.fit(
            input_output_data(
                record.inputs, record.output, 0.2, ["force", "current"], "displacement"
            )
        )
    with pytest.raises(UserError, match=r"^input current, sample 1: must be a finite number$"):
        model.simulate([[0.0, 1.0], [0.0, np.nan]])
    with pytest.raises(UserError, match=r"^output of shape \(3,\): must be \(2,\) and finite"):
        model.simulate(np.zeros((2, 2)), np.zeros(3))
    with pytest.raises(UserError, match=r"^2 samples: a model with .* needs at least 3$"):
        model.prediction_errors(as_data(record).part(0, 2))
