"""Claims: an FMU is wrapped with values that are fitted without what is held out.

SciPy's filter makes the records.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import orchestration as ppy
from orchestration.discrepancy.foreign.wrapping import wrap
from tests.support.hosts import build_one_state_fmu

STEP = 0.1
TAU = 0.8
TIME = STEP * np.arange(2000)
U = 2.0 * np.sin(0.3 * TIME) + 1.5 * np.sin(0.91 * TIME + 1.0) + np.sin(2.3 * TIME + 2.0)


def lagged(u, tau=TAU):
    """x of ``tau dx/dt = u - x`` with u held, exactly."""
    p = np.exp(-STEP / tau)
    return lfilter([0.0, 1.0 - p], [1.0, -p], u)


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    """An FMU of one lag, whose equations nobody knows."""
    folder = tmp_path_factory.mktemp("foreign")
    return ppy.find_model(str(build_one_state_fmu(folder)))


def test_the_first_fit_sees_nothing_of_what_is_held_out(tmp_path, lag):
    """Where the end of a record is at rest, blocks all over it are held out."""
    u = np.where(0.6 * TIME[-1] > TIME, U, 0.0)
    block = 15 * np.arange(len(TIME)) // len(TIME)
    fits = []
    for name, spoilt in (("as_it_is.csv", 0.0), ("spoilt.csv", 0.1)):
        y = (
            lagged(u)
            + np.random.default_rng(4).normal(0.0, 0.02, len(TIME))
            + spoilt * (block % 3 == 1)
        )
        np.savetxt(
            tmp_path / name,
            np.column_stack([TIME, u, y]),
            delimiter=",",
            header="time,u,x",
            comments="",
        )
        record = ppy.read_record(tmp_path / name, lag)
        fits.append(wrap(lag, [record], [], {}, ["tau"]).fit.values["tau"])
    assert fits[0] == fits[1]
    assert fits[0] == pytest.approx(TAU, rel=0.01)


def test_records_have_what_the_fmu_simulates_and_how_its_parameter_moves_it(tmp_path, lag):
    """The derivative by the time constant is that of the closed form."""
    columns = np.column_stack([TIME, U, lagged(U)])
    path = tmp_path / "r.csv"
    np.savetxt(path, columns, delimiter=",", header="time,u,x", comments="")
    record = ppy.read_record(path, lag)
    wrapped = wrap(lag, [record], [], {"tau": TAU}, ["tau"], at={"tau": TAU})
    (signals,) = (record.signals for record in wrapped.records)
    assert wrapped.fit is None
    assert signals["simulated_x"] == pytest.approx(lagged(U), abs=1e-4)
    slope = (lagged(U, TAU + 1e-4) - lagged(U, TAU - 1e-4)) / 2e-4
    assert signals["x_by_tau"] == pytest.approx(slope, abs=0.01 * np.abs(slope).max())
    assert wrapped.moved_to({}) == {}
