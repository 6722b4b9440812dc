"""Claims: R1, R2 and C of an estimate invert the discretisations of ``control``; the impedance is
eq. 4.10.
"""

import control
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.degradation_estimator.model import DegradationEstimator
from tests.support.estimator import LEAST_SQUARES, PERIOD, R1, R2, C, impedance, measured, square


def converted(theta, held, period=PERIOD):
    """R1, R2, C of the model for an estimate that no sample corrects: the regressor is zero."""
    model = DegradationEstimator(zero_order_hold=held, sample_period=period)
    model.b0, model.b1, model.a = theta
    model.samples = model.reversals = 1.0
    return model.circuit()


positive = st.floats(-1.0, 1.0).map(lambda power: 10.0**power)


@given(r1=positive, r2=positive, c=positive, period=st.floats(0.01, 0.2))
def test_conversions_invert_the_discretisations_of_control(r1, r2, c, period):
    circuit = control.tf([r1 * r2 * c, r2], [(r1 + r2) * c, 1.0])  # eq. 4.1
    for method, held in (("zoh", True), ("tustin", False)):
        discrete = control.sample_system(circuit, period, method)
        (b0, b1), (one, a) = discrete.num[0][0], discrete.den[0][0]
        found = converted((b0 / one, b1 / one, a / one), held, period)
        assert found == pytest.approx((r1, r2, c), rel=1e-6), method


@pytest.mark.parametrize(
    ("theta", "expected"),
    [
        ((0.3970, -0.3632, -0.9869), (0.449, 2.580, 2.503)),
        ((0.3648, -0.3321, -0.9839), (0.425, 2.031, 2.509)),
        ((0.3706, -0.3430, -0.9887), (0.421, 2.442, 3.073)),
    ],
)
def test_table_3_1_by_tustin(theta, expected):
    assert converted(theta, held=False) == pytest.approx(expected, abs=2e-3)  # errata 10


def test_tustin_is_wrong_for_held_data_and_the_exact_conversion_is_not(estimate):
    """Errata 8: 0.412, 2.350, 2.718 for 0.43, 2.35, 2.70."""
    current = square(100.0)
    voltage = measured(current)
    options = LEAST_SQUARES | {"initial_covariance": 1e9}
    for held, expected in ((0.0, (0.412, 2.350, 2.718)), (1.0, (R1, R2, C))):
        found = estimate(current, voltage, zero_order_hold=held, **options)
        assert [found[name][-1] for name in ("R1", "R2", "C")] == pytest.approx(expected, abs=6e-4)


@given(r1=positive, r2=positive, c=positive, omega=st.floats(1e-3, 100.0))
def test_impedance_is_eq_4_10(r1, r2, c, omega):
    model = DegradationEstimator(angular_frequency=omega)
    model.R1, model.R2, model.C = r1, r2, c
    assert model.impedance() == pytest.approx(impedance(r1, r2, c, omega), rel=1e-9)
    model.angular_frequency = 0.0
    assert model.impedance() == r2
