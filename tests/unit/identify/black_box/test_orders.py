"""Claims: orders count and name coefficients as Ljung's eq. 4.33 has them; others are refused."""

import pytest

from fmus.kit.errors import UserError
from orchestration.identify.black_box import (
    armax,
    arx,
    box_jenkins,
    input_output_data,
    output_error,
)
from orchestration.identify.black_box.orders import Orders, orders
from tests.support.black_box import box_jenkins_record


def data(samples=200):
    record = box_jenkins_record(0, samples)
    return input_output_data(record.inputs, record.output, 0.5, output_name="displacement")


@pytest.mark.parametrize(
    ("find", "said"),
    [
        (lambda: arx(data(), 0, 0), r"^nb\[0\] = 0: must be a whole number, at least 1$"),
        (lambda: arx(data(), -1, 1), r"^na = -1: must be a whole number, at least 0$"),
        (lambda: armax(data(), 2, 1, 1.5), r"^nc = 1\.5: must be a whole number, at least 0$"),
        (
            lambda: output_error(data(), [1, 1, 1], 1),
            r"^nb = \[1, 1, 1\]: must be one number, or one for each of 2",
        ),
        (
            lambda: output_error(data(), 1, 1, [1, -2]),
            r"^nk\[1\] = -2: must be a whole number, at least 0$",
        ),
        (
            lambda: arx(data(), 1, 1, 500),
            r"^200 samples .* are too few for na = 1, nb = 1 1, nk = 500 500",
        ),
        (
            lambda: box_jenkins(data(20), 2, 2, 2, 2),
            r"^20 samples of displacement are too few .* at least \d+ ",
        ),
    ],
)
def test_orders_that_are_not_possible_are_told_in_one_line(find, said):
    with pytest.raises(UserError, match=said) as caught:
        find()
    assert "\n" not in str(caught.value)


def test_coefficients_are_counted_and_named():
    """Of B1 = b1 q^-1 + b2 q^-2, F1 = 1 + f1 q^-1 + f2 q^-2, B2 = b3 q^-3, C and D of one each."""
    two_paths = orders(data(), [2, 1], [1, 3], nf=[2, 0], nc=1, nd=1)
    assert two_paths.names() == ("b1_1", "b1_2", "f1_1", "f1_2", "b2_3", "c1", "d1")
    assert two_paths.parameters == 7
    assert two_paths.first == 3  # u2(t - 3) is the oldest sample of the equation
    assert two_paths.highest == 2
    assert two_paths.excitation == (4, 1)
    assert str(two_paths) == "nb = 2 1, nf = 2 0, nc = 1, nd = 1, nk = 1 3"


def test_the_order_of_a_noise_model_is_that_of_what_noise_passes():
    """1/A, C/A, C/D and nothing, as Ljung's table 4.1 has them."""
    none = (0, 0)
    assert Orders(3, (3, 3), 0, 0, none, none).noise_order == 3
    assert Orders(2, (3, 3), 3, 0, none, none).noise_order == 3
    assert Orders(0, (3, 3), 1, 2, (3, 3), none).noise_order == 2
    assert Orders(0, (3, 3), 0, 0, (3, 3), none).noise_order == 0


def test_one_number_stands_for_all_inputs():
    assert orders(data(), 2, 1, 2) == Orders(2, (2, 2), 0, 0, (0, 0), (1, 1))
