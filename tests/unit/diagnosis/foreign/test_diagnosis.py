"""Claims: options of an FMU are checked, and its first fit sees nothing of what is left out."""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.diagnosis import Options
from orchestration.diagnosis.foreign import diagnose_fmu
from orchestration.diagnosis.foreign.diagnosis import _first_fit
from tests.support.lag import TAU, TIME, U, lagged, write_lag


def test_the_first_fit_sees_nothing_of_what_is_left_out(tmp_path, lag):
    spoilt = 0.1 * (2 * len(TIME) // 3 <= np.arange(len(TIME)))
    fits = []
    for name, offset in (("as_it_is.csv", 0.0 * spoilt), ("spoilt.csv", spoilt)):
        record = ppy.read_record(write_lag(tmp_path / name, lagged(U) + offset), lag)
        fits.append(_first_fit(lag, record, {}, ["tau"], True)["tau"])
    assert fits[0] == fits[1]
    assert fits[0] == pytest.approx(TAU, rel=0.01)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fit": ["taw"]}, "no parameter named 'taw' .did you mean tau"),
        ({"hold": ["u"]}, "no parameter named 'u'"),
        ({"fit": ["tau"], "hold": ["tau"]}, "tau is held by"),
    ],
)
def test_what_an_fmu_cannot_do_is_refused(tmp_path, lag, options, message):
    record = ppy.read_record(write_lag(tmp_path / "r.csv", lagged(U)), lag)
    with pytest.raises(UserError, match=message):
        diagnose_fmu([record], lag, options=Options(**options))
