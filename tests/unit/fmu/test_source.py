"""Claims: an FMU as a source says what it declares, and goes on from a copy of its file."""

from __future__ import annotations

from pathlib import Path
from shutil import copyfile

import numpy as np
import pytest

from orchestration.fmu import find_model, read_description
from orchestration.fmu.simulation import FmuSource, source_of
from tests.support.hosts import build_one_state_fmu


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    return str(build_one_state_fmu(tmp_path_factory.mktemp("lag")))


def test_a_source_says_what_the_fmu_declares(lag, tmp_path):
    model = find_model(str(lag))
    source = source_of(model)
    assert source == FmuSource(model.path)
    assert source.name == Path(lag).name
    assert source.guid == read_description(model.path).guid
    time = np.array([0.0, 1.0])
    assert source.points(time) is time
    copy = tmp_path / "copy.fmu"
    copyfile(source.files[0], copy)
    moved = source.with_files([copy])
    with source.open() as one, moved.open() as other:
        run = [runs.run(time, {"u": np.ones(2)}, {"tau": 0.5}, ["x"]) for runs in (one, other)]
    assert np.array_equal(*run)
    assert abs(run[0][1, 0] - (1.0 - np.exp(-2.0))) < 1e-4
