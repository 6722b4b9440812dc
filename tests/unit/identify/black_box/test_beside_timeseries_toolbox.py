"""Claims: two-input Box-Jenkins models are no worse than those of another tool.

It was given the same data.

The tool is timeseries-toolbox, whose authors follow Ljung and Box and Jenkins; it estimates no
offset, so the means of the record are taken out for it, as its own examples do.
"""

import numpy as np
import pytest
from TimeSeriesSRC.Model.estimate import estimate
from TimeSeriesSRC.Model.model import pmodel

from orchestration.identify.black_box import box_jenkins, input_output_data
from tests.support.black_box import box_jenkins_record, fit, response

SEEDS = range(100, 110)
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")  # steps of its search overflow


def of_the_toolbox(record, seed):
    """Free run over the inputs, about their means."""
    np.random.seed(seed)  # noqa: NPY002  # it draws where its search starts
    u, mean = record.inputs - record.inputs.mean(axis=0), record.output.mean()
    model = pmodel("bjtf", nb=[1, 1], nf=[2, 1], nc=[1], nd=[1], delay=[1, 2], diff=[0], per=[])
    model, _, _ = estimate(model, record.output - mean, u.T, show_plot=False, show_output=False)
    paths = zip((1, 2), model.b, model.f, u.T, strict=True)
    return mean + sum(
        response([0.0] * late + [float(k) for k in b], [1.0, *map(float, f)], column)
        for late, b, f, column in paths
    )


def of_ours(record):
    data = input_output_data(record.inputs, record.output, 0.1)
    model = box_jenkins(data, nb=[2, 2], nf=[2, 1], nk=[1, 2], nc=1, nd=1).model
    return model.simulate(record.inputs, before=[0, 0])


@pytest.mark.parametrize("d1", [pytest.param(-0.8, marks=pytest.mark.slow), 0.5])
def test_the_free_run_is_no_farther_from_the_truth(d1):
    records = [box_jenkins_record(seed, d1=d1) for seed in SEEDS]
    ours = [fit(record.truth, of_ours(record)) for record in records]
    others = [
        fit(record.truth, of_the_toolbox(record, seed))
        for seed, record in zip(SEEDS, records, strict=True)
    ]
    print(
        f"d1 = {d1}: fit to the truth, median of {len(records)}: {np.median(ours):.2f} %,"
        f" {np.median(others):.2f} %"
    )
    assert np.median(ours) >= np.median(others)
    assert min(ours) >= min(others) - 0.1
