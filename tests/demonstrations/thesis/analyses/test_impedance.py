"""The circuit by two estimators on a record whose truth is known: one is biased, and by what errata
row 9 says.
"""

import pytest

from demonstrations.thesis import degradation
from demonstrations.thesis.analyses import impedance
from tests.support.thesis_findings import claim, row


@pytest.mark.parametrize("name", ["R1", "R2", "C"])
def test_only_the_interval_without_bias_holds_the_circuit(name):
    free, biased = (
        claim(impedance, f"{name} of table 3-1 within the 95 % interval by {by}, 20 mV of noise")
        for by in ("output error", "least squares")
    )
    assert free.reproduced == "yes"
    assert biased.reproduced == "no"
    assert biased.erratum == 9


def test_least_squares_comes_to_what_row_9_says():
    (window,) = impedance.reading().windows
    assert window.least_squares.R2.value == pytest.approx(1.30, abs=0.06)
    assert "R2 = 1.30" in row(degradation, 9).holds
    assert window.output_error.R2.value == pytest.approx(2.35, abs=0.06)


def test_it_is_drawn_with_the_truth():
    figure = impedance.illustrations()[0].draw()
    assert [axis.get_ylabel() for axis in figure.axes] == ["R1\n[Ω]", "R2\n[Ω]", "C\n[F]"]
