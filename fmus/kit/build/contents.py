"""What every FMU brings along beside its model: documentation, licences, icon, presets, the reference result."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fmus.kit.build.documentation import page
from fmus.kit.build.parameters import to_ssv
from fmus.kit.component import Component

_LICENCES = Path(__file__).parent / "licences"


def documents(cls: type[Component]) -> dict[str, bytes]:
    """Collect what stands beside the component's class, by its path in the archive.

    Parameters
    ----------
    cls : type[Component]

    Returns
    -------
    dict of str to bytes
    """
    folder = _folder(cls)
    files = {"documentation/index.html": page(cls, folder / "README.md").encode()}
    for licence in sorted(_LICENCES.iterdir()):
        files[f"documentation/licenses/{licence.name}"] = licence.read_bytes()
    icon = folder / "model.png"
    if icon.exists():
        files["model.png"] = icon.read_bytes()
    declared = {p.name: p for p in cls.layout.parameters}
    for name, preset in cls.presets.items():
        files[f"resources/presets/{name}.ssv"] = to_ssv(name, preset.values, declared, preset.doc)
    return files | _reference(cls, folder / "reference")


def _reference(cls: type[Component], folder: Path) -> dict[str, bytes]:
    """Pack the reference result in the form of FMI-LS-REF 1.0.0-alpha.1; none for a component that was extended."""
    stimuli, results = folder / f"{cls.name}_in.csv", folder / f"{cls.name}_ref.csv"
    if not results.exists():
        return {}
    place = "extra/org.fmi-standard.fmi-ls-ref"
    namespace = "http://fmi-standard.org/fmi-ls-manifest"
    manifest = Element(
        "fmiReferences",
        {
            "xmlns:fmi-ls": namespace,
            "fmi-ls:fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            "fmi-ls:fmi-ls-version": "1.0.0-alpha.1",
            "fmi-ls:fmi-ls-description": "files related to this FMU",
        },
    )
    stop, step = (
        re.findall(
            rf"^{key},(.*)$", (folder / f"{cls.name}_ref.opt").read_text(encoding="utf-8"), re.M
        )[0]
        for key in ("StopTime", "StepSize")
    )
    experiments = Element("Experiments", name=cls.name)
    experiment = SubElement(
        experiments,
        "Experiment",
        name="reference",
        startTime="0",
        stopTime=stop,
        stepSize=step,
        description="solved independently of this FMU; inputs are held, a repeated time is a jump",
    )
    SubElement(experiment, "Stimuli", source=stimuli.name, type="text/csv")
    SubElement(experiment, "References", source=results.name, type="text/csv")
    for element in (manifest, experiments):
        indent(element)
    return {
        f"{place}/fmi-ls-manifest.xml": tostring(manifest, encoding="utf-8", xml_declaration=True),
        f"{place}/experiments.xml": tostring(experiments, encoding="utf-8", xml_declaration=True),
        f"{place}/{stimuli.name}": stimuli.read_bytes(),
        f"{place}/{results.name}": results.read_bytes(),
    }


def _folder(cls: type[Component]) -> Path:
    """Folder of the component, also of one with effects stacked on it."""
    return Path(getattr(sys.modules.get(cls.__module__), "__file__", None) or "").parent
