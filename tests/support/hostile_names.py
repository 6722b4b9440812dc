"""Names that would be code, markup or an action where they are not quoted, and files with them.

Each may stand for a variable, a unit, a description, a title or a file; `CANARY` would appear if
one of them acted: as a file in the folder of a command, or as the title of a page.
"""

from __future__ import annotations

import ast
import csv
import random
import re
import zipfile
from collections.abc import Iterator, Sequence
from html.parser import HTMLParser
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from tests.support.lag import STEP, lagged

CANARY = "CANARY"
_TOUCH = f"touch {CANARY}"
NAMES = (
    # of Python, C, Modelica, a shell
    f"__import__('os').system('{_TOUCH}')",
    f'z"); __import__("os").system("{_TOUCH}"); ("',
    f"'''\nimport os; os.system('{_TOUCH}')\n'''",
    f'"""+__import__("os").system("{_TOUCH}")+"""',
    f'";system("{_TOUCH}");//',
    f"*/ system(1); /* $({_TOUCH})",
    f"`{_TOUCH}`; {_TOUCH} | {_TOUCH}",
    "end x; annotation(__a=1)",
    # of HTML, SVG, XML, Markdown
    f"<script>document.title='{CANARY}'</script>",
    f'"><img src=x onerror="document.title=\'{CANARY}\'">',
    f"' onload='document.title=\"{CANARY}\"",
    f"</title><svg onload=document.title='{CANARY}'>",
    "]]> --> &lt;b&gt; &amp;",
    f"[a](javascript:document.title='{CANARY}') | **b** `c`",
    # of formats, templates, formulas, logs and tables
    "{} {0} {a.b} %s %n %(a)s",
    "$\\nosuch{$ ${jndi:ldap://x}",
    "=1+1",
    "@x",
    "a,b;c",
    "[bold red]x[/]",
    ":smile: [/]",
    # what moves a cursor, turns the direction of writing, or cannot be seen
    "a\nb",
    "a\r\tb",
    "a\x1b[2Jb",
    "a\x9b2Jb",
    "a\x00b",
    "\u202egnp.exe",
    "a\u2028b\u200b\ufeff",
    "\ud800",
    # of paths and options
    "../../x",
    "/etc/passwd",
    "CON",
    "-rf",
    f"--out={CANARY}",
    "a\\",
    # of nothing, of everybody, too long, of other scripts
    "'say \"hi\"'",
    " a ",
    "",
    "time",
    "nan",
    "class",
    "a.b[1]",
    "ä𝕏日本",
    "x" * 10_000,
)
_PIECES = [*"'\"\\/<>&;:=$%{}[]()|`*#@!,. \n\r\t\x00\x1b\x9b\u202e\u2028\ufeff\ud800", *NAMES]
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_FORBIDDEN = ("script", "iframe", "object", "embed", "link", "base", "form", "img")
_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName={model} guid="one-state" description={doc}
  author={doc} generationTool={doc} version={doc}>
<CoSimulation modelIdentifier="one_state" canHandleVariableCommunicationStepSize="true"
  canGetAndSetFMUstate="true" canSerializeFMUstate="true" canNotUseMemoryManagementFunctions="true"
  providesDirectionalDerivative="true"/>
<UnitDefinitions><Unit name={unit}><BaseUnit s="1"/><DisplayUnit name={unit}/></Unit>
</UnitDefinitions>
<ModelVariables>
<ScalarVariable name={u} valueReference="0" causality="input" description={doc}><Real start="0"/>
</ScalarVariable>
<ScalarVariable name={x} valueReference="1" causality="output" initial="exact" description={doc}>
<Real start="0"/></ScalarVariable>
<ScalarVariable name={tau} valueReference="2" causality="parameter" variability="fixed"
  description={doc}><Real unit={unit} displayUnit={unit} start="1" min="0"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>
"""


def drawn(draw: random.Random) -> str:
    """Draw a name of one to five pieces."""
    return "".join(draw.choice(_PIECES) for _ in range(draw.randint(1, 5)))[:12_000]


def in_xml(text: str) -> str:
    """Return what an XML file can hold of a text: no control characters, no surrogates."""
    return _ILLEGAL.sub("", text)


def write_fmu(path: Path, original: Path, names: Sequence[str], text: str, unit: str) -> None:
    """Write the FMU of a lag, `original`, with other names of u, x and tau, and other texts."""
    u, x, tau = names
    words = {"u": u, "x": x, "tau": tau, "model": text, "doc": text, "unit": unit}
    escapes = {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}
    quoted = {key: quoteattr(in_xml(word), escapes) for key, word in words.items()}
    with zipfile.ZipFile(original) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            if name != "modelDescription.xml":
                new.writestr(name, old.read(name))
        new.writestr("modelDescription.xml", _DESCRIPTION.format(**quoted).encode())


def write_record(path: Path, u: str, x: str) -> None:
    """Write a record of a lag with a time constant other than 1 s, and an output that bends."""
    draw = np.random.default_rng(3)
    held = np.repeat(draw.uniform(-1.0, 1.0, 20), 10)
    x_lagged = lagged(held)
    bent = x_lagged + 0.1 * x_lagged**2 + draw.normal(0.0, 1e-3, held.size)
    with path.open("w", newline="", encoding="utf-8", errors="surrogatepass") as file:
        rows = csv.writer(file)
        rows.writerow(["time [s]", f"{u} [1]", f"{x} [1]"])
        rows.writerows(zip(STEP * np.arange(held.size), held, bent, strict=True))


class _Page(HTMLParser):
    """A page, with what a name may not have brought into it."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        own = tag == "img" and dict(attrs).get("src", "").startswith("data:image/png;base64,")
        if tag in _FORBIDDEN and not own:
            self.found.append(f"<{tag}>")
        for name, value in attrs:
            script = name in ("href", "src") and "javascript:" in (value or "").lower()
            if name.startswith("on") or script:
                self.found.append(f"<{tag} {name}={value!r}>")


def acting(page: str) -> list[str]:
    """Return elements and attributes of a page that act."""
    parser = _Page()
    parser.feed(page)
    parser.close()
    return parser.found


def calls(source: str) -> set[str]:
    """Return the names of what Python source calls, and of what it imports."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
                found.add(name)
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                found |= {alias.name for alias in names}
    return found


def faults(code: int, printed: str, told: str, folder: Path) -> Iterator[str]:
    """Yield what a command must not do with names of others.

    Parameters
    ----------
    code : int
        Its exit code.
    printed, told : str
        Its standard output, and standard error.
    folder : Path
        In which it ran, with the files that it wrote.
    """
    text = printed + told
    if any(not (c.isprintable() or c == "\n") for c in text):
        hidden = next(c for c in text if not (c.isprintable() or c == "\n"))
        yield f"{hidden!r} is printed"
    for word in ("Traceback", "internal error", "Warning:"):
        if word in text:
            yield next(line for line in text.splitlines() if word in line)
    errors = [line for line in told.splitlines() if line.startswith("error: ")]
    if code not in (0, 1, 2) or (code == 2 and errors != told.splitlines()[-1:]):
        yield f"ended with {code}: {told[-300:]}"
    for path in folder.rglob("*"):
        if path.name == CANARY:
            yield f"{path} was made"
        elif path.suffix == ".html":
            yield from acting(path.read_text(encoding="utf-8"))
        elif path.suffix == ".py" and calls(path.read_text(encoding="utf-8")) & {
            "system",
            "__import__",
            "os",
        }:
            yield f"{path.name} calls what a name says"
