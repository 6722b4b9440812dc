"""The documents in an FMU: a page with README and variables, licences, icon, presets, reference.

The page is ``documentation/index.html``; it loads no other file.
"""

from __future__ import annotations

import posixpath
import re
import sys
from collections.abc import Collection, Iterable
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from fmus.kit import quoting
from fmus.kit.build.parameters import serialized, to_ssv
from fmus.kit.component import Component
from fmus.kit.declare import Declaration, ParameterDeclaration, TextDeclaration
from fmus.kit.effects import Effect
from fmus.kit.titles import within_sentence
from fmus.kit.units import format_range, format_value

_LICENCES = Path(__file__).parent / "licences"
_REFERENCES = "extra/org.fmi-standard.fmi-ls-ref"
# a full stop before a capital letter, the next item or the end of the list; not that of "fig. 2"
_END_OF_SENTENCE = r"\.(?=\s+(?:[A-Z`]|\d+\. )|\s*\n\n|\s*\Z)"
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; \
padding: 0 1rem; color: #1c2733 }
h1, h2, h3 { line-height: 1.2; color: #0b3d5c } \
code, pre { font: 0.92em ui-monospace, monospace; background: #f2f5f8 }
pre { padding: 0.8rem; overflow-x: auto } code { padding: 0.1em 0.25em } pre code { padding: 0 }
div.table { overflow-x: auto } table { border-collapse: collapse; margin: 1rem 0 }
th, td { border: 1px solid #c9d3dc; padding: 0.3rem 0.6rem; text-align: left; vertical-align: top }
th { background: #eef3f7 } img { max-width: 100% } \
td.number { text-align: right; font-variant-numeric: tabular-nums }
"""


def documents(cls: type[Component]) -> dict[str, bytes]:
    """Collect the documents of a component, by path in the archive.

    Parameters
    ----------
    cls : type[Component]
        Its README, icon and reference result are in the folder of its module.

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
    files |= _reference_files(cls, folder / "reference")
    return files | {f"{_REFERENCES}/fmi-ls-manifest.xml": _manifest(files)}


def relaxed_assumption(cls: type[Component], effect: type[Effect]) -> tuple[str, str]:
    """Return the assumption of a component that an effect relaxes.

    Parameters
    ----------
    cls : type[Component]
        Its README numbers the assumptions.
    effect : type[Effect]
        Gives the number of the assumption, or its words.

    Returns
    -------
    words : str
        ``the model assumes that ...``, from the first sentence of the assumption in the README;
        empty if the README has no assumption of this number.
    number : str
        ``assumption 5 of its documentation``; empty if the effect gives words.
    """
    assumption = effect.assumption
    if isinstance(assumption, str):
        return f"the model assumes that {assumption}" if assumption else "", ""
    readme = _folder(cls) / "README.md"
    text = readme.read_text(encoding="utf-8") if readme.exists() else ""
    listed = text.partition("\n## Assumptions\n")[2]
    number = f"assumption {assumption} of its documentation"
    # "5. `name`, `name`: words." or "5. words."
    sentence = re.search(
        rf"^{assumption}\. (?:(?:`\w+`, )*`\w+`: )?(.+?){_END_OF_SENTENCE}", listed, re.M | re.S
    )
    if sentence is None:
        return "", number
    words = within_sentence(" ".join(sentence[1].replace("`", "").split()))
    return f"the model assumes that {words}", number


def _folder(cls: type[Component]) -> Path:
    """Return the folder of the module of a component, with or without effects."""
    return Path(getattr(sys.modules.get(cls.__module__), "__file__", None) or "").parent


def _reference_files(cls: type[Component], folder: Path) -> dict[str, bytes]:
    """Return the files of the reference result: an MA-HS experiment with its inputs and outputs.

    There are none for a component with effects.
    """
    stimuli = folder / f"{cls.name}_in.csv"
    results = folder / f"{cls.name}_ref.csv"
    if not results.exists():
        return {}
    options = (folder / f"{cls.name}_ref.opt").read_text(encoding="utf-8")
    experiments = Element("Experiments", name=cls.name)
    experiment = SubElement(
        experiments,
        "Experiment",
        name="reference",
        startTime="0",
        stopTime=_option(options, "StopTime"),
        stepSize=_option(options, "StepSize"),
        description="solved independently of this FMU; inputs are held, a repeated time is a jump",
    )
    SubElement(experiment, "Stimuli", source=stimuli.name, type="text/csv")
    SubElement(experiment, "References", source=results.name, type="text/csv")
    return {
        f"{_REFERENCES}/{cls.name}.exp": serialized(experiments),
        f"{_REFERENCES}/{stimuli.name}": stimuli.read_bytes(),
        f"{_REFERENCES}/{results.name}": results.read_bytes(),
    }


# MIME type, role and description in the manifest of FMI-LS-REF, by the end of a name
_RELATED = {
    ".html": ("text/html", "document", "equations, assumptions, sources and variables"),
    ".ssv": ("application/x-ssp-parameter-set", "parameter", "a set of parameters"),
    ".exp": (
        "application/x-ma-hs-experiments",
        "experiment/validation",
        "a run whose results are known independently of this FMU",
    ),
    "_in.csv": ("text/csv", "testcase", "inputs of that run"),
    "_ref.csv": ("text/csv", "result", "results of that run"),
}


def _manifest(files: Collection[str]) -> bytes:
    """Write the manifest of FMI-LS-REF 1.0.0-beta.1 for files, by paths in the archive."""
    manifest = Element(
        "fmiReferences",
        {
            "xmlns:fmi-ls": "http://fmi-standard.org/fmi-ls-manifest",
            "fmi-ls:fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            "fmi-ls:fmi-ls-version": "1.0.0-beta.1",
            "fmi-ls:fmi-ls-description": (
                "Layered Standard providing information on related files included in an FMU."
            ),
        },
    )
    for ending, (kind, role, description) in _RELATED.items():
        for path in sorted(path for path in files if path.endswith(ending)):
            SubElement(
                manifest,
                "Related",
                type=kind,
                source=posixpath.relpath(path, _REFERENCES),
                role=role,
                description=description,
            )
    return serialized(manifest)


def _option(text: str, key: str) -> str:
    """Return the value of a key from lines ``key,value``."""
    value: str = re.findall(rf"^{key},(.*)$", text, re.M)[0]
    return value


def page(cls: type[Component], readme: Path) -> str:
    """Write the documentation page of a component.

    Parameters
    ----------
    cls : type[Component]
    readme : Path
        README of the component, in Markdown.

    Returns
    -------
    str
        HTML that loads no other file.
    """
    from markdown_it import MarkdownIt

    heading = f"# {cls.name}\n\n{cls.__doc__ or ''}"
    text = readme.read_text(encoding="utf-8") if readme.exists() else heading
    # a docstring may have the name of a file from anybody; the page loads no other file
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table").disable("image")
    rendered = markdown.render(text)
    opened = rendered.replace("<table>", '<div class="table"><table>')
    body = opened.replace("</table>", "</table></div>")
    layout = cls.layout
    sections = {
        "Inputs": layout.inputs,
        "Outputs": layout.shown,
        "Parameters": (*layout.parameters, *layout.texts),
        "States": (*layout.states, *layout.discretes),
    }
    tables = "".join(_table(title, rows) for title, rows in sections.items() if rows)
    remarks = "".join(f"<li>{quoting.html(line)}</li>" for line in cls.remark.splitlines())
    note = f"<h2>What was made of it</h2><ul>{remarks}</ul>" if remarks else ""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta'
        f' charset="utf-8"><title>{cls.name}</title><meta name="viewport"'
        ' content="width=device-width,'
        f' initial-scale=1"><style>{STYLE}</style></head>\n<body>{body}{note}<h2>Variables of'
        f" <code>{cls.name}</code></h2>{tables}</body></html>\n"
    )


def _table(title: str, variables: Iterable[Declaration]) -> str:
    """Write a table of variables; parameters have a default and a range."""
    is_of_parameters = title == "Parameters"
    rows = []
    for v in variables:
        unit = v.unit if v.unit != "1" else ""
        cells = f"<td><code>{v.name}</code></td><td>{quoting.html(unit)}</td>"
        if is_of_parameters:
            cells += f'<td class="number">{quoting.html(_default(v))}</td>'
            cells += f"<td>{quoting.html(_range(v))}</td>"
        text = quoting.html(v.doc + (f" ({v.source})" if v.source else ""))
        rows.append(f"<tr>{cells}<td>{text}</td></tr>")
    extra = "<th>default</th><th>allowed</th>" if is_of_parameters else ""
    head = f"<tr><th>name</th><th>unit</th>{extra}<th>meaning</th></tr>"
    return f'<h3>{title}</h3><div class="table"><table>{head}{"".join(rows)}</table></div>\n'


def _default(variable: Declaration) -> str:
    """Return the default of a parameter with its unit, or of a text."""
    if isinstance(variable, ParameterDeclaration):
        return format_value(variable.start, variable)
    return str(getattr(variable, "start", ""))


def _range(variable: Declaration) -> str:
    """Return the range of a parameter, and whether it is tunable; a text has none."""
    if isinstance(variable, TextDeclaration):
        return ""
    return format_range(variable) + (", tunable" if getattr(variable, "tunable", False) else "")
