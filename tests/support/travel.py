"""Texts, tables and pages of a result, for comparison between processes.

As a program it reads pickles ``NAME.pickle`` of a folder and writes what each shows beside them.
"""

from __future__ import annotations

import json
import pickle
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit import UserError
from orchestration.reporting import Displayable, ResultDataset

STATES = np.linspace(0.1, 0.7, 40)  # of a model; more than any has


def write_shown(result: Any, folder: Path) -> None:
    """Write text, figures, page and laws of a result into a folder, as far as it has them."""
    folder.mkdir(parents=True)
    (folder / "text").write_text(f"{result!r}\n{result}", encoding="utf-8")
    if isinstance(result, Displayable | ResultDataset):
        result.save(folder / "saved.json")
    if isinstance(result, Displayable):
        with suppress(UserError):  # it has no page
            result.report(folder / "page.html")
    cls = getattr(result, "model", None) or getattr(result, "cls", None)
    if isinstance(cls, type):
        instance: Any = cls()
        for name, value in zip((s.name for s in cls.layout.states), STATES, strict=False):
            setattr(instance, name, value)
        laws = [*map(float, instance.outputs()), *map(float, instance.rates())]
        (folder / "laws").write_text(json.dumps(laws), encoding="utf-8")


def main(folder: Path) -> None:
    """Read the pickles of a folder."""
    for path in sorted(folder.glob("*.pickle")):
        write_shown(pickle.loads(path.read_bytes()), folder / "there" / path.stem)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
