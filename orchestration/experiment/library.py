"""The experiments that ship; a module of its own, because listing them needs nothing else."""

import re
from importlib.resources import files
from pathlib import Path


def shipped() -> dict[str, Path]:
    """Files of the experiments that ship, by name, in the order of their figures."""
    folder = Path(str(files("orchestration.experiment") / "library"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"), key=_numbers)}


def _numbers(path: Path) -> list[int]:
    return [int(digits) for digits in re.findall(r"\d+", path.stem)]
