"""The experiments that ship; a module of its own, because listing them needs nothing else."""

import re
from importlib.resources import files
from pathlib import Path


def shipped() -> dict[str, Path]:
    """Return the files of the experiments that ship, by name.

    Those of the thesis come first, in the order of their figures.
    """
    folder = Path(str(files("orchestration.experiment") / "library"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"), key=_place)}


def _place(path: Path) -> tuple[bool, list[int], str]:
    numbers = [int(digits) for digits in re.findall(r"\d+", path.stem)]
    return not numbers, numbers, path.stem
