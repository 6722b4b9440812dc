"""Claims: an FMU simulates the inputs of its correction, anew where they are read otherwise.

The oracle is the closed form of a lag.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.diagnosis.foreign.component import Fitted, Names, output_correction
from orchestration.diagnosis.foreign.fmu_model import FmuModel, FmuRuns
from orchestration.diagnosis.readings import Reading, ReadingKind, readings_of
from orchestration.diagnosis.runs import Record, Setting
from tests.support.lag import STEP, TAU, TIME, U, lagged


@pytest.fixture(scope="module")
def model(lag):
    """With tau fitted, linearised at 0.8 s."""
    names = Names.of(lag, ["tau"])
    cls = output_correction(lag, names, ["u"], ["x"], (200.0, STEP), fit={"tau": Fitted(1.0, 1.0)})
    return FmuModel(cls, names, FmuRuns(lag, ["tau"], {}), {"tau": TAU})


@pytest.fixture(scope="module")
def record(model):
    inputs = np.zeros((len(TIME), len(model.inputs)))
    inputs[:, column(model, "u")] = U
    blank = Record(TIME, inputs, lagged(U)[:, np.newaxis], (False,) * inputs.shape[1])
    return model.simulated(blank)


def column(model, name):
    return [v.name for v in model.inputs].index(name)


def test_it_simulates_outputs_and_their_derivatives(model, record):
    assert record.inputs[:, column(model, "x_run")] == pytest.approx(lagged(U), abs=1e-4)
    slope = (lagged(U, TAU + 1e-4) - lagged(U, TAU - 1e-4)) / 2e-4
    found = record.inputs[:, column(model, "x_by_tau")]
    assert found == pytest.approx(slope, abs=0.01 * np.abs(slope).max())
    assert (record.inputs[:, column(model, "tau_simulated_with")] == TAU).all()


def test_a_misread_input_is_simulated_anew(model, record):
    read = Reading(ReadingKind.SIGN, ("u",), factor=-1.0).apply(model, record)
    assert read.inputs[:, column(model, "x_run")] == pytest.approx(-lagged(U), abs=1e-4)


def test_a_file_has_the_columns_of_the_fmu_alone(model, record):
    columns = {name for reading in readings_of(model, [record]) for name in reading.columns}
    assert columns == {"u", "x", "time"}


def test_a_run_far_from_where_it_was_linearised_is_linearised_there(model, record):
    def run(tau):
        setting = Setting(np.array([tau]), np.array([0]))
        return model.run(record, setting, np.zeros(0)).outputs[:, 0]

    wrong = np.abs(run(1.6) - lagged(U, 1.6)).max()
    assert wrong > 0.1
    assert model.linearise_at(np.array([1.6]))
    assert not model.linearise_at(np.array([1.601]))
    assert run(1.6) == pytest.approx(lagged(U, 1.6), abs=1e-4)
    assert run(TAU) == pytest.approx(lagged(U), abs=1e-4)


def test_its_targets_are_what_it_gives_and_terms_are_functions_of_its_signals(model):
    assert model.targets == ["x"]
    assert model.arguments == {"u", "x_simulated", "time"}
