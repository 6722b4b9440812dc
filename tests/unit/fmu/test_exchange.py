"""Claims: an FMU for model exchange gives rates and derivatives at the states it is set to.

Oracle: thesis eqs. 3.4 and 3.9 on paper.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus import component
from fmus.kit import UserError
from fmus.kit.build import build_cached
from orchestration.fmu.exchange import ExchangeFmu

R1, R2, C = 0.43, 2.35, 2.70


def test_rates_and_derivatives_at_given_states():
    with ExchangeFmu(build_cached(component("ppy_actuator"), "native"), {"current": 0.5}) as fmu:
        fmu.start()
        assert fmu.get_states() == [0.0, 0.0, 0.0]
        fmu.enter_continuous_time(2.0, [1.0, 0.0, 0.0])
        assert (fmu.states[0], fmu.rates[0], fmu.samples) == ("charge", "der(charge)", False)
        rate = (R2 * 0.5 - 1.0 / C) / (R1 + R2)
        assert fmu.get_rates()[0] == pytest.approx(rate, rel=1e-12)
        found = fmu.directional_derivatives(["der(charge)", "voltage"], ["charge", "current"])
        slope = -1.0 / (C * (R1 + R2))
        paper = [
            [slope, R2 / (R1 + R2)],
            [1.0 / C - R1 / (C * (R1 + R2)), R1 * R2 / (R1 + R2)],
        ]
        np.testing.assert_allclose(found, paper, rtol=1e-12)


def test_one_that_samples_says_so():
    with ExchangeFmu(build_cached(component("voice_coil_dma"), "native")) as fmu:
        fmu.start()
        fmu.enter_continuous_time(0.0, fmu.get_states())
        assert fmu.samples


def test_a_refusal_is_a_line():
    with ExchangeFmu(build_cached(component("ppy_actuator"), "native")) as fmu:
        fmu.start()
        with pytest.raises(UserError, match=r"ppy_actuator.*states failed"):
            fmu.enter_continuous_time(0.0, [0.0])
