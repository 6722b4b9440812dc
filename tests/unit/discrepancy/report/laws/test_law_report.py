"""Claims: units of laws are called as engineers call them."""

from __future__ import annotations

from orchestration.discrepancy.report.laws.law_report import plain_unit


def test_units_are_called_as_engineers_do():
    assert plain_unit("kg*m^2*rad/s^2") == "N*m"
    assert plain_unit("kg*m/s^2") == "N"
    assert plain_unit("kg*m^2/(A*s^3)") == "V"
    assert plain_unit("rad/s") == "rad/s"
    assert plain_unit("kg/s") == "kg/s"
