"""``documentation/index.html`` of an FMU: the component's README and a table of its variables, as one plain page."""

from __future__ import annotations

import html
from collections.abc import Iterable
from pathlib import Path

from fmus.kit.component import Component
from fmus.kit.declare import Declaration, ParameterDeclaration, TextDeclaration
from fmus.kit.units import allowed, shown

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #1c2733 }
h1, h2, h3 { line-height: 1.2; color: #0b3d5c } code, pre { font: 0.92em ui-monospace, monospace; background: #f2f5f8 }
pre { padding: 0.8rem; overflow-x: auto } code { padding: 0.1em 0.25em } pre code { padding: 0 }
div.table { overflow-x: auto } table { border-collapse: collapse; margin: 1rem 0 }
th, td { border: 1px solid #c9d3dc; padding: 0.3rem 0.6rem; text-align: left; vertical-align: top }
th { background: #eef3f7 } img { max-width: 100% } td.number { text-align: right; font-variant-numeric: tabular-nums }
"""


def page(cls: type[Component], readme: Path) -> str:
    """Make the page.

    Parameters
    ----------
    cls : type[Component]
    readme : Path
        Markdown, the component's README.

    Returns
    -------
    str
        HTML that needs nothing from elsewhere.
    """
    from markdown_it import MarkdownIt

    text = (
        readme.read_text(encoding="utf-8")
        if readme.exists()
        else f"# {cls.name}\n\n{cls.__doc__ or ''}"
    )
    body = MarkdownIt("commonmark").enable("table").render(text)
    body = body.replace("<table>", '<div class="table"><table>').replace(
        "</table>", "</table></div>"
    )
    layout = cls.layout
    sections = {
        "Inputs": layout.inputs,
        "Outputs": layout.measurable,
        "Parameters": (*layout.parameters, *layout.texts),
        "States": (*layout.states, *layout.discretes),
    }
    tables = "".join(_table(title, rows) for title, rows in sections.items() if rows)
    remarks = "".join(f"<li>{html.escape(line)}</li>" for line in cls.remark.splitlines())
    note = f"<h2>What was made of it</h2><ul>{remarks}</ul>" if remarks else ""
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{cls.name}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>\n'
        f"<body>{body}{note}<h2>Variables of <code>{cls.name}</code></h2>{tables}</body></html>\n"
    )


def _range(variable: Declaration) -> str:
    return "" if isinstance(variable, TextDeclaration) else allowed(variable)


def _table(title: str, variables: Iterable[Declaration]) -> str:
    rows = []
    for v in variables:
        default = (
            shown(v.start, v) if isinstance(v, ParameterDeclaration) else getattr(v, "start", "")
        )
        unit = v.unit if v.unit != "1" else ""
        text = html.escape(v.doc + (f" ({v.source})" if v.source else ""))
        cells = f"<td><code>{v.name}</code></td><td>{html.escape(unit)}</td>"
        if title == "Parameters":
            cells += f'<td class="number">{html.escape(str(default))}</td><td>{html.escape(_range(v))}</td>'
        rows.append(f"<tr>{cells}<td>{text}</td></tr>")
    extra = "<th>default</th><th>allowed</th>" if title == "Parameters" else ""
    head = f"<tr><th>name</th><th>unit</th>{extra}<th>meaning</th></tr>"
    return f'<h3>{title}</h3><div class="table"><table>{head}{"".join(rows)}</table></div>\n'
