"""Claims: clean records are of the physics of the models, in noise as it is called.

They are drawn by `studies/clean`, which shares no code with models or diagnosis.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.record.compiled import CompiledModel
from orchestration.fmu.model import find_model
from studies.clean import disturbances
from studies.clean.judge import least_squares_fit, noise_scale, pooled_error
from studies.clean.records import KINDS, Case, cases, draw
from studies.clean.stimuli import SMOOTH, STIMULI

EACH = [
    *(Case("Actuator", stimulus, "Gaussian", 5, at_rest=False) for stimulus in STIMULI),
    Case("Actuator", "closed loop", "Gaussian", 6),
    *(
        Case("Actuator", stimulus, "Gaussian", 5, smooth=True)
        for stimulus in ("chirp", "multisine")
    ),
    Case("ActuatorByLength", "PRBS", "Gaussian", 5),
    Case("Galvanostat", "triangle", "Gaussian", 5),
    Case("VoiceCoil", "multisine", "Gaussian", 5, at_rest=False),
    Case("Motor", "closed loop", "Gaussian", 5),
    Case("Pendulum", "PRBS", "Gaussian", 5, at_rest=False),
    Case("Pendulum", "chirp", "Gaussian", 5, smooth=True),
    Case("ThermalNodes", "closed loop", "Gaussian", 5),
    Case("Cell", "step and rest", "Gaussian", 5, timing="1 Hz"),
]


@pytest.mark.parametrize("case", EACH, ids=str)
def test_model_and_generator_agree(case):
    """Two statements of the same physics, integrated by two methods: whatever a diagnosis finds is
    not from here.
    """
    drawn = draw(case)
    model = find_model(drawn.plant.model).cls
    known = {p.name for p in model.layout.parameters}
    values = dict(drawn.plant.settings) | drawn.truth | {"sample_period": drawn.step}
    ran = (
        CompiledModel(model)
        .run(
            drawn.time, drawn.inputs, {n: v for n, v in values.items() if n in known}, drawn.smooth
        )
        .signals
    )
    # where inputs are smooth, lines between samples are not quite what went in
    tolerance = 3e-2 if case.smooth else 1e-3 if drawn.smooth else 1e-6
    for output, y in drawn.clean.items():
        assert np.max(np.abs(ran[output] - y)) < tolerance * np.ptp(y)


def test_noise_is_as_it_is_called():
    n, deviation, rng = 40_000, 0.5, np.random.default_rng(1)
    clean_signal = np.sin(np.arange(n) / 500.0)
    errors = {
        kind: make(clean_signal, deviation, rng) - clean_signal
        for kind, make in disturbances.ON_OUTPUTS.items()
    }
    for kind in ("Gaussian", "AR", "t3", "varying"):
        assert np.std(errors[kind]) == pytest.approx(deviation, rel=0.1)
    assert np.mean(np.abs(errors["outliers"]) > 8.0 * deviation) == pytest.approx(
        disturbances.OUTLIERS, rel=0.2
    )
    step = disturbances.RESERVE * np.ptp(clean_signal) / disturbances.LEVELS
    assert np.abs(errors["12 bit"]).max() < 3.0 * step
    assert np.mean(np.abs(errors["t3"]) > 4.0 * deviation) > 20.0 * np.mean(
        np.abs(errors["Gaussian"]) > 4.0 * deviation
    )
    assert np.corrcoef(errors["AR"][1:], errors["AR"][:-1])[0, 1] > 0.25
    assert abs(np.corrcoef(errors["varying"][1:], errors["varying"][:-1])[0, 1]) < 0.03
    stamps = disturbances.jittered(np.arange(2000) * 0.1, rng)
    assert np.all(np.diff(stamps) > 0.0)
    assert np.std(stamps - np.arange(2000) * 0.1) == pytest.approx(0.005, rel=0.1)


def test_cases_cover_everything_and_repeat():
    drawn = cases(256, 3)
    assert drawn == cases(256, 3)
    assert {c.noise for c in drawn} == set(KINDS)
    assert {c.stimulus for c in drawn} == {*STIMULI, "closed loop"}
    assert {c.stimulus for c in drawn if c.smooth} == set(SMOOTH)
    assert len({(c.plant, c.noise) for c in drawn}) >= 60
    first, again = draw(drawn[0]), draw(drawn[0])
    assert all(np.array_equal(first.outputs[o], again.outputs[o]) for o in first.outputs)


@pytest.mark.slow
def test_films_that_are_held_at_a_length_stay_taut():
    """The plant is linear; the model goes slack instead of pushing, as films do."""
    drawn = [draw(case) for case in cases(800, 7) if case.plant == "ActuatorByLength"]
    assert min(record.clean["tension"].min() for record in drawn) > 0.0


def test_the_naive_judge_finds_a_line():
    """Of a straight line least squares is a closed form."""
    time = np.linspace(0.0, 1.0, 200)
    y = 3.0 * time + 0.5 + 0.1 * np.random.default_rng(1).standard_normal(200)
    error, values = least_squares_fit(
        lambda v: {"y": v["slope"] * time + v["start"]},
        {"y": y},
        {"slope": 1.0, "start": 0.0},
        sizes={"start": 1.0},
    )
    slope, start = np.polyfit(time, y, 1)
    assert values == pytest.approx({"slope": slope, "start": start}, rel=1e-5)
    left = y - slope * time - start
    assert error == pytest.approx(np.sqrt(np.mean(left**2)) / noise_scale(y))
    assert noise_scale(y) == pytest.approx(0.1, rel=0.2)
    assert pooled_error({"y": y}, {"y": y + 0.1}) == pytest.approx(0.1 / noise_scale(y))
