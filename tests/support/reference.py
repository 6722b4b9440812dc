"""Fields of a diagnosis' JSON, in ``docs/reference/diagnosis.md`` and in a JSON."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[2] / "docs"
# whose keys are names of the model; every other key is a field
NAMED = {
    "parameters": "PARAMETER",
    "holdout_fit_percent": "OUTPUT",
    "holdout_nrmse_before": "OUTPUT",
    "holdout_nrmse_after": "OUTPUT",
    "nrmse": "OUTPUT",
    "residuals": "OUTPUT",
    "untouched": "OUTPUT",
    "least_squares": "OUTPUT",
    "refitted": "OUTPUT",
    "extended": "OUTPUT",
    "outputs": "OUTPUT",
    "inputs": "INPUT",
    "fed": "INPUT",
}
FIELD = re.compile(r"^\| `([^`]+)` \|([^|]*)\| *([^|]*)\|$", re.M)


def fields(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every field that holds a figure or a text with it, names replaced by what they are names
    of.
    """
    if isinstance(value, dict):
        within = path.rpartition(".")[2]
        for key, more in value.items():
            yield from fields(more, f"{path}.{NAMED.get(within, key)}".lstrip("."))
    elif isinstance(value, list):
        for more in value:
            yield from fields(more, f"{path}[]")
    else:
        yield path, value


def documented(system: bool = False) -> dict[str, tuple[str, str]]:
    """Unit and meaning of every field, of one model or of a system, by its path."""
    page = (DOCS / "reference" / "diagnosis.md").read_text(encoding="utf-8")
    of_a_model, of_a_system = (
        page.split("## Codes of notes")[0],
        page.split("## Of a system")[1].split("## Of laws")[0],
    )
    return _table(of_a_system if system else of_a_model)


def documented_of_laws() -> dict[str, tuple[str, str]]:
    """The same of what a model's laws lack."""
    return _table(_section("Of laws"))


def documented_fields() -> set[str]:
    """Names of the fields at the top of the JSON of a model's diagnosis."""
    page = (DOCS / "reference" / "diagnosis.md").read_text(encoding="utf-8")
    return set(re.findall(r"^\| `(\w+)", page.split("## Codes of notes")[0], re.M))


def _section(title: str) -> str:
    """Return the page from the heading of a section on."""
    page = (DOCS / "reference" / "diagnosis.md").read_text(encoding="utf-8")
    return page.split(f"## {title}")[1]


def _table(text: str) -> dict[str, tuple[str, str]]:
    return {name: (unit.strip(), what) for name, unit, what in FIELD.findall(text)}


def documented_codes() -> set[str]:
    """Codes of notes."""
    page = (
        (DOCS / "reference" / "diagnosis.md")
        .read_text(encoding="utf-8")
        .split("## Codes of notes")[1]
    )
    return set(re.findall(r"^\| `([a-z_]+)` \|", page.split("## Of a system")[0], re.M))
