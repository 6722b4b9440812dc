"""The estimator over a record, compiled."""

import numpy as np
import pytest

from fmus.degradation_estimator.model import DegradationEstimator
from fmus.kit.record.compiled import CompiledModel
from tests.support.estimator import PERIOD


@pytest.fixture(scope="module")
def compiled():
    return CompiledModel(DegradationEstimator)


@pytest.fixture(scope="module")
def estimate(compiled):
    """Signals after each sample of a record: ``estimate(current, voltage, **parameters)``."""

    def run(current, voltage, **parameters):
        period = parameters.get("sample_period", PERIOD)
        time = period * np.arange(len(current) + 1)
        inputs = {
            "current": np.append(current, current[-1]),
            "voltage": np.append(voltage, voltage[-1]),
        }
        signals = compiled.run(time, inputs, parameters).signals
        return {
            name: values[1:] for name, values in signals.items()
        }  # a sample shows at the next point

    return run
