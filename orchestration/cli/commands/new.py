"""``ppy new``: files to start from, which pass their checks."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from string import Template

from fmus.kit import quoting
from fmus.kit.errors import UserError, suggestion
from orchestration.cli.command import command
from orchestration.cli.commands.options import NewCommand
from orchestration.cli.outputs import check_outputs

_INSTALL = ("-m", "pip", "install", "pytest")  # which only developers' installations have
_TEMPLATES = Path(__file__).parents[1] / "templates"


@command(NewCommand)
def new(options: NewCommand) -> None:
    """Write a component, an effect or a rig's backend to start from, with its test.

    Edit NAME.py, and run test_NAME.py with pytest. NAME.md lists the rows of documentation to add,
    and the places that register the new part.
    """
    from fmus.kit import files
    from orchestration.reporting.console import out as screen

    kind, name, folder = options["kind"], options["name"], options["out"]
    _check_name(name)
    texts = {
        folder / f"{name}.py": "model",
        folder / f"test_{name}.py": "test",
        folder / f"{name}.md": "rows",
    }
    check_outputs({}, folder=folder)
    for path in texts:
        if path.exists():
            raise UserError(f"{path} is there already; it will not be overwritten")
    words = _words_of_effect(options) if kind == "effect" else _words(name)
    for path, part in texts.items():
        files.write(path, _fill_template(kind, part, words).encode())
        screen.print(str(path))
    on_path = Path(which("python") or "").parent == Path(sys.executable).parent
    python = "python" if on_path else sys.executable
    if find_spec("pytest") is None:
        screen.print(f"its test needs pytest: {quoting.shell([python, *_INSTALL])}")
    screen.print(f"try it: {quoting.shell([python, '-m', 'pytest', folder / f'test_{name}.py'])}")
    if kind == "backend":
        place = f"{folder / words['file']}:{words['Class']}"
        screen.print(f"serve it: {quoting.shell(['ppy', 'rig', 'serve', '--backend', place])}")


def _fill_template(kind: str, part: str, words: Mapping[str, str]) -> str:
    """Return the text of a template with words in its places."""
    text = (_TEMPLATES / kind / f"{part}.txt").read_text(encoding="utf-8")
    return Template(text).substitute(words)


def _check_name(name: str) -> None:
    """Refuse a name that a module of Python cannot have, with a similar one that it can."""
    import keyword
    import re

    if name.isascii() and name.isidentifier() and name.islower() and not keyword.iskeyword(name):
        return
    better = quoting.identifier(re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower(), "my")
    raise UserError(f"NAME {name!r}: write small letters, digits and underscores, such as {better}")


def _words(name: str) -> dict[str, str]:
    """Return the words that every template has places for."""
    parts = name.split("_")
    return {
        "name": name,
        "file": f"{name}.py",
        "Class": "".join(part.capitalize() for part in parts),
        "Words": " ".join(parts).capitalize(),
    }


def _words_of_effect(options: NewCommand) -> dict[str, str]:
    """Return the words of the templates of an effect: its model and its law.

    Raises
    ------
    UserError
        If there is no such model or law, with the laws that there are.
    """
    from inspect import signature

    from fmus.kit.effects import unstack
    from fmus.kit.layout import law_of
    from fmus.kit.symbolic import list_laws
    from orchestration.fmu.model import find_class

    cls = unstack(find_class(options["model"]))[0]
    law = options["law"]
    laws = [known.name for known in list_laws(cls) if not known.is_output]
    method = law_of(cls, law)
    if law not in laws or method is None:
        raise UserError(f"--law {law!r}: {cls.name} has no such law{suggestion(law, laws)}")
    arguments = list(signature(method).parameters)[1:]
    words = _words(options["name"])
    words |= {
        "law": law,
        "base": cls.name,
        "arguments": "".join(f", {argument}" for argument in arguments),
        "passed": ", ".join(arguments),
        "relaxes": f"Relaxes that {law} is all that there is",
        "typical": ", ".join("0.7" for _ in arguments),
    }
    return words | _words_of_model(options, words)


def _words_of_model(options: NewCommand, words: Mapping[str, str]) -> dict[str, str]:
    """Return the words for the model of an effect, and for the rows that it needs elsewhere."""
    from orchestration.fmu.model import names_class

    model = options["model"]
    if not names_class(model):
        return _words_of_component(model, words)
    file, _, cls = model.rpartition(":")
    relative = Path(os.path.relpath(file, options["out"])).as_posix()
    rows = _fill_template("effect", "places_file", {**words, "model_file": relative}).rstrip()
    place = f'str(FOLDER / {json.dumps(relative, ensure_ascii=False)}) + ":{cls}"'
    return {"model": place, "model_name": quoting.shell([f"{relative}:{cls}"]), "rows": rows}


def _words_of_component(model: str, words: Mapping[str, str]) -> dict[str, str]:
    """Return these words for a component of ours, whose README numbers its assumptions."""
    from fmus.kit import registry
    from orchestration.fmu.model import find_class

    package = find_class(model).__module__.split(".")[1]
    module = find_spec(f"fmus.{package}.effects")
    folder = module is not None and module.submodule_search_locations is not None
    effects = f"fmus/{package}/effects" + ("" if folder else ".py")
    is_rig = package == registry.component(registry.default_model()).__module__.split(".")[1]
    listed = "" if is_rig else ", and in `EFFECTS`"
    more = {**words, "package": package, "effects": effects, "listed": listed}
    tests = _fill_template("effect", "places_rig" if is_rig else "places_component", more).rstrip()
    return {
        "model": f'"{model}"',
        "model_name": model,
        "rows": _fill_template("effect", "places_shipped", {**more, "tests": tests}).rstrip(),
        "relaxes": f"Relaxes assumption N, that {words['law']} is all that there is",
    }
