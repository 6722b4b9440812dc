"""Claims: names, units, descriptions and titles of others' files act in nothing that reads or
writes them, and where a name cannot be used a command says so in one line.

The oracles are `CANARY`, which any of the names would leave, and readers of what is written:
`html.parser`, `tomllib`, `ast`, a browser.
"""

from __future__ import annotations

import ast
import csv
import io
import json
import random
import re
import tomllib
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fmus.kit import UserError, quoting
from fmus.kit.modelica.names import string as modelica_string
from fmus.kit.symbolic.codegen import c_string
from orchestration.reporting.html import Bar, Page, elements, format_quantities
from tests.support.browser import chromium
from tests.support.command import here
from tests.support.hostile_names import (
    CANARY,
    NAMES,
    acting,
    drawn,
    faults,
    in_xml,
    write_fmu,
    write_record,
)
from tests.support.hosts import build_one_state_fmu
from tests.support.source import ROOT

_SEED = 20261128
_QUOTING = (
    *("exec", "eval", "os.system", "os.popen", "html.escape", "standard.escape"),
    *("shlex.quote", "shlex.join", "shlex.split", "saxutils.escape"),
)
# @u, @x and @tau stand for the names of the input, the output and the parameter of an FMU
_READING = ("info m.fmu", "check m.fmu", "info r.csv --model m.fmu")
_SIMULATING = (
    "simulate m.fmu --no-isolate --stop 1 --out o.csv",
    "simulate m.fmu --no-isolate --stop 1 --out o.nc --plot o.svg",
)
_FITTING = (
    "compare r.csv --model m.fmu --no-isolate --plot c.png",
    "identify r.csv --model m.fmu --no-isolate --fit @tau --report i.html --ssv i.ssv --json -",
)
_SWEEPING = (
    "sweep m.fmu --no-isolate --stop 1 --over @tau=1..2:3 --out s.nc --report s.html",
    "optimise m.fmu --no-isolate --stop 1 --over @tau=1..2 --minimise @x --runs 6 --report o.html",
)
_ANALYSING = (
    "linearise m.fmu --no-isolate --plot l.svg",
    "frequency r.csv --of @x/@u --out f.csv --plot f.svg",
    "black-box r.csv --output @x --inputs @u --orders 1 --out own.py --report b.html",
    "info own.py",
)
_DIAGNOSING = (
    "diagnose r.csv --model m.fmu --no-isolate --fit @tau --effects none --time 2s"
    " --report d.html --json d.json --ssp d.ssp",
    "system check d.ssp",
    "system draw d.ssp --out d.svg",
    "run d.ssp --no-isolate --set duration=1s --out d.nc",
)
_MODEL = """
from fmus.kit import Component, Input, Output, Parameter, State


class Wall(Component):
    {text!a}

    name = "wall"
    remark = {text!a}
    gain = Parameter(1.0, "1", min=0, max=9, doc={text!a}, title={text!a}, source={text!a})
    lag = Parameter(1.0, "s", min=0.1, max=9.0)
    drive = Input("1", doc={text!a}, title={text!a})
    response = State("1", rate="rate", doc={text!a}, title={text!a})

    def rate(self):
        {text!a}
        return (self.gain * self.drive - self.response) / self.lag

    @Output("1", title={text!a})
    def measured(self):
        {text!a}
        return self.response
"""
_EXPERIMENT = """# {comment}
title = {text}
component = "m.fmu"
duration = "1 s"
step = "0.1 s"
record = [{x}]
[parameters]
{tau} = 1.0
[inputs.{u}]
kind = "constant"
value = 1.0
"""


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    return build_one_state_fmu(tmp_path_factory.mktemp("lag"))


def written(folder, lag, name, unit="s"):
    """Write an FMU and a record with a name, and return the words that stand for its variables."""
    names = {"@u": f"u{name}", "@x": in_xml(name), "@tau": f"p{name}"}
    write_fmu(folder / "m.fmu", lag, [*names.values()], name, unit)
    write_record(folder / "r.csv", names["@u"], name)
    return names


def ran(folder, names, *commands):
    """Run commands with names in their words, and return what is wrong with how they ended."""
    found = []
    for command in commands:
        words = command.split()
        for place, name in names.items():
            words = [word.replace(place, name) for word in words]
        if "\0" in "".join(words):  # no shell has it in a word
            continue
        done = here(*words, cwd=folder)
        found += [
            f"{command}: {fault}"
            for fault in faults(done.returncode, done.stdout, done.stderr, folder)
        ]
    return found


@pytest.mark.parametrize("name", NAMES, ids=lambda name: ascii(name)[:30])
def test_a_name_is_read_and_shown_and_does_nothing(name, lag, tmp_path):
    assert ran(tmp_path, written(tmp_path, lag, name, unit=name), *_READING) == []


@pytest.mark.parametrize("name", NAMES[::6], ids=lambda name: ascii(name)[:30])
def test_a_name_is_written_and_does_nothing(name, lag, tmp_path):
    assert ran(tmp_path, written(tmp_path, lag, name), *_SIMULATING) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("commands", "every"),
    [(_SIMULATING, 1), (_FITTING, 2), (_SWEEPING, 2), (_ANALYSING, 5), (_DIAGNOSING, 8)],
    ids=["simulating", "fitting", "sweeping", "analysing", "diagnosing"],
)
def test_no_command_makes_code_of_a_name(commands, every, lag, tmp_path):
    found = []
    for k, name in enumerate(NAMES[::every]):
        folder = tmp_path / str(k)
        folder.mkdir()
        found += [
            f"{name[:40]!r}: {fault}"
            for fault in ran(folder, written(folder, lag, name), *commands)
        ]
    assert found == []


@pytest.mark.slow
def test_texts_of_a_users_model_are_texts_in_its_fmu_and_in_modelica(tmp_path):
    found = []
    for k, name in enumerate(NAMES):
        folder = tmp_path / str(k)
        folder.mkdir()
        (folder / "wall.py").write_text(_MODEL.format(text=name), encoding="utf-8")
        faulty = ran(
            folder,
            {},
            "info wall.py:Wall",
            "build wall.py:Wall --runtime native --platforms linux64",
            "export modelica wall.py:Wall --out modelica",
        )
        for path in folder.rglob("*.fmu"):
            with zipfile.ZipFile(path) as archive:
                for entry in archive.namelist():
                    content = archive.read(entry)
                    if entry.endswith(".xml"):
                        ElementTree.fromstring(content)
                    elif entry.endswith(".html"):
                        faulty += acting(content.decode())
        found += [f"{name[:40]!r}: {fault}" for fault in faulty]
    assert found == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "stem", ["class", "2-layer", "a.b", "x import y; import os #", f"$(touch {CANARY})", "-rf"]
)
def test_a_file_of_a_model_may_have_any_name(stem, tmp_path):
    (tmp_path / f"{stem}.py").write_text(_MODEL.format(text="A wall."), encoding="utf-8")
    place = {"@file": f"./{stem}.py:Wall"}
    commands = (
        "build @file --out . --runtime python --platforms linux64",
        "simulate python/wall.fmu --stop 1 --no-isolate",
        "new effect drag --model @file --law rate --out new",
    )
    assert ran(tmp_path, place, *commands) == []
    with zipfile.ZipFile(tmp_path / "python" / "wall.fmu") as archive:
        modules = [name for name in archive.namelist() if name.endswith(".py")]
    parts = {part for name in modules for part in Path(name).with_suffix("").parts}
    assert [part for part in parts if not part.isidentifier()] == []
    assert {path.name for path in (tmp_path / "new").iterdir()} >= {"drag.py", "test_drag.py"}


@pytest.mark.slow
def test_texts_of_an_experiment_are_texts(lag, tmp_path):
    found = []
    for k, name in enumerate(NAMES):
        folder = tmp_path / str(k)
        folder.mkdir()
        names = written(folder, lag, name)
        try:
            quoted = {place[1:]: quoting.toml(in_xml(text)) for place, text in names.items()}
            text = quoting.toml(name)
        except UserError:
            continue  # TOML has no bytes that are no text
        comment = quoting.visible(name)
        (folder / "e.toml").write_text(
            _EXPERIMENT.format(text=text, comment=comment, **quoted), encoding="utf-8"
        )
        faulty = ran(
            folder,
            {},
            "run e.toml --no-isolate --out o.nc --plot o.html",
            "run o.nc --no-isolate",
        )
        found += [f"{name[:40]!r}: {fault}" for fault in faulty]
    assert found == []


@pytest.mark.slow
def test_ten_thousand_names_are_read_back_from_what_is_written():
    """Each language by its own reader; those of C and Modelica are in `read_literal`."""
    draw, found = random.Random(_SEED), []
    for _ in range(10_000):
        name = drawn(draw)
        page = Page(name, name, name)
        page.table([name], [[name]])
        page.text(format_quantities(name))
        page.parts.append(elements.bar_chart(name, [Bar(name, "#000", 1.0, name)]))
        page.parts += [elements.named(name, name, name), elements.chip("cause", name)]
        found += [(name, fault) for fault in acting(page.html())]
        shown = quoting.line(name)
        if not shown.isprintable():
            found.append((name, "is not printable"))
        legal = name.encode("utf-8", "ignore").decode()
        if tomllib.loads(f"{quoting.toml_key(legal)} = {quoting.toml(legal)}") != {legal: legal}:
            found.append((name, "is another in TOML"))
        if read_literal(modelica_string(legal)) != legal or read_literal(c_string(legal)) != legal:
            found.append((name, "is another in C or Modelica"))
        if ast.literal_eval(ascii(name)) != name or json.loads(json.dumps(name)) != name:
            found.append((name, "is another in Python or JSON"))
        rows = io.StringIO(newline="")
        csv.writer(rows).writerow([legal, "x"])
        if next(csv.reader(io.StringIO(rows.getvalue(), newline=""))) != [legal, "x"]:
            found.append((name, "is another in CSV"))
    assert found == []


def quoting_calls(path):
    """Yield what a module calls to quote for a language, or to make code of a text."""
    text = path.read_text(encoding="utf-8")
    if not re.search(r"exec|eval\(|os\.|escape|shlex|shell", text):  # to parse it takes long
        return
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Call):
            continue
        name = ast.unparse(node.func)
        if name in _QUOTING or any(k.arg == "shell" for k in node.keywords):
            yield name


def test_texts_are_quoted_and_made_code_only_where_the_page_of_security_says():
    page = (ROOT / "docs" / "reference" / "security.md").read_text(encoding="utf-8")
    found = {
        f"`{path.relative_to(ROOT).as_posix()}`"
        for package in ("fmus", "orchestration", "ppy_rig", "demonstrations")
        for path in (ROOT / package).rglob("*.py")
        if [*quoting_calls(path)]
    }
    assert len(found) == 4
    assert [place for place in sorted(found) if place not in page] == []
    functions = {name for name, value in vars(quoting).items() if is_own(value)}
    assert {name for name in functions if f"`quoting.{name}`" in page} == functions


def is_own(value):
    """Return whether something is a function of `quoting`."""
    return getattr(value, "__module__", "") == quoting.__name__


def read_literal(text):
    """Return the text of a literal of Modelica, or of C in UTF-8: escapes are octal or a mark."""
    assert text[0] == text[-1] == '"'
    body, found, k = text[1:-1].encode(), bytearray(), 0
    while k < len(body):
        assert body[k : k + 1] != b'"'
        if body[k : k + 1] != b"\\":
            found.append(body[k])
            k += 1
        elif body[k + 1 : k + 2].isdigit():
            found.append(int(body[k + 1 : k + 4], 8))
            k += 4
        else:
            found.append(body[k + 1])
            k += 2
    return found.decode()


@pytest.mark.slow
def test_a_browser_shows_names_and_runs_nothing(browser, lag, tmp_path):
    page = Page("names", "of others")
    for name in NAMES:
        page.heading(name)
        page.table([name], [[name]])
        page.parts += [elements.named(name, "", name), elements.bar_chart(name, [])]
        page.code([quoting.shell([name])])
    page.write(tmp_path / "all.html")
    scripts = [name for name in NAMES if "document" in name]
    pages = [tmp_path / "all.html"]
    for k, name in enumerate(scripts):
        folder = tmp_path / str(k)
        folder.mkdir()
        ran(folder, written(folder, lag, name), *_FITTING)
        pages += folder.glob("*.html")
    assert len(pages) == 1 + len(scripts)
    with chromium(browser, tmp_path / "profile") as tab:
        for path in pages:
            tab.open(path, 1280)
            assert tab.run("document.title") != CANARY
            assert tab.run("document.scripts.length") == 0
            assert tab.complaints == []


@pytest.mark.slow
def test_many_drawn_names_in_one_fmu_do_nothing(lag, tmp_path):
    """Fifty FMUs, each with two hundred outputs of drawn names that are aliases of one another."""
    draw, found = random.Random(_SEED + 1), []
    for k in range(50):
        folder = tmp_path / str(k)
        folder.mkdir()
        names = list(dict.fromkeys(in_xml(drawn(draw)) for _ in range(200)))
        write_fmu(folder / "plain.fmu", lag, ("u", "x", "tau"), names[0], names[0])
        with (
            zipfile.ZipFile(folder / "plain.fmu") as old,
            zipfile.ZipFile(folder / "m.fmu", "w") as new,
        ):
            for entry in old.namelist():
                content = old.read(entry)
                if entry == "modelDescription.xml":
                    content = with_outputs(content.decode(), names).encode()
                new.writestr(entry, content)
        commands = (*_READING[:2], _SIMULATING[1])
        found += [f"{k}: {fault}" for fault in ran(folder, {}, *commands)]
    assert found == []


def with_outputs(description, names):
    """Return a model description with further outputs, aliases of the one that it has."""
    root = ElementTree.fromstring(description)
    variables, outputs = root.find("ModelVariables"), root.find("ModelStructure/Outputs")
    for name in names:
        about = {"name": name, "valueReference": "1", "causality": "output", "description": name}
        ElementTree.SubElement(ElementTree.SubElement(variables, "ScalarVariable", about), "Real")
        ElementTree.SubElement(outputs, "Unknown", index=str(len(variables)), dependencies="")
    return ElementTree.tostring(root, encoding="unicode")
