"""Message for an incomplete list of a test: the missing entry, and its place."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping
from typing import Any

from fmus.kit import Effect
from fmus.kit.effects import effect_name
from tests.support.source import ROOT


def check_complete(listed: Collection[Any], wanted: Collection[Any], where: str) -> None:
    """Fail unless a list has exactly what is wanted, whatever their order.

    Parameters
    ----------
    listed : collection
        What the list at that place has.
    wanted : collection
        What it should have, such as the names of all effects.
    where : str
        File and name of the list, and what an entry says.
    """
    missing = [entry for entry in wanted if entry not in listed]
    left = [entry for entry in listed if entry not in wanted]
    assert not missing, f"add {', '.join(map(str, missing))} to {where}"
    assert not left, f"take {', '.join(map(str, left))} out of {where}"


def check_described(package: str, effects: Mapping[str, type[Effect]]) -> None:
    """Fail unless the README of a component, and the classes themselves, describe its effects.

    Parameters
    ----------
    package : str
        Of the component, in ``fmus``.
    effects : Mapping of str to type[Effect]
        Its catalogue, by name.
    """
    page = f"fmus/{package}/README.md"
    readme = (ROOT / page).read_text(encoding="utf-8")
    numbered = re.findall(r"^(\d+)\. ", readme, re.M)
    for before, (name, effect) in zip(["", *effects], effects.items(), strict=False):
        assert effect_name(effect) == name, f"{name}: list it by its id, with effects_by_name"
        assert str(effect.assumption) in numbered, (
            f"{name}: assumption = {effect.assumption!r}: write the number, of those in {page}"
        )
        row = f"| `{name}` | {effect.assumption} | `{effect.neutral}`"
        if row not in readme and os.environ.get("PPY_WRITE_DOCS"):
            readme = _with_row(readme, before, f"{row} | {effect.term.law}: {effect.term.shape} |")
            (ROOT / page).write_text(readme, encoding="utf-8")
        assert row in readme, f"{name}: PPY_WRITE_DOCS=1 adds a row to {page}: {row} | law |"
        assumption = f"assumption {effect.assumption}"
        words = " ".join((effect.__doc__ or "").split())
        assert assumption in words, f"{name}: its docstring lacks 'Relaxes {assumption}, that ...'"
        family = f"such as '{effect.term.law} over {effect.term.signal}'"
        assert effect.term.family, f"{name}: its term lacks the family, {family}"
        assert effect.neutral in effect.declared, f"{name}: neutral is none of its parameters"
        told = [parameter for size in effect.sizes for parameter in size.parameters]
        assert effect.neutral in told, f"{name}: sizes do not say how large it is"
        assert set(told) <= {*effect.declared}, f"{name}: sizes are of parameters it has not"
        for v in effect.declared.values():
            assert v.doc, f"{name}: {v.name} lacks doc="
            assert v.min <= getattr(v, "start", v.min) <= v.max, f"{name}: {v.name} is out of range"


def _with_row(readme: str, before: str, row: str) -> str:
    """Return a README with a row more in the table of effects, below that of another effect."""
    (above,) = re.findall(rf"^\| `{re.escape(before)}` \| .*\n", readme, re.M)
    return readme.replace(above, f"{above}{row}\n")


class Listed(dict[str, Any]):
    """A table by name, which says where it stands if it lacks one.

    Parameters
    ----------
    table : str
        Its name.
    module : str
        Dotted name of the module that it is in.
    entries : dict
    says : str
        What an entry says.
    """

    def __init__(self, table: str, module: str, entries: dict[str, Any], says: str):
        super().__init__(entries)
        self.where = f"{table} of {module.replace('.', '/')}.py: {says}"

    def __missing__(self, name: str) -> Any:
        raise AssertionError(f"add {name} to {self.where}")
