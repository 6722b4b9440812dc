"""The experiments that packages bring; a module of its own, because listing needs nothing else."""

import re
from pathlib import Path

from fmus.kit import registry


def shipped() -> dict[str, Path]:
    """Return the files of the experiments that packages of components bring, by name.

    Figures come first, in the order of their numbers.
    """
    return dict(sorted(registry.experiments().items(), key=_place))


def _place(named: tuple[str, Path]) -> tuple[bool, list[int], str]:
    name = named[0]
    numbers = [int(digits) for digits in re.findall(r"\d+", name)]
    return not numbers, numbers, name
