"""``ppy new``: files to start from, which pass their checks."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from string import Template

from fmus.kit import UserError, suggestion
from orchestration.cli.command import command
from orchestration.cli.commands.options import NewCommand
from orchestration.cli.outputs import Outputs

_TEMPLATES = Path(__file__).parents[1] / "templates"
# of what is shipped: where an effect is known besides its class, and what stands there
_PLACES_OF_SHIPPED = """\
| `fmus/$package/effects`, `EFFECTS` | `$Class` |
| `fmus/$package/README.md`, table of effects | `$name`: `$law`, p times the law |
| `tests/support/effect_samples.py`, `ACTIVE` | `"$name": {"${name}_share": 0.2},` |
| `tests/components/$package/test_effects.py` | what it changes, in `CHANGED` |
| `tests/components/$package/test_effects_laws.py` | its equation |
| `studies/emulator`, a module `hidden_...` and `variations.py` | it on the rig, written anew |
| `tests/end_to_end/test_hidden_effects.py` | that against a closed form |
| `studies/judging/laws_clean.py` | the right answers for a record with it |"""
_PLACES_IN_FILE = """\
| `$model_file`, the class | above `EFFECTS`, with the imports it needs |
| `$model_file`, `EFFECTS` | `$Class.id: $Class,` |"""


@command(NewCommand)
def new(options: NewCommand) -> None:
    """Write a component, an effect or a rig's backend to start from, with its test.

    NAME.py is to be changed, test_NAME.py is what pytest runs, and NAME.md has the rows of
    documentation that belong to it, and says where it has to be made known.
    """
    from fmus.kit import files
    from orchestration.reporting import out as screen

    kind, name, folder = options["kind"], options["name"], options["out"]
    _check_name(name)
    texts = {
        folder / f"{name}.py": "model",
        folder / f"test_{name}.py": "test",
        folder / f"{name}.md": "rows",
    }
    Outputs(folders={"--out": folder}).check()
    for path in texts:
        if path.exists():
            raise UserError(f"{path} is there already; it will not be overwritten")
    words = _words_of_effect(options) if kind == "effect" else _words(name)
    for path, part in texts.items():
        template = Template((_TEMPLATES / kind / f"{part}.txt").read_text(encoding="utf-8"))
        files.write(path, template.substitute(words).encode())
        screen.print(str(path))
    screen.print(f"try it: python -m pytest {folder / f'test_{name}.py'}")


def _check_name(name: str) -> None:
    """Refuse a name that can be none of a module in Python."""
    import keyword
    import re

    if name.isascii() and name.isidentifier() and name.islower() and not keyword.iskeyword(name):
        return
    better = re.sub(r"\W+", "_", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)).strip("_").lower()
    hint = f", such as {better}" if better.isidentifier() and not keyword.iskeyword(better) else ""
    raise UserError(f"NAME {name!r}: write small letters, digits and underscores{hint}")


def _words(name: str) -> dict[str, str]:
    """Return the words of every template."""
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

    from fmus.kit import law_of, unstack
    from fmus.kit.symbolic import list_laws
    from orchestration.fmu import find_class

    cls = unstack(find_class(options["model"]))[0]
    law = options["law"]
    laws = [known.name for known in list_laws(cls) if not known.is_output]
    held = law_of(cls, law)
    if law not in laws or held is None:
        raise UserError(f"--law {law!r}: {cls.name} has no such law{suggestion(law, laws)}")
    arguments = list(signature(held).parameters)[1:]
    words = _words(options["name"])
    words |= {
        "law": law,
        "base": cls.name,
        "arguments": "".join(f", {argument}" for argument in arguments),
        "passed": ", ".join(arguments),
        "typical": ", ".join("0.7" for _ in arguments),
    }
    return words | _of_model(options, words)


def _of_model(options: NewCommand, words: Mapping[str, str]) -> dict[str, str]:
    """Return how the test of an effect names its model, and where else the effect belongs."""
    from orchestration.fmu import find_class, names_class

    model = options["model"]
    if not names_class(model):
        package = find_class(model).__module__.split(".")[1]
        rows = Template(_PLACES_OF_SHIPPED).substitute(words, package=package)
        return {"model": f'"{model}"', "model_name": model, "rows": rows}
    file, _, cls = model.rpartition(":")
    beside = Path(os.path.relpath(file, options["out"])).as_posix()
    rows = Template(_PLACES_IN_FILE).substitute(words, model_file=beside)
    place = f"f\"{{FOLDER / '{beside}'}}:{cls}\""
    return {"model": place, "model_name": f"{beside}:{cls}", "rows": rows}
