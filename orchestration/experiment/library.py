"""Experiments of the packages of components; a module of its own, as listing needs no other."""

import re
from pathlib import Path

from fmus.kit import registry


def shipped() -> dict[str, Path]:
    """Return the files of the experiments of all packages of components, by name.

    Figures come first, in the order of their numbers.
    """
    return dict(sorted(registry.experiments().items(), key=_sort_key))


def _sort_key(experiment: tuple[str, Path]) -> tuple[bool, list[int], str]:
    """Return the key that sorts by the numbers in a name, then the name; names without come last.

    For example ``fig_3_6`` comes before ``fig_3_10``.
    """
    name, _ = experiment
    numbers = [int(digits) for digits in re.findall(r"\d+", name)]
    return not numbers, numbers, name
