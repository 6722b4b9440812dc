"""Environments in which only some of the distributions that are installed can be imported."""

from __future__ import annotations

import importlib.metadata
import os
import tomllib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]
_HIDE = """
from importlib.machinery import PathFinder

HIDDEN = {hidden!r}
found = PathFinder.find_spec


def find_spec(name, path=None, target=None):
    return None if name in HIDDEN else found(name, path, target)


PathFinder.find_spec = find_spec
"""


def installation(folder: Path, *extras: str) -> dict[str, str]:
    """Write into a folder what lets processes import the distributions of ``ppy-rig[extras]``
    alone, and return their environment.
    """
    text = _HIDE.format(hidden=hidden(frozenset(extras)))
    (folder / "sitecustomize.py").write_text(text, encoding="utf-8")
    paths = [str(folder), str(ROOT), os.environ.get("PYTHONPATH")]
    return {"PYTHONPATH": os.pathsep.join(filter(None, paths))}


@cache
def hidden(extras: frozenset[str]) -> set[str]:
    """Names of packages that no distribution of ``ppy-rig[extras]`` has."""
    brought = distributions(requirements(extras)) | {canonicalize_name(PROJECT["name"])}
    return {
        name
        for name, owners in importlib.metadata.packages_distributions().items()
        if not brought & set(map(canonicalize_name, owners))
    }


def requirements(extras: Iterable[str]) -> list[Requirement]:
    """Requirements of the project as pyproject.toml has them, which may be newer than what is
    installed; an extra that names extras has theirs.
    """
    found = []
    for text in [*PROJECT["dependencies"], *_of(extras)]:
        requirement = Requirement(text)
        if requirement.name == PROJECT["name"]:
            found += requirements(requirement.extras)
        else:
            found.append(requirement)
    return found


def _of(extras: Iterable[str]) -> Iterator[str]:
    for extra in extras:
        yield from PROJECT["optional-dependencies"][extra]


def distributions(wanted: list[Requirement]) -> set[str]:
    """Names of the distributions that requirements bring, with those that these need."""
    found: set[str] = set()
    seen: set[tuple[str, frozenset[str]]] = set()
    while wanted:
        requirement = wanted.pop()
        name, extras = canonicalize_name(requirement.name), frozenset(requirement.extras)
        if (name, extras) in seen:
            continue
        seen.add((name, extras))
        found.add(name)
        for further in map(Requirement, importlib.metadata.requires(name) or []):
            environments = [{"extra": extra} for extra in extras or {""}]
            if further.marker is None or any(map(further.marker.evaluate, environments)):
                wanted.append(further)
    return found
