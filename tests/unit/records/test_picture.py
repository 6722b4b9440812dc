"""Claims: the picture of a record has units, and none is drawn of nothing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.records.record import Record


@pytest.fixture
def record():
    signals = {"u": np.array([1.0, 2.0, 3.0]), "y": np.array([1e-3, np.nan, 3e-3])}
    return Record(np.array([0.0, 0.5, 31.5]), signals, {"u": "V", "y": "m"}, Path("a/r.csv"))


def test_it_is_drawn_with_units(record, tmp_path):
    figure = record.plot(tmp_path / "r.svg")
    assert [axis.get_ylabel() for axis in figure.axes] == ["u\n[V]", "y\n[m]"]
    assert (tmp_path / "r.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_without_samples_or_signals_there_is_nothing_to_draw(record):
    for empty in (replace(record, signals={}), replace(record, time=record.time[:0])):
        with pytest.raises(UserError, match=r"r\.csv: no samples or no signals"):
            empty.plot()
        assert list(empty._repr_mimebundle_()) == ["text/html"]
