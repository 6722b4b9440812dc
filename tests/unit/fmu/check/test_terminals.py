"""Claims: terminals of FMI 3.0 that refer to nothing, or have not the form of the schema, are
found.
"""

from __future__ import annotations

import pytest

from orchestration.fmu.check import check_fmu
from tests.support.archive import contents
from tests.support.fmi3_fmus import foreign
from tests.support.fmu_faults import Change, check_that_fault_is_found, lines, packed

FILE = "terminalsAndIcons/terminalsAndIcons.xml"
GOOD = b"""<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>
<Terminal name="pin" matchingRule="plug">
  <TerminalMemberVariable variableName="u" memberName="i" variableKind="signal"/>
  <TerminalMemberVariable variableName="also_y" memberName="y" variableKind="signal"/>
  <TerminalGraphicalRepresentation x1="0" y1="0" x2="9" y2="9" iconBaseName="pin"/>
</Terminal></Terminals></fmiTerminalsAndIcons>"""


def terminals(old: bytes = b"", new: bytes = b"") -> Change:
    def change(files: dict[str, bytes]) -> None:
        assert old in GOOD
        files[FILE] = GOOD.replace(old, new)
        files["terminalsAndIcons/pin.png"] = b"png"

    return change


FAULTS: dict[str, tuple[Change, str]] = {
    "unknown variable": (terminals(b'"u"', b'"v"'), r"1 error: .*: there are no variables v$"),
    "no icon": (terminals(b'="pin"/>', b'="plug"/>'), r"1 error: .*: no picture \(\.png\) of plug"),
    "schema": (terminals(b' matchingRule="plug"', b""), r"1 error: .*'matchingRule' is required"),
    "twice": (
        terminals(b"</Terminals>", b'<Terminal name="pin" matchingRule="plug"/></Terminals>'),
        r"1 error: .*: several terminals are called pin",
    ),
    "damaged": (terminals(b"</Terminals>", b""), r"1 error: .*cannot be read: it is not well"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_found(tmp_path, fault):
    check_that_fault_is_found(foreign("lag"), tmp_path, *FAULTS[fault])


def test_a_good_one_has_none(tmp_path):
    files = contents(foreign("lag"))
    terminals()(files)
    found = lines(check_fmu(packed(tmp_path, files)), "error", "warning")
    assert not [line for line in found if "terminals" in line]
