"""Printed values of chapter 5, with those that do not hold: eqs. 5.11 to 5.16, table 5-1."""

import numpy as np
import pytest

from demonstrations.thesis.printed_foot import MILLIMETRES_PER_INCH, printed
from fmus.foot.model import Foot


def test_program_gives_eqs_5_11_and_5_12_to_the_printed_digits():
    found = printed()
    for matrix, published in (
        (found.compliance, (("1081", "9.6"), ("9.6", "7.3"))),
        (found.damping, (("1.7e+07", "1.5e+05"), ("1.5e+05", "1.1e+05"))),
    ):
        for value, text in zip(matrix.flat, sum(published, ()), strict=True):
            shown = f"{value:.1e}" if "e" in text else f"{value:.{len(text.partition('.')[2])}f}"
            assert shown == text


def test_errata_12_digits_behind_the_printed_ones():
    found = printed()
    assert found.compliance == pytest.approx(np.array([[1080.78, 9.554], [9.554, 7.315]]), rel=1e-4)
    assert [f"{v:.3e}" for v in found.damping.flat] == [
        "1.672e+07",
        "1.478e+05",
        "1.478e+05",
        "1.132e+05",
    ]


def test_errata_12_the_x_compliance_is_the_offset_and_not_the_foot():
    inches, millimetres = printed(), printed(MILLIMETRES_PER_INCH)
    assert millimetres.compliance[0, 0] == pytest.approx(1.1e10, rel=0.05)
    assert printed(offset=1e-5).compliance[0, 0] == pytest.approx(
        10 * inches.compliance[0, 0], rel=0.02
    )
    consistent = Foot().compliance(0, 0) * 1e3  # mm/N
    assert inches.compliance[0, 0] > 500 * consistent
    with pytest.raises(ValueError, match="singular"):
        printed(offset=0.0)


def test_printed_damping_is_larger_along_x_and_the_text_expects_it_along_y():
    damping, foot = printed().damping, Foot()
    assert damping[0, 0] > 100 * damping[1, 1]
    assert foot.damping(1, 1) > 5 * foot.damping(0, 0)


def test_printed_compliance_and_damping_are_one_matrix():
    """Damping mapped like compliance: their ratio is k b whatever the foot is."""
    found = printed()
    assert found.damping / found.compliance == pytest.approx(
        np.full((2, 2), 9.1 * 1700.0), rel=1e-12
    )
