"""A claim holds by the digits in which it is printed, and by nothing else."""

import pytest

from demonstrations.thesis.claim import Claim, number, spread


def claim(published, reproduced, **options):
    return Claim("table", "quantity", published, reproduced, **options)


@pytest.mark.parametrize(
    ("published", "value", "holds"),
    [
        ("0.45", 0.4451, True),
        ("0.45", 0.4549, True),
        ("0.45", 0.4449, False),
        ("0.45", 0.4551, False),
        ("-0.987", -0.9865, True),  # halves may have gone either way
        ("3.1", 3.05, True),
        ("3.10", 3.09, False),
        ("1.7e7", 1.672e7, True),
        ("1.7e7", 1.64e7, False),
        ("1e2", 148.0, True),
        ("1e2", 151.0, False),
        ("~1e2", 32.0, True),  # an order of magnitude: half of a decade on a logarithmic scale
        ("~1e2", 316.0, True),
        ("~1e2", 31.0, False),
        ("~1e2", 317.0, False),
        ("9100", 9100.4, True),
        ("9100", 9101.0, False),
        ("7 to 10", 6.6, True),
        ("7 to 10", 10.4, True),
        ("7 to 10", 10.6, False),
        ("<0.1", 0.0999, True),
        ("<0.1", 0.1, False),
        (">5", 5.0, False),
        ("≥5", 5.0, True),
        ("≤1.3", 1.3000001, False),
        ("BJ", "BJ", True),
        ("BJ", "OE", False),
    ],
)
def test_a_figure_holds_if_it_would_have_been_printed_so(published, value, holds):
    assert claim(published, value).holds is holds


def test_a_word_cannot_be_held_against_a_number():
    with pytest.raises(ValueError, match="table, quantity: 'about five' is no printed figure"):
        _ = claim("about five", 5.0).verdict


def test_rounding_of_the_printed_inputs_can_account_for_a_difference():
    assert claim("2.02", 2.031, allowed=(2.0186, 2.0436)).verdict == "within rounding"
    assert claim("2.02", 2.031, allowed=(2.0251, 2.0436)).verdict == "differs"
    assert claim("2.02", 2.031).verdict == "differs"
    assert claim("2.02", 2.021, allowed=(0.0, 1.0)).verdict == "holds"


def test_a_figure_can_follow_from_its_program_and_be_wrong():
    wrong = claim("1081", 1080.8, consistent="1.91 mm/N")
    assert (wrong.agrees, wrong.holds, wrong.verdict) == (True, False, "only as printed")


@pytest.mark.parametrize(
    ("published", "value", "difference"),
    [
        ("2.0", 2.1, 0.05),
        ("-2.0", 2.0, -2.0),
        ("7 to 10", 20.0, 1.0),
        ("7 to 10", 3.5, -0.5),
        ("7 to 10", 8.0, None),
        ("<0.1", 0.05, None),
        ("<0.1", 0.2, 1.0),
        ("~1e2", 148.0, None),
        ("~1e2", 400.0, 3.0),
        ("0", 3.0, None),
        ("BJ", "OE", None),
    ],
)
def test_relative_difference_is_to_the_nearest_end(published, value, difference):
    assert claim(published, value).difference == (
        None if difference is None else pytest.approx(difference)
    )


@pytest.mark.parametrize(
    ("published", "value", "shown"),
    [
        ("1081", 1080.78, "1080.8"),
        ("0.45", 0.44922, "0.449"),
        ("5", 3.8581, "3.86"),
        ("1.7e7", 1.672e7, "1.67e7"),
        ("0", 3860.0, "3860"),
        ("<0.001", 6.78e-4, "0.000678"),
        ("7 to 10", 73.53, "73.5"),
        ("x", "y", "y"),
    ],
)
def test_one_digit_more_than_printed_is_shown(published, value, shown):
    assert claim(published, value).reproduced_text == shown


def test_numbers_as_people_write_them():
    assert [number(3860.0), number(2.57e-5), number(1.7e7, 2, True), number(0.0)] == [
        "3860",
        "2.57e-05",
        "1.7e7",
        "0",
    ]


def test_spread_is_that_of_the_rounded_inputs():
    low, high = spread(lambda x, y: x / y, ["1.0", "2.00"])
    assert (low, high) == pytest.approx((0.95 / 2.005, 1.05 / 1.995))
    assert spread(lambda x: x, ["1.7e7"]) == pytest.approx((1.65e7, 1.75e7))
    assert spread(lambda x: -x, ["30"]) == pytest.approx((-30.5, -29.5))
