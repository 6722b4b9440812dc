"""Claims: connections lead from a source to a target, in the units that both state."""

from __future__ import annotations

import pytest

from orchestration.system import ssp
from tests.support.system.archive import repacked
from tests.support.system.ssp_files import refused_one

WAY = 'startElement="drive" startConnector="way" endElement="second load" endConnector="length"'
WIRE = (
    '<ssd:Connection startElement="drive" startConnector="force" endElement="load"'
    ' endConnector="force" />'
)


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        (
            WAY,
            WAY.replace("second ", "third "),
            ["drive.way -> third load.length", "no member named 'third load'"],
        ),
        (WAY, WAY.replace("way", "wax"), ["drive has no output named 'wax'", "did you mean way"]),
        (
            WAY,
            WAY.replace('startConnector="way"', ""),
            ["a Connection has no attribute 'startConnector'"],
        ),
        (
            'suppressUnitConversion="true"',
            "",
            ["drive.way -> second load.length", "'m' to 'mm'", "suppressUnit"],
        ),
        ('factor="1000.0"', 'factor="x"', ["factor 'x' of a LinearTransformation"]),
        (
            "ssc:LinearTransformation",
            "ssc:IntegerMappingTransformation",
            ["drive.way -> second load.length", "does not fit real and real"],
        ),
        (WIRE, WIRE + WIRE, ["load.force has two sources, drive.force and drive.force"]),
        (
            'startConnector="room"',
            'startConnector="roof"',
            ["roof -> load.warm", "leads from no input of the system"],
        ),
        (
            'startElement="load" startConnector="tension" endConnector="pull"',
            'startElement="load" startConnector="tension" endConnector="tension"',
            ["tension", "two sources"],
        ),
        (
            '<ssd:Connection startElement="load" startConnector="tension" endConnector="pull" />',
            "",
            ["system output pull is connected with nothing"],
        ),
        (
            '<ssd:Connection startConnector="command" endElement="drive" endConnector="command" />',
            (
                '<ssd:Connection startConnector="command" endElement="drive"'
                ' endConnector="command"><ssc:LinearTransformation factor="2"/></ssd:Connection>'
            ),
            ["command -> drive.command", "is not known"],
        ),
    ],
)
def test_connections_that_cannot_be_followed(system, tmp_path, old, new, parts):
    ssp.write(system, tmp_path / "with.ssp", connectors=True)
    refused_one(
        repacked(tmp_path / "with.ssp", lambda text: text.replace(old, new)), tmp_path / "u", *parts
    )


def test_a_connection_that_starts_at_its_target_keeps_its_factor(system, tmp_path):
    """In SSP the causality of the connectors gives the direction, not start and end."""
    ssp.write(system, tmp_path / "with.ssp", connectors=True)
    turned = WAY.replace("start", "from").replace("end", "start").replace("from", "end")
    other = repacked(tmp_path / "with.ssp", lambda text: text.replace(WAY, turned))
    read = ssp.read(other, tmp_path / "u")
    assert {str(one.target): (str(one.source), one.factor, one.offset) for one in read.connections}[
        "second load.length"
    ] == ("drive.way", 1000.0, -0.1)
