"""Claims: what a description says of a connector must be so in the FMU, and what it leaves out is
taken from there; a size of arrays is a structural parameter.
"""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from fmus.kit.errors import UserError
from orchestration.system import Member
from orchestration.system.ssp.declarations import check_connectors
from tests.support.fmi3_fmus import description, pack
from tests.support.system.archive import NAMESPACES


@pytest.fixture
def checked(tmp_path):
    """Check one connector of the member with arrays."""
    fmu = pack(tmp_path / "arrays.fmu", {"modelDescription.xml": description("arrays")})

    def check(connector):
        text = f"<c {NAMESPACES}><ssd:Connectors>{connector}</ssd:Connectors></c>"
        check_connectors(ElementTree.fromstring(text), Member("m", fmu))

    return check


@pytest.mark.parametrize(
    "connector",
    [
        '<ssd:Connector name="u" kind="input"/>',
        '<ssd:Connector name="u" kind="input"><ssc:Float64 unit="1"/><ssc:Dimension size="2"/>'
        "</ssd:Connector>",
        '<ssd:Connector name="u" kind="input"><ssc:Real/><ssc:Dimension/></ssd:Connector>',
        '<ssd:Connector name="n" kind="structuralParameter"><ssc:UInt64/></ssd:Connector>',
        '<ssd:Connector name="A" kind="parameter"><ssc:Dimension sizeConnector="n"/>'
        '<ssc:Dimension size="3"/></ssd:Connector>',
    ],
)
def test_what_is_so_passes(checked, connector):
    checked(connector)


@pytest.mark.parametrize(
    ("connector", "message"),
    [
        ('<ssd:Connector name="v" kind="input"/>', "'v': the FMU has no variable of this name"),
        ('<ssd:Connector name="u"/>', "declared as no kind, but in the FMU it is input"),
        (
            '<ssd:Connector name="u" kind="output"/>',
            "declared as output, but in the FMU it is input",
        ),
        (
            '<ssd:Connector name="u" kind="input"><ssc:Dimension size="3"/></ssd:Connector>',
            "declared as 3 elements, but in the FMU it has 2",
        ),
        (
            '<ssd:Connector name="u" kind="input"><ssc:Int32/></ssd:Connector>',
            "declared as Int32, but in the FMU it is Real",
        ),
        (
            '<ssd:Connector name="u" kind="input"><ssc:Clock/></ssd:Connector>',
            "is Clock; known are",
        ),
    ],
)
def test_what_is_not_so_is_refused(checked, connector, message):
    with pytest.raises(UserError) as caught:
        checked(connector)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
