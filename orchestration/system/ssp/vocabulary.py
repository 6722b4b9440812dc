"""The words of SSP 1.0 that are both written and read."""

from __future__ import annotations

from fmus.kit.build.parameters import SSC, SSV

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
NAMESPACES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP, "oms": OMS}

ENDINGS = (".ssp", ".ssd")  # an archive, and a bare description
DESCRIPTION = "SystemStructure.ssd"
FMU = "application/x-fmu-sharedlibrary"
PARAMETERS = "application/x-ssp-parameter-set"
PARAMETER_SET = (
    "start"  # name of every member's set: Ecos applies the sets of the name that it is given
)
STEP = "com.opensimulationplatform"  # annotation of libcosim with the communication step, for which SSP has no word
MASTER = "org.openmodelica"  # annotation of OMSimulator with its master, without which it refuses a system
# Annotation with the inputs and outputs of the system, in SSP's own elements, and the element that they are in.
CONNECTORS, OUTSIDE = "ppy-rig.system-connectors", "Outside"


def tag(name: str) -> str:
    """Qualified name, as ElementTree has it, of ``prefix:name``."""
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"
