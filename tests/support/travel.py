"""What a result shows of itself, for comparison between processes.

As a program it reads pickles ``NAME.pickle`` of a folder and writes what each shows beside them.
"""

from __future__ import annotations

import json
import pickle
import sys
from pathlib import Path
from typing import Any

from orchestration.reporting import in_shell


def write_shown(result: Any, folder: Path) -> None:
    """Write text, figures, tables and page of a result into a folder, as far as it has them."""
    folder.mkdir(parents=True)
    with in_shell():
        (folder / "text").write_text(f"{result!r}\n{result}", encoding="utf-8")
    if hasattr(result, "to_dict") and not hasattr(result, "dims"):  # of xarray it has an encoding
        (folder / "json").write_text(json.dumps(result.to_dict(), default=str), encoding="utf-8")
    if hasattr(result, "to_frame"):
        (folder / "csv").write_text(result.to_frame().to_csv(), encoding="utf-8")
    if hasattr(result, "report"):
        result.report(folder / "page.html")


def main(folder: Path) -> None:
    """Read the pickles of a folder."""
    for path in sorted(folder.glob("*.pickle")):
        write_shown(pickle.loads(path.read_bytes()), folder / f"{path.stem}_elsewhere")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
