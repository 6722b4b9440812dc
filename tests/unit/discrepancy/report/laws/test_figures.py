"""Claims: curves and maps of laws are drawn with their units, and what is omitted is said."""

from __future__ import annotations

import pytest

from orchestration.discrepancy.report.laws import figures
from tests.support.law_reports import ENDS, entry, motor_report
from tests.support.pages import words_of


@pytest.mark.parametrize(
    ("kind", "vertical"),
    [("add", "more in friction [N*m]"), ("multiply", "factor of friction, less 1")],
)
def test_axes_have_names_and_units(kind, vertical):
    titles = figures.axis_titles(*motor_report("linear", kind))
    assert titles == (vertical, "omega [rad/s]")


def test_a_curve_is_drawn_with_its_band_and_its_shape():
    law_report, one = motor_report("linear")
    (axis,) = figures.draw_curve(law_report, one).axes
    curve, shape, visited, _ = axis.get_lines()
    assert curve.get_ydata() == pytest.approx(0.01 * curve.get_xdata())
    assert shape.get_label() == "a straight line"
    assert shape.get_ydata() == pytest.approx(curve.get_ydata())
    assert visited.get_xdata() == pytest.approx(ENDS)
    names = "95 % band curve a straight line where the record has been"
    assert words_of(figures.plot_curve(law_report, one)).startswith(names)


def test_of_what_is_remembered_the_best_is_on_the_map():
    law_report, _ = motor_report("linear")
    law_report.laws.found.entries = [entry(memory="lagged"), entry(), entry("drop", "current")]
    drawn, omitted = figures.plot_law_map(law_report)
    assert words_of(drawn) == ("evidence omega, remembered omega current friction 12 12 drop 12")
    assert omitted == ""


def test_what_has_no_room_on_the_map_is_counted():
    law_report, _ = motor_report("linear")
    law_report.laws.found.entries = [entry(f"law {k}") for k in range(30)]
    drawn, omitted = figures.plot_law_map(law_report)
    assert drawn.count("<td") == 24
    assert omitted == "6 laws and 0 signals that tell less are not shown. "
