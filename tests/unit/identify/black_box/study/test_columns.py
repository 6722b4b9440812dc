"""Columns of files whose samples are counted."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit import UserError
from orchestration.identify.black_box.study.columns import read_columns
from tests.support.vendors import catman


def counted(path, count, name="sample"):
    u = np.random.default_rng(1).normal(size=600)
    np.savetxt(
        path,
        np.column_stack([count, u, lfilter([0.4, 0.5], [1.0, -0.8], u)]),
        delimiter=",",
        header=f"{name},u [V],y [mm]",
        comments="",
    )
    return path


@pytest.mark.parametrize("name", ["sample", "time"])
def test_a_step_is_for_a_file_that_counts_by_ones(tmp_path, name):
    """A clock of 0.1 s without a unit would be a tenth of the sample period that is given."""
    for count, said in (
        (0.1 * np.arange(600), "goes from 0 to 0.1"),
        (np.arange(600) // 100 * 5.0, "from 0 to 0"),
    ):
        with pytest.raises(
            UserError, match=f"the first column, '{name}', {said}|{said}; step= is for"
        ):
            read_columns(counted(tmp_path / "clock.csv", count, name), "y", step=1.0)
    found = read_columns(counted(tmp_path / "count.csv", np.arange(7, 607), name), "y", step=2.0)
    assert (found.data.step, found.data.input_names) == (2.0, ("u",))


def test_a_first_column_that_is_an_input_needs_not_count(tmp_path):
    found = read_columns(
        counted(tmp_path / "no_clock.csv", np.arange(600) % 7, "v [V]"), "y", ["v", "u"], step=2.0
    )
    assert found.data.inputs[:9, 0].tolist() == [0, 1, 2, 3, 4, 5, 6, 0, 1]


def test_the_time_of_an_instrument_is_no_input_wherever_it_stands(tmp_path):
    path = tmp_path / "messung.asc"
    path.write_bytes(catman().content())
    found = read_columns(path, "Spannung Zelle 1")
    assert found.data.step == 0.5
    assert found.data.input_names == ("Strom", "Oberflächentemperatur")
    assert found.units == {"Spannung Zelle 1": "V", "Strom": "A", "Oberflächentemperatur": "°C"}
