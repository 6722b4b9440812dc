"""The experiments that ship; a module of its own, because listing them needs nothing else."""

import re
from importlib.resources import files
from pathlib import Path


def shipped() -> dict[str, Path]:
    """Files of the experiments that ship, by name: those of the thesis in the order of their figures, then others."""
    folder = Path(str(files("orchestration.experiment") / "library"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"), key=_place)}


def _place(path: Path) -> tuple[bool, list[int], str]:
    numbers = [int(digits) for digits in re.findall(r"\d+", path.stem)]
    return not numbers, numbers, path.stem
