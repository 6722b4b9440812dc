"""Claims: shapes are within the box, and what stands in a row does not overlap."""

import re

from fmus.kit.modelica.annotations import annotation
from fmus.kit.modelica.connectors import source_classes
from fmus.kit.modelica.graphics import box, placement, positions
from tests.support.kit_samples import Thermostat


def test_positions_are_even_and_symmetric():
    assert [positions(count) for count in (0, 1, 2, 4)] == [[], [0], [-50, 50], [-75, -25, 25, 75]]


def test_a_placement_is_a_square_about_its_middle():
    assert placement(-110, 20) == (
        " annotation(Placement(transformation(extent={{-120,10},{-100,30}})))"
    )
    assert "extent={{-3,-3},{3,3}}" in placement(0, 0, 3)


def test_lines_stand_side_by_side_in_the_box():
    text = box("0,0,127", [("{-50,0},{50,0}", "1,2,3"), ("{-50,9},{50,9}", "4,5,6")])
    lines = re.findall(r"Line\(origin=\{(\S+)\}, points=\{(\S+)\}, color=\{(\S+)\}", text)
    assert lines == [("-50,0", "{-50,0},{50,0}", "1,2,3"), ("50,0", "{-50,9},{50,9}", "4,5,6")]
    assert 'textString="%name"' in text


def test_icons_show_domains_and_what_is_sampled():
    assert annotation(Thermostat).count("Line(") == 1  # steps
    sources = source_classes()
    assert sources.keys() >= {"Voltage", "Current", "Position", "Force"}
    for name, text in sources.items():
        assert text.startswith(f"model {name} "), name
        assert text.count("Line(") == 1, name
