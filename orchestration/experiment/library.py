"""Experiments of the packages of components; a module of its own, as listing needs no other."""

import re
from pathlib import Path

from fmus.kit import registry


def shipped() -> dict[str, Path]:
    """Return the files of the experiments of all packages of components, by name.

    Figures come first, in the order of their numbers.
    """
    return dict(sorted(registry.experiments().items(), key=_place))


def _place(experiment: tuple[str, Path]) -> tuple[bool, list[int], str]:
    """Return the sort key of an experiment: its numbers, then its name; those without come last."""
    name, _ = experiment
    numbers = [int(digits) for digits in re.findall(r"\d+", name)]
    return not numbers, numbers, name
