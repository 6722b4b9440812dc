"""SSP files that something was changed in, and the XML to put there."""

import zipfile

DESCRIPTION = "SystemStructure.ssd"
BINDINGS = "<ssd:ParameterBindings>{}</ssd:ParameterBindings>"
SET = (
    '<ssv:ParameterSet version="1.0"'
    ' name="s"><ssv:Parameters>{}</ssv:Parameters></ssv:ParameterSet>'
)
INLINE = (
    f"<ssd:ParameterBinding><ssd:ParameterValues>{SET}</ssd:ParameterValues></ssd:ParameterBinding>"
)
NAMESPACES = (
    'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" '
    'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
)


def repacked(path, change=None, extra=(), name="other.ssp"):
    """A copy of an archive whose description went through a function, with extra entries."""
    copy = path.with_name(name)
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(copy, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.namelist():
            data = old.read(entry)
            if entry == DESCRIPTION and change is not None:
                data = change(data.decode()).encode()
                assert data != old.read(entry), "the change changed nothing"
            if data:
                new.writestr(entry, data)
        for entry, data in extra:
            new.writestr(entry, data)
    return copy
