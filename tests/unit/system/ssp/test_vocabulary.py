"""Claims: elements that are not understood are refused, and those that mean nothing are ignored."""

from __future__ import annotations

import pytest

from orchestration.system import ssp
from tests.support.system.archive import INLINE, repacked
from tests.support.system.ssp_files import bound, contents, refused


@pytest.mark.parametrize(
    ("before", "element", "part"),
    [
        ("<ssd:Elements>", "<ssd:Foo/>", "Foo, in System sample,"),
        ("<ssd:Elements>", "<Foo/>", "Foo, in System sample,"),
        (
            "<ssd:Connections>",
            "<ssd:SignalDictionaries><ssd:Bus/></ssd:SignalDictionaries>",
            "Bus, in SignalDictionaries,",
        ),
        ("<ssd:DefaultExperiment", "<ssd:Foo/>", "Foo, in SystemStructureDescription sample,"),
        ("<ssd:Connection ", '<ssd:Connection2 name="x"/>', "Connection2 x, in Connections,"),
        ("<ssd:Component ", '<ssd:Foo name="x"/>', "Foo x, in Elements,"),
        (
            "<ssc:LinearTransformation",
            "<ssd:Delay/>",
            "Delay, in Connection drive way second load length,",
        ),
    ],
)
def test_elements_that_are_not_understood(system, tmp_path, before, element, part):
    ssp.write(system, tmp_path / "with.ssp", connectors=True)
    other = repacked(tmp_path / "with.ssp", lambda text: text.replace(before, element + before, 1))
    refused(other, tmp_path / "u", part, "this program")


def test_elements_of_a_parameter_set_that_are_not_understood(archive, tmp_path):
    values = INLINE.format('<ssv:Parameter name="gain"><ssv:Real value="1"/></ssv:Parameter>')
    other = repacked(
        archive, bound(values.replace("</ssv:Parameters>", "<ssv:Alias/></ssv:Parameters>"))
    )
    refused(other, tmp_path / "u", "Alias, in Parameters, is not known to this program")


def test_how_things_look_and_what_others_noted_are_passed_over(system, archive, tmp_path):
    note = (
        "<ssd:Annotations><ssc:Annotation"
        ' type="any"><ssd:Foo/><Foo/></ssc:Annotation></ssd:Annotations>'
    )

    def change(text):
        text = text.replace(
            "</ssd:Connector>", f'<ssd:ConnectorGeometry x="0" y="0"/>{note}</ssd:Connector>'
        )
        text = text.replace(
            "</ssd:Component>", f'<ssd:ElementGeometry x1="0"/>{note}</ssd:Component>'
        )
        text = text.replace(
            "</ssd:Elements>", f"</ssd:Elements>{note}<ssd:SystemGeometry/><ssd:GraphicalElements/>"
        )
        return text.replace("<ssd:DefaultExperiment", "<ssd:Enumerations/><ssd:DefaultExperiment")

    assert contents(ssp.read(repacked(archive, change), tmp_path / "u")) == contents(system)
